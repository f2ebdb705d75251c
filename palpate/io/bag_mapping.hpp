// SPDX-License-Identifier: Apache-2.0
// mapping.yaml (docs/recording-format.md, "Bags"): what the topics and frames of a bag mean, and the object that was pushed.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/streams.hpp"
#include "palpate/io/message_source.hpp"

namespace palpate::io {

struct MappedTopic {
  std::string name;
  std::string where;  ///< file, line and field
};

struct MappedCamera {
  MappedTopic image, info;
  std::optional<MappedTopic> mask;
  std::string frame;  ///< empty = what the images say
  DepthFrame like;    ///< noise and pose priors
  std::string noise_where;         ///< of the noise's model: file, line and field
  std::optional<bool> mask_robot;  ///< absent: where its description, joints and pose are known
  std::optional<bool> rectified;   ///< absent: told by the topic's name
};

struct MappedCloud {
  MappedTopic topic;
  std::string frame;
  std::optional<bool> mask_robot;  ///< absent: where its description, joints and pose are known
  double sigma_m = 0, pose_std_m = 0, pose_std_rad = 0;
};

/// A frame whose place on another one no topic tells: the tip of a stick, or a camera by a calibration of one's own.
struct FixedFrame {
  std::string parent, child;
  Pose T_parent_child = Pose::Identity();
  std::string where, parent_where;  ///< file, line and field
};

struct BagMapping {
  StreamPlan plan;
  std::optional<MappedTopic> wrench, joints, robot_description, marks;
  std::vector<MappedTopic> transforms;  ///< empty = every topic of TFMessage
  std::vector<FixedFrame> fixed_frames;  ///< stand in place of what the transforms say of the same child
  std::vector<MappedCamera> cameras;
  std::vector<MappedCloud> clouds;
  bool use_log_time = false;  ///< else the stamps in the messages' headers
  std::filesystem::path root;
};

/// Reads and checks a mapping; files that it names lie beside it. Throws Error naming file, line, field and cure.
BagMapping read_mapping(const std::filesystem::path& path);

/// What the mapped topics hold, as series; times count from the bag's first message. Messages that are damaged are left out
/// with a warning. @throws Error naming the mapping's line when a topic is not in the bag or of a type that does not fit.
SensorStreams read_streams(const MessageSource& bag, BagMapping& mapping);

}  // namespace palpate::io
