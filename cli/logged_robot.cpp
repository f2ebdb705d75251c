// SPDX-License-Identifier: Apache-2.0
#include "cli/logged_robot.hpp"

#include <fmt/format.h>

#include <cmath>

#include "palpate/io/file.hpp"
#include "palpate/io/recording_writer.hpp"
#include "palpate/io/ros_messages.hpp"
#include "palpate/io/yaml_text.hpp"

namespace palpate::cli {
namespace {

/// The recorder starts its clock at a second, so that no stamp is the zero that means "none".
std::int64_t stamp_of(double time_s) { return 1'000'000'000 + std::llround(time_s * 1e9); }

}  // namespace

void LoggedRobot::put(const std::string& topic, const std::string& type, double time_s, const std::string& data) {
  bag_.put(topic, type, stamp_of(time_s), data);
}

acquisition::RobotState LoggedRobot::read() {
  acquisition::RobotState state = robot_.read();
  const std::int64_t stamp = stamp_of(state.time_s);
  // About the origin of the frame that it is given in, as ROS has it.
  const Vec3 tip_m = state.T_base_tip.translation(), torque_nm = state.torque_nm.value_or(Vec3::Zero()) + tip_m.cross(state.force_n);
  put("/wrench", "geometry_msgs/msg/WrenchStamped", state.time_s, io::encode(io::RosWrench{{stamp, "base"}, state.force_n, torque_nm}));
  put("/tf", "tf2_msgs/msg/TFMessage", state.time_s,
      io::encode(std::vector<io::RosTransform>{{{stamp, "base"}, "tip", state.T_base_tip}}));
  if (joint_names_.size() == state.joints_rad.size())
    put("/joint_states", "sensor_msgs/msg/JointState", state.time_s,
        io::encode(io::RosJointState{{stamp, ""}, joint_names_, state.joints_rad}));
  return state;
}

DepthFrame LoggedRobot::take_depth_image() {
  DepthFrame frame = robot_.take_depth_image();
  const std::int64_t stamp = stamp_of(frame.time_s);
  put("/tf", "tf2_msgs/msg/TFMessage", frame.time_s,
      io::encode(std::vector<io::RosTransform>{{{stamp, "base"}, "camera", frame.T_base_camera}}));
  put("/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo", frame.time_s,
      io::encode(io::RosCameraInfo{{stamp, "camera"}, frame.camera}));
  put("/camera/depth/image", "sensor_msgs/msg/Image", frame.time_s,
      io::encode(io::RosImage{{stamp, "camera"}, frame.depth_m}));
  masked_ = masked_ && frame.mask.size() > 0;
  if (frame.mask.size() > 0)
    put("/camera/mask", "sensor_msgs/msg/Image", frame.time_s, io::encode(io::RosHeader{stamp, "camera"}, frame.mask));
  camera_ = frame;
  camera_.depth_m.resize(0, 0);
  return frame;
}

void LoggedRobot::write_bag(const Recording& scene, const std::filesystem::path& given) {
  std::filesystem::path folder = given.lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();
  std::filesystem::create_directories(folder);
  std::string mapping = "format: palpate-mapping/1\n" + io::object_text(scene, folder);
  mapping += "topics:\n  wrench: /wrench\n";
  if (scene.robot && !joint_names_.empty()) mapping += "  joints: /joint_states\n";
  if (camera_.camera.width_px > 0)
    mapping += fmt::format(
        "  depth:\n    - {{image: /camera/depth/image, info: /camera/depth/camera_info{}, noise: {}, pose_std_m: {}, "
        "pose_std_rad: {}}}\n",
        camera_.mask.size() > 0 ? ", mask: /camera/mask" : "", io::depth_noise_yaml(camera_.noise), camera_.pose_std_m, camera_.pose_std_rad);
  mapping += fmt::format(
      "frames: {{base: base, tip: tip}}\nwrench: {{reports: force_on_object}}   # not tared: the mean before each contact "
      "is taken off\n"
      "steps: {{by: detection, travel_sigma_m: {}, travel_offset_std_m: 0.0005}}\n",
      robot_.travel_sigma_m());
  io::write_file(folder / "mapping.yaml", mapping);
  bag_.write(folder);
}

}  // namespace palpate::cli
