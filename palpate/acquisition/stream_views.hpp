// SPDX-License-Identifier: Apache-2.0
// What cameras saw at the times of steps: images and clouds with their poses, the robot left out. Inner header of the room `acquisition`.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "palpate/acquisition/frame_tree.hpp"
#include "palpate/acquisition/repeated_notes.hpp"
#include "palpate/acquisition/stream_joints.hpp"
#include "palpate/core/streams.hpp"
#include "palpate/sensing/cloud_mask.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::acquisition {

class StreamViews {
 public:
  /// All but the offsets must outlive this.
  /// @param camera_offset_s  one a camera, added to its times to get those of the arm; cloud_offset_s as well
  StreamViews(const StreamPlan& plan, const SensorStreams& streams, const FrameTree& tree, std::vector<double> camera_offset_s, double cloud_offset_s);

  /// When the image that will belong to a step was taken; without one, the step's own time.
  double seen_at(double time_s) const;
  /// Adds what belongs to the step's time; an image belongs to one step. Joints that do not say where the robot is are taken out of it.
  void look(Step& step, RepeatedNotes& notes);
  /// The images at StreamPlan::views_at_s. @throws Error for a time without any
  std::vector<DepthFrame> of_rest(RepeatedNotes& notes);

 private:
  struct PosedRobot {
    Pose T_base_root;
    NamedJoints joints;
  };

  std::optional<Pose> pose_of(const std::string& frame, double time_s) const;
  std::optional<PosedRobot> robot_to_mask(std::optional<bool> wanted, double time_s, double step_s, const std::string& where, const std::string& topics,
                                          RepeatedNotes& notes);
  std::optional<DepthFrame> frame_of(std::size_t camera, std::size_t image, double step_s, RepeatedNotes& notes);
  void look_at_clouds(Step& step, RepeatedNotes& notes);

  const StreamPlan& plan_;
  const SensorStreams& streams_;
  const FrameTree& tree_;
  std::vector<double> camera_offset_s_;
  double cloud_offset_s_;
  std::vector<std::set<std::size_t>> used_images_, used_clouds_;
  std::unique_ptr<sensing::RobotMask> mask_;
  std::unique_ptr<sensing::RobotInClouds> in_clouds_;
};

}  // namespace palpate::acquisition
