// SPDX-License-Identifier: Apache-2.0
#include "cli/logged_robot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <system_error>

#include "palpate/io/file.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording_writer.hpp"
#include "palpate/io/ros_messages.hpp"
#include "palpate/io/urdf.hpp"
#include "palpate/io/yaml_text.hpp"

namespace palpate::cli {
namespace {

/// The recorder starts its clock at a second, so that no stamp is the zero that means "none".
constexpr std::int64_t begin_ns = 1'000'000'000;
std::int64_t stamp_of(double time_s) { return begin_ns + std::llround(time_s * 1e9); }

}  // namespace

EarlierRawBag earlier_raw_bag(const std::filesystem::path& folder) {
  EarlierRawBag earlier;
  std::error_code code;
  if (!std::filesystem::exists(folder / "mapping.yaml", code) || !io::is_bag(folder)) return earlier;
  const io::MessageSource bag = io::read_bag(folder);
  earlier.frames = io::frames_said(bag);
  earlier.bag.put_all(bag, "/tf_static");  // a camera that stood may move from now on
  return earlier;
}

double not_before_s(const EarlierRawBag& earlier) {
  constexpr double pause_s = 1;
  return earlier.bag.last_ns() > begin_ns ? double(earlier.bag.last_ns() - begin_ns) * 1e-9 + pause_s : 0;
}

io::BagFrames& LoggedRobot::frames(bool joints_told) {
  if (!frames_) {
    frames_.emplace(scene_.robot, joints_told ? scene_.joint_names : std::vector<std::string>());
    frames_->go_on(said_);
  }
  return *frames_;
}

void LoggedRobot::put(const std::string& topic, const std::string& type, double time_s, const std::string& data) {
  bag_.put(topic, type, stamp_of(time_s), data);
}

acquisition::RobotState LoggedRobot::read() {
  acquisition::RobotState state = robot_.read();
  const std::int64_t stamp = stamp_of(state.time_s);
  if (stamp == read_ns_) return state;  // nobody could tell the two apart
  read_ns_ = stamp;
  const bool joints_told = !state.joints_rad.empty() && scene_.joint_names.size() == state.joints_rad.size();
  io::BagFrames& frames = this->frames(joints_told);
  // About the origin of the frame that it is given in, as ROS has it.
  const Vec3 tip_m = state.T_base_tip.translation(), torque_nm = state.torque_nm.value_or(Vec3::Zero()) + tip_m.cross(state.force_n);
  put("/wrench", "geometry_msgs/msg/WrenchStamped", state.time_s, io::encode(io::RosWrench{{stamp, frames.base()}, state.force_n, torque_nm}));
  frames.robot_at(stamp, joints_told ? state.joints_rad : std::vector<double>(), state.T_base_tip, bag_);
  if (joints_told)
    put("/joint_states", "sensor_msgs/msg/JointState", state.time_s,
        io::encode(io::RosJointState{{stamp, ""}, scene_.joint_names, state.joints_rad}));
  return state;
}

double LoggedRobot::travel_sigma_m() const {
  const double sigma_m = robot_.travel_sigma_m();
  largest_sigma_m_ = std::max(largest_sigma_m_, sigma_m);
  return sigma_m;
}

DepthFrame LoggedRobot::take_depth_image() {
  DepthFrame frame = robot_.take_depth_image();
  const std::int64_t stamp = stamp_of(frame.time_s);
  const std::string name = frames(false).camera(0);
  frames_->camera_at(stamp, name, frame.T_base_camera, bag_);
  put("/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo", frame.time_s,
      io::encode(io::RosCameraInfo{{stamp, name}, frame.camera}));
  put("/camera/depth/image", "sensor_msgs/msg/Image", frame.time_s,
      io::encode(io::RosImage{{stamp, name}, frame.depth_m}));
  masked_ = masked_ && frame.mask.size() > 0;
  if (frame.mask.size() > 0)
    put("/camera/mask", "sensor_msgs/msg/Image", frame.time_s, io::encode(io::RosHeader{stamp, name}, frame.mask));
  camera_ = frame;
  camera_.depth_m.resize(0, 0);
  return frame;
}

std::string LoggedRobot::mapping_text(const std::filesystem::path& folder, const acquisition::PushOptions& protocol) {
  std::string mapping = "format: palpate-mapping/1\n" + io::object_text(scene_, folder);
  mapping += "topics:\n  wrench: /wrench\n";
  if (scene_.robot && bag_.has("/joint_states")) mapping += "  joints: /joint_states\n";
  if (camera_.camera.width_px > 0) {
    io::YamlLine line;
    line.put("image", "/camera/depth/image").put("info", "/camera/depth/camera_info");
    if (camera_.mask.size() > 0) line.put("mask", "/camera/mask");
    if (scene_.robot && masked_) line.put("mask_robot", "false");  // the masks are in the bag
    line.put("noise", io::depth_noise_yaml(camera_.noise));
    line.number("pose_std_m", camera_.pose_std_m).number("pose_std_rad", camera_.pose_std_rad);
    mapping += "  depth:\n    - " + line.str() + "\n";
  }
  return mapping + fmt::format(
                       "{}wrench: {{reports: force_on_object}}   # not tared: the mean before each "
                       "contact is taken off\nsteps: {{by: detection, travel_sigma_m: {}, travel_offset_std_m: {}}}\n",
                       frames(false).mapping_text(), largest_sigma_m_, acquisition::travel_offset_std_m(protocol, largest_sigma_m_));
}

void LoggedRobot::write_bag(const std::filesystem::path& given, const acquisition::PushOptions& protocol) {
  std::filesystem::path folder = given.lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();
  std::filesystem::create_directories(folder);
  if (scene_.robot && !bag_.has("/robot_description"))
    bag_.put("/robot_description", "std_msgs/msg/String", bag_.first_ns(), io::encode(io::urdf_for_viewers(*scene_.robot, folder)));
  io::write_file(folder / "mapping.yaml", mapping_text(folder, protocol));
  io::BagFolder whole = bag_;
  if (frames_) frames_->put_rest(whole);
  whole.write(folder);
}

void LoggedRobot::write_bag_if_small(const std::filesystem::path& folder, const acquisition::PushOptions& protocol) {
  constexpr std::size_t small_bytes = 64 << 20;
  if (bag_.size_bytes() < small_bytes) write_bag(folder, protocol);
}

}  // namespace palpate::cli
