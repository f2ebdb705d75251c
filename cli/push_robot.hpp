// SPDX-License-Identifier: Apache-2.0
// The robot that `record` and `explore` push with: the lab's, or one that a driver brings.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/lab_setup.hpp"
#include "palpate/acquisition/push_protocol.hpp"

namespace palpate::cli {

struct RobotArguments {
  LabArguments lab;
  std::filesystem::path driver, scene;
  std::string settings, tool;
  std::vector<std::array<double, 3>> contacts, directions;  ///< a push each; directions: or one for all, or none
};

/// What add_lab_options adds, and --driver, --driver-settings, --scene, --tool.
void add_robot_options(CLI::App& app, RobotArguments& arguments);
/// --views, of record and explore.
void add_views_option(CLI::App& app, int& views);
/// --contact and --direction of the pushes that are to be made.
void add_contact_options(CLI::App& app, RobotArguments& arguments);

class PushRobot {
 public:
  virtual ~PushRobot() = default;
  virtual acquisition::Robot& robot() = 0;
  /// Object, supports, tools and priors, without pushes.
  virtual Recording scene() const = 0;
  virtual std::size_t sites() const = 0;
  virtual acquisition::PushPlan plan(std::size_t site) = 0;
  virtual acquisition::PushPlan plan_at(const Vec3& contact_m, const Vec3& direction) = 0;
  virtual bool reaches(const Vec3& contact_m, const Vec3& direction, double start_distance_m) const = 0;
  /// Between recorded steps, where the user says nothing.
  virtual double force_step_n(std::size_t site) const = 0;
  virtual double travel_limit_m() const = 0;
  /// The recording has so many steps already: a simulation must not err as it did then.
  virtual void go_on_after([[maybe_unused]] std::size_t steps) {}
  /// What only a simulation knows; nothing where the world is real.
  virtual std::optional<nlohmann::json> truth() const { return {}; }
  virtual nlohmann::json truth_of(const Push&, const Step&) const { return {}; }
};

/// The object's shape as it is seen from so many sides, in place of the scene's.
/// @returns false where the user stopped it  @throws Error where the robot does not carry its camera around
bool look_around(PushRobot& robot, int views, Recording& scene);

/// @throws Error for what the arguments say wrong together, or a driver that cannot be used.
std::unique_ptr<PushRobot> push_robot(const RobotArguments& arguments, std::uint64_t seed);

}  // namespace palpate::cli
