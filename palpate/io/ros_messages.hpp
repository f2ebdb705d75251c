// SPDX-License-Identifier: Apache-2.0
// The ROS messages that recordings need, from CDR (or ROS 1's layout) into our nouns, and back to CDR. `where` stands in the
// Error of a message that is damaged or of an unknown kind.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/io/message_source.hpp"

namespace palpate::io {

struct RosHeader {
  std::int64_t stamp_ns = 0;
  std::string frame;
};
struct RosPointCloud {
  RosHeader header;
  PointCloud cloud;  ///< points that are not finite are left out
};
struct RosImage {
  RosHeader header;
  DepthImage depth_m;  ///< 16UC1 in millimetres, 32FC1 in metres (REP 118); 0 = no data
};
struct RosCameraInfo {
  RosHeader header;
  Camera camera;     ///< K and D: of the images as they were taken
  Camera rectified{};  ///< P: of the images after rectification, without distortion; focal lengths 0 where P is empty
};
struct RosJointState {
  RosHeader header;
  std::vector<std::string> names;
  std::vector<double> position;
};
struct RosWrench {
  RosHeader header;
  Vec3 force_n = Vec3::Zero(), torque_nm = Vec3::Zero();
};
struct RosTransform {
  RosHeader header;  ///< frame = parent
  std::string child;
  Pose T_parent_child = Pose::Identity();
};

/// A message type that is understood, with its definition for the files that we write.
struct RosType {
  std::string name;  ///< "sensor_msgs/msg/PointCloud2"
  std::string definition;
};
std::span<const RosType> ros_types();
/// Throws Error for a name that is not in the table.
const RosType& ros_type(const std::string& name);

RosPointCloud decode_point_cloud(std::string_view message, const std::string& where,
                                 MessageEncoding encoding = MessageEncoding::cdr);
RosImage decode_image(std::string_view message, const std::string& where, MessageEncoding encoding = MessageEncoding::cdr);
/// The compressedDepth transport: PNG of 16UC1, or of quantised inverse depth for 32FC1.
RosImage decode_compressed_depth(std::string_view message, const std::string& where,
                                 MessageEncoding encoding = MessageEncoding::cdr);
RosCameraInfo decode_camera_info(std::string_view message, const std::string& where,
                                 MessageEncoding encoding = MessageEncoding::cdr);
RosJointState decode_joint_state(std::string_view message, const std::string& where,
                                 MessageEncoding encoding = MessageEncoding::cdr);
RosWrench decode_wrench(std::string_view message, const std::string& where, MessageEncoding encoding = MessageEncoding::cdr);
std::vector<RosTransform> decode_transforms(std::string_view message, const std::string& where,
                                            MessageEncoding encoding = MessageEncoding::cdr);
std::string decode_string(std::string_view message, const std::string& where,
                          MessageEncoding encoding = MessageEncoding::cdr);

/// Time and frame of any message that begins with a header, without the rest.
RosHeader decode_header(std::string_view message, const std::string& where, MessageEncoding encoding = MessageEncoding::cdr);
/// Size and encoding of an Image ("16UC1"), without its pixels.
struct RosImageKind {
  std::size_t rows = 0, columns = 0;
  std::string encoding;
  bool is_depth() const { return encoding == "16UC1" || encoding == "mono16" || encoding == "32FC1"; }
  bool is_mask() const { return encoding == "mono8" || encoding == "8UC1"; }
};
RosImageKind decode_image_kind(std::string_view message, const std::string& where, MessageEncoding encoding = MessageEncoding::cdr);
/// The format of a CompressedImage, e.g. "16UC1; compressedDepth png".
std::string decode_compressed_format(std::string_view message, const std::string& where, MessageEncoding encoding = MessageEncoding::cdr);
/// An image of 8 bits: 1 where it is not zero.
MaskImage decode_mask(std::string_view message, const std::string& where, MessageEncoding encoding = MessageEncoding::cdr);

std::string encode(const RosPointCloud& message);
std::string encode(const RosImage& message);  ///< 32FC1, or 16UC1 when every depth is a whole number of millimetres
std::string encode(const RosHeader& header, const MaskImage& mask);  ///< mono8, 255 = invalid
std::string encode(const RosCameraInfo& message);
std::string encode(const RosJointState& message);
std::string encode(const RosWrench& message);
std::string encode(const std::vector<RosTransform>& message);
std::string encode(const std::string& message);

}  // namespace palpate::io
