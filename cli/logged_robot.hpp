// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "palpate/acquisition/robot.hpp"
#include "palpate/io/bag_folder.hpp"

namespace palpate::cli {

/// A robot whose every reading is kept as a recorder of ROS would keep it: joint states, forces as the sensor says them (not
/// tared), poses of tip and camera, depth images. Nothing in the bag says what a push or a step is.
class LoggedRobot : public acquisition::Robot {
 public:
  LoggedRobot(acquisition::Robot& robot, std::vector<std::string> joint_names) : robot_(robot), joint_names_(std::move(joint_names)) {}

  acquisition::RobotState read() override;
  acquisition::Motion move(const Pose& T_base_tip, double speed_m_s) override { return robot_.move(T_base_tip, speed_m_s); }
  void stop() override { robot_.stop(); }
  DepthFrame take_depth_image() override;
  void wait(double duration_s) override { robot_.wait(duration_s); }
  double travel_sigma_m() const override { return robot_.travel_sigma_m(); }
  acquisition::RobotLimits limits() const override { return robot_.limits(); }
  void on_the_way(bool is) override { robot_.on_the_way(is); }
  std::optional<DepthFrame> look(int view, int views) override { return robot_.look(view, views); }

  /// True when every image so far said which of its pixels show the robot.
  bool is_masked() const { return masked_; }

  /// Writes a folder of rosbag2 and FOLDER/mapping.yaml, by which steps are found in it again.
  /// @param scene  object, supports, tools and robot, without pushes
  void write_bag(const Recording& scene, const std::filesystem::path& folder);

 private:
  void put(const std::string& topic, const std::string& type, double time_s, const std::string& data);

  acquisition::Robot& robot_;
  io::BagFolder bag_;
  DepthFrame camera_;  ///< of the last image, without its pixels
  std::vector<std::string> joint_names_;
  bool masked_ = true;
};

}  // namespace palpate::cli
