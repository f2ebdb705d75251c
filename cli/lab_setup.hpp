// SPDX-License-Identifier: Apache-2.0
// The lab as `record`, `explore` and `check` set it up: options of the command line and the robot that they make.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "palpate/lab/object.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::cli {

struct LabArguments {
  std::string object = "cube", material, depth_sensor = "realsense_d435", force_sensor = "generic";
  double young_modulus_pa = 0;  ///< 0: drawn from the seed
  double poisson_ratio = -1;    ///< below 0: drawn from the seed
  double region_ratio = 1;      ///< 1: one stiffness everywhere
  lab::LabOptions lab;          ///< what goes wrong in it: compliance, relaxation, slip, sliding
};

/// What the lab pushes, with what, and what goes wrong then.
void add_lab_options(CLI::App& app, LabArguments& arguments);

/// A name of the lab's table, or a mesh file.
lab::LabObject lab_object(const LabArguments& arguments, std::uint64_t seed);
lab::LabOptions lab_options(const LabArguments& arguments, std::uint64_t seed);

/// What the simulation knows and the recording does not; `steps` is empty.
nlohmann::json truth_json(const lab::LabRobot& robot);
nlohmann::json truth_json(const Push& push, const Step& step, const lab::LabRobot& robot);

void write_json(const nlohmann::json& json, const std::filesystem::path& path);

}  // namespace palpate::cli
