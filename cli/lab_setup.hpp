// SPDX-License-Identifier: Apache-2.0
// The lab as `record`, `explore` and `check` set it up: options of the command line and the robot that they make.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "palpate/lab/object.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::cli {

/// How a mesh file is taken: many are not in metres, and have y upwards.
struct MeshFileArguments {
  std::string up = "z";  ///< axis of the file
  double size_m = 0;     ///< longest extent; 0: as the file has it
};
void add_mesh_file_options(CLI::App& app, MeshFileArguments& arguments);
TriMesh read_object(const std::string& file, const MeshFileArguments& arguments);

struct LabArguments {
  MeshFileArguments file;
  std::string object = "cube", material, depth_sensor = "realsense_d435", force_sensor = "generic";
  double young_modulus_pa = 0;  ///< 0: drawn from the seed
  double poisson_ratio = -1;    ///< below 0: drawn from the seed
  double region_ratio = 1;      ///< 1: one stiffness everywhere
  std::string stands = "glued";  ///< or rough
  double friction_coefficient = lab::ObjectOptions().friction_coefficient;
  bool wall = false;
  std::string tip = "pad";  ///< or punch
  double ambient_light = lab::DepthSensorOptions().ambient_light;
  double albedo = 0, texture = -1;  ///< 0 and below 0: as the object usually is
  std::vector<double> arm_at;       ///< x and y in metres, turn about z in radians; empty: where the frame begins
  std::string camera = "stands";    ///< or hand
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
