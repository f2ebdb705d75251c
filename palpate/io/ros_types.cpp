// SPDX-License-Identifier: Apache-2.0
// Message definitions as rosbag2 stores them: the type, then every type that it uses behind a line of 80 equal signs.
#include <algorithm>
#include <sstream>

#include "palpate/core/error.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io {
namespace {

struct Part {
  const char* name;  ///< "sensor_msgs/Image"
  const char* fields;
  bool is_message;  ///< understood as a topic's type; others are parts of those
};

constexpr Part parts[] = {
    {"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n", false},
    {"std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n", false},
    {"std_msgs/String", "string data\n", true},
    {"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n", false},
    {"geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n", false},
    {"geometry_msgs/Transform", "Vector3 translation\nQuaternion rotation\n", false},
    {"geometry_msgs/TransformStamped", "std_msgs/Header header\nstring child_frame_id\nTransform transform\n", false},
    {"geometry_msgs/Wrench", "Vector3 force\nVector3 torque\n", false},
    {"geometry_msgs/WrenchStamped", "std_msgs/Header header\nWrench wrench\n", true},
    {"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n", true},
    {"sensor_msgs/PointField",
     "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n"
     "uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n",
     false},
    {"sensor_msgs/PointCloud2",
     "std_msgs/Header header\nuint32 height\nuint32 width\nPointField[] fields\nbool is_bigendian\nuint32 point_step\n"
     "uint32 row_step\nuint8[] data\nbool is_dense\n",
     true},
    {"sensor_msgs/Image",
     "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n",
     true},
    {"sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n", true},
    {"sensor_msgs/RegionOfInterest", "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
     false},
    {"sensor_msgs/CameraInfo",
     "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] "
     "r\n"
     "float64[12] p\nuint32 binning_x\nuint32 binning_y\nRegionOfInterest roi\n",
     true},
    {"sensor_msgs/JointState",
     "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n", true},
};

const Part* find_part(const std::string& name) {
  const auto found = std::find_if(std::begin(parts), std::end(parts), [&](const Part& part) { return name == part.name; });
  return found == std::end(parts) ? nullptr : found;
}

/// Appends the types that `part` uses and that are not there yet.
void collect(const Part& part, std::vector<const Part*>& used) {
  const std::string name = part.name, package = name.substr(0, name.find('/') + 1);
  std::istringstream lines(part.fields);
  for (std::string line; std::getline(lines, line);) {
    const std::string type = line.substr(0, line.find_first_of(" ["));
    const Part* found = find_part(type.find('/') == std::string::npos ? package + type : type);
    if (found == nullptr || std::find(used.begin(), used.end(), found) != used.end()) continue;
    used.push_back(found);
    collect(*found, used);
  }
}

std::vector<RosType> compose() {
  std::vector<RosType> types;
  for (const Part& part : parts) {
    if (!part.is_message) continue;
    std::vector<const Part*> used;
    collect(part, used);
    std::string definition = part.fields;
    for (const Part* one : used) definition += std::string(80, '=') + "\nMSG: " + one->name + "\n" + one->fields;
    types.push_back({ros2_type_name(part.name), definition});
  }
  return types;
}

}  // namespace

std::span<const RosType> ros_types() {
  static const std::vector<RosType> types = compose();
  return types;
}

const RosType& ros_type(const std::string& name) {
  for (const RosType& type : ros_types()) {
    if (name == type.name) return type;
  }
  throw Error("there is no message type '" + name + "' in the table", "ros_type");
}

}  // namespace palpate::io
