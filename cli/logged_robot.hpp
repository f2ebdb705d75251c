// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/acquisition/robot.hpp"
#include "palpate/io/bag_folder.hpp"
#include "palpate/io/bag_frames.hpp"

namespace palpate::cli {

/// What an earlier run left of a raw bag, to be gone on with; empty where there is none.
struct EarlierRawBag {
  io::BagFolder bag;
  io::FramesSaid frames;
};
EarlierRawBag earlier_raw_bag(const std::filesystem::path& folder);
/// When a robot's clock may go on after what is in the bag, s; 0 where it is empty.
double not_before_s(const EarlierRawBag& earlier);

/// A robot whose every reading is kept as a recorder of ROS would keep it: joint states, forces as the sensor says them (not
/// tared), poses of links, tip and camera, depth images, the robot's description. Nothing in the bag says what a push or a step is.
class LoggedRobot : public acquisition::Robot {
 public:
  /// @param scene  object, supports, tools and robot, as they are recorded; its pushes have no say
  LoggedRobot(acquisition::Robot& robot, Recording scene, EarlierRawBag earlier)
      : robot_(robot), bag_(std::move(earlier.bag)), said_(std::move(earlier.frames)), scene_(std::move(scene)) {}

  acquisition::RobotState read() override;
  acquisition::Motion move(const Pose& T_base_tip, double speed_m_s) override { return robot_.move(T_base_tip, speed_m_s); }
  void stop() override { robot_.stop(); }
  DepthFrame take_depth_image() override;
  void wait(double duration_s) override { robot_.wait(duration_s); }
  double travel_sigma_m() const override;
  acquisition::RobotLimits limits() const override { return robot_.limits(); }
  void on_the_way(bool is) override { robot_.on_the_way(is); }
  std::optional<DepthFrame> look(int view, int views) override { return robot_.look(view, views); }

  /// Writes all that was said so far, as a folder of rosbag2, and FOLDER/mapping.yaml, by which steps are found in it again.
  /// @param protocol  by which the robot pushes
  void write_bag(const std::filesystem::path& folder, const acquisition::PushOptions& protocol);
  /// The same, unless so much has been said that to write it after every step would take the run's time.
  void write_bag_if_small(const std::filesystem::path& folder, const acquisition::PushOptions& protocol);

 private:
  void put(const std::string& topic, const std::string& type, double time_s, const std::string& data);
  /// @param joints_told  by the first reading: what it says of the links decides how frames hang together
  io::BagFrames& frames(bool joints_told);
  std::string mapping_text(const std::filesystem::path& folder, const acquisition::PushOptions& protocol);

  acquisition::Robot& robot_;
  io::BagFolder bag_;
  io::FramesSaid said_;
  std::optional<io::BagFrames> frames_;
  Recording scene_;
  std::int64_t read_ns_ = 0;  ///< stamp of the last reading
  mutable double largest_sigma_m_ = 0;  ///< of the travel: an arm's changes with its pose, a mapping states one
  DepthFrame camera_;  ///< of the last image, without its pixels
  bool masked_ = true;  ///< every image so far said which of its pixels show the robot
};

}  // namespace palpate::cli
