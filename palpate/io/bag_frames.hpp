// SPDX-License-Identifier: Apache-2.0
// The frames of the bags that we write: one name a frame, one parent each, and all transforms of a stamp in one message.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/io/bag_folder.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io {

/// What an earlier part of a bag says of frames.
struct FramesSaid {
  std::map<std::string, std::string> parents;               ///< on /tf, by child
  std::vector<RosTransform> fixed;                          ///< on /tf_static
  std::map<std::string, std::vector<std::int64_t>> images;  ///< stamps of a camera's images, by its frame
};
FramesSaid frames_said(const MessageSource& bag);

class BagFrames {
 public:
  /// @param robot        its root link is the frame that everything is given in
  /// @param joint_names  in whose order positions come; empty: none are told, and links have no transforms
  BagFrames(const std::optional<RobotModel>& robot, const std::vector<std::string>& joint_names);

  const std::string& base() const { return base_; }
  const std::string& tip() const { return tip_; }
  /// Of the camera of that number, from 0.
  std::string camera(std::size_t number) const;
  /// The mapping's line about them.
  std::string mapping_text() const;
  /// A bag with an earlier part, without its /tf_static. @throws Error where that hung a frame on another one than this.
  void go_on(const FramesSaid& said);

  /// Every link where the joints put it, and the tip. A stamp that was told before is left out; without joints the last ones count.
  void robot_at(std::int64_t stamp_ns, const std::vector<double>& joints_rad, const std::optional<Pose>& T_base_tip, BagFolder& bag);
  /// Known beforehand of all images that are to come.
  void camera_stands(const std::string& frame, const Pose& T_base_camera);
  void camera_moves(const std::string& frame) { cameras_[frame].moves = true; }
  /// A camera of which nothing is known and that has not moved so far waits for `put_rest`, and with it the message of the stamp.
  /// Of one that is a link the robot is said to stand where it was last.
  void camera_at(std::int64_t stamp_ns, const std::string& frame, const Pose& T_base_camera, BagFolder& bag);
  /// What is still held back, and on /tf_static the cameras that never moved, as of the bag's start.
  void put_rest(BagFolder& bag) const;

 private:
  struct Joint {
    RobotJoint about;
    std::size_t parent = 0, child = 0;    // links
    std::optional<std::size_t> position;  // whose value moves it, among those that are told
  };
  struct Seen {
    Pose T_base_camera = Pose::Identity();
    std::vector<std::int64_t> stamps_ns;  ///< of its images, as long as it may still turn out to move
    bool moves = false, stands = false;
  };
  bool places_links() const { return !joints_.empty(); }
  bool is_leaf(std::size_t link) const;
  std::string name_for(std::string wanted, const std::string& prefix) const;
  std::string parent_of(const std::string& frame) const;
  void put_robot(std::int64_t stamp_ns, BagFolder& bag);
  void add(std::int64_t stamp_ns, RosTransform transform, BagFolder& bag);
  void close_stamp(BagFolder& bag);

  std::vector<std::string> links_;
  std::map<std::string, std::size_t> parents_;  // of links that hang on another
  std::vector<Joint> joints_;                   // parents first; empty where nobody tells where the links are
  std::string base_ = "base", tip_;
  std::size_t tip_parent_ = 0;

  std::vector<Pose> T_base_link_;    // as last told
  std::vector<RosTransform> robot_;  // the same and the tip, as transforms
  std::set<std::int64_t> told_ns_;   // stamps of the robot
  std::int64_t waiting_ns_ = 0;
  std::vector<RosTransform> waiting_;                          // of that stamp: more may come
  std::map<std::int64_t, std::vector<RosTransform>> held_;  // until it is known whether a camera stands
  std::map<std::string, Seen> cameras_;
};

}  // namespace palpate::io
