// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/driver_robot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::acquisition {
namespace {

constexpr int largest_side_px = 16384;
constexpr std::uint32_t first_abi = 1;  // its struct is the beginning of today's, which it leaves zeroed from there on

PalpatePose pose_to_c(const Pose& pose) {
  const Eigen::Quaterniond q(pose.linear());
  const Vec3 p = pose.translation();
  return {{p.x(), p.y(), p.z()}, {q.w(), q.x(), q.y(), q.z()}};
}

struct Made {
  PalpateRobot robot{};
  bool done = false;
  std::string words;  // why not
};

Made make_as(std::uint32_t abi, MakeRobot make, const std::string& settings) {
  Made made;
  std::array<char, 1024> error{};
  made.done = make(abi, settings.c_str(), &made.robot, error.data(), error.size()) == PALPATE_DONE;
  error.back() = '\0';
  made.words = error.data();
  return made;
}

/// A driver cannot be asked for its version before it is made, and those of the first one refuse any other.
PalpateRobot made_robot(MakeRobot make, const std::string& settings, const std::string& name) {
  const Made own = make_as(PALPATE_ROBOT_ABI, make, settings);
  if (own.done) return own.robot;
  const Made first = make_as(first_abi, make, settings);
  if (first.done) return first.robot;
  if (own.words.empty()) throw Error("did not start and does not say why; ask its makers, or check its settings", name);
  // One of the two may be about the version only. Nobody but a person can tell which.
  throw Error(first.words.empty() || first.words == own.words ? own.words : own.words + " (asked as version 1: " + first.words + ")", name);
}

}  // namespace

DriverRobot::DriverRobot(MakeRobot make, const std::string& settings, std::string name) : name_(std::move(name)) {
  PalpateRobot made = made_robot(make, settings, name_);  // what is refused is not destroyed: its layout may be another one
  if (made.abi < first_abi || made.abi > PALPATE_ROBOT_ABI)
    throw Error("was built for version " + std::to_string(made.abi) + " of driver.h, this program knows versions " +
                    std::to_string(first_abi) + " to " + std::to_string(PALPATE_ROBOT_ABI) +
                    "; build the driver anew with this program's header",
                name_);
  if (made.abi < 2) {
    made.limits = nullptr;
    made.look = nullptr;
  }
  const auto need = [&](bool there, const char* call) {
    if (!there) throw Error("leaves the call `" + std::string(call) + "` empty; fill it in", name_);
  };
  need(made.read != nullptr, "read");
  need(made.move != nullptr, "move");
  need(made.stop != nullptr, "stop");
  need(made.take_depth_image != nullptr, "take_depth_image");
  need(made.wait != nullptr, "wait");
  need(made.travel_sigma_m != nullptr, "travel_sigma_m");
  need(made.last_error != nullptr, "last_error");
  need(made.destroy != nullptr, "destroy");
  robot_ = made;
}

DriverRobot::~DriverRobot() {
  if (robot_.destroy != nullptr) robot_.destroy(robot_.self);
}

void DriverRobot::failed(const char* call, const std::string& what) const { throw Error(what, name_ + ", " + call); }

void DriverRobot::expect_done(const char* call, int answer) const {
  if (answer == PALPATE_DONE) return;
  const char* words = robot_.last_error(robot_.self);
  failed(call, words != nullptr && *words != '\0' ? words : "failed and does not say why");
}

Pose DriverRobot::pose_of(const char* call, const char* field, const PalpatePose& pose) const {
  const Vec3 position(pose.position_m[0], pose.position_m[1], pose.position_m[2]);
  const Eigen::Quaterniond q(pose.rotation_wxyz[0], pose.rotation_wxyz[1], pose.rotation_wxyz[2], pose.rotation_wxyz[3]);
  if (!position.allFinite()) failed(call, std::string(field) + ": the position is not finite");
  if (!(std::abs(q.norm() - 1) < 1e-3))
    failed(call, std::string(field) + ": the rotation is no unit quaternion (w, x, y, z)");
  Pose out = Pose::Identity();
  out.linear() = q.normalized().toRotationMatrix();
  out.translation() = position;
  return out;
}

RobotState DriverRobot::read() {
  PalpateRobotState given{};
  expect_done("read", robot_.read(robot_.self, &given));
  if (given.joints < 0 || given.joints > PALPATE_MAX_JOINTS)
    failed("read", "joints: must be from 0 to " + std::to_string(int(PALPATE_MAX_JOINTS)));
  RobotState state;
  state.time_s = given.time_s;
  state.joints_rad.assign(given.joints_rad, given.joints_rad + given.joints);
  state.force_n = Vec3(given.force_n[0], given.force_n[1], given.force_n[2]);
  if (!state.force_n.allFinite()) failed("read", "force_n: is not finite; is the sensor connected?");
  if (given.has_torque != 0) {
    state.torque_nm = Vec3(given.torque_nm[0], given.torque_nm[1], given.torque_nm[2]);
    if (!state.torque_nm->allFinite()) failed("read", "torque_nm: is not finite; say has_torque = 0 where none is measured");
  }
  if (!std::all_of(state.joints_rad.begin(), state.joints_rad.end(), [](double q) { return std::isfinite(q); }))
    failed("read", "joints_rad: is not finite");
  if (!std::isfinite(given.time_s) || given.time_s < clock_s_) failed("read", "time_s: the clock must not go back");
  clock_s_ = given.time_s;
  state.T_base_tip = pose_of("read", "T_base_tip", given.T_base_tip);
  return state;
}

Motion DriverRobot::move(const Pose& T_base_tip, double speed_m_s) {
  const PalpatePose pose = pose_to_c(T_base_tip);
  const int answer = robot_.move(robot_.self, &pose, speed_m_s);
  if (answer == PALPATE_REFUSED) return Motion::refused;
  expect_done("move", answer);
  return Motion::done;
}

void DriverRobot::stop() { expect_done("stop", robot_.stop(robot_.self)); }

void DriverRobot::wait(double duration_s) { expect_done("wait", robot_.wait(robot_.self, duration_s)); }

DepthFrame DriverRobot::take_depth_image() {
  PalpateDepthImage given{};
  expect_done("take_depth_image", robot_.take_depth_image(robot_.self, &given));
  return frame_of("take_depth_image", given);
}

std::optional<DepthFrame> DriverRobot::look(int view, int views) {
  if (robot_.look == nullptr) return std::nullopt;
  PalpateDepthImage given{};
  expect_done("look", robot_.look(robot_.self, view, views, &given));
  return frame_of("look", given);
}

DepthFrame DriverRobot::frame_of(const char* call, const PalpateDepthImage& given) const {
  const auto need = [&](bool good, const char* what) {
    if (!good) failed(call, what);
  };
  need(given.width_px > 0 && given.height_px > 0 && given.width_px <= largest_side_px && given.height_px <= largest_side_px,
       "width_px, height_px: must be from 1 to 16384");
  need(given.depth_m != nullptr, "depth_m: must point to the pixels");
  need(std::isfinite(given.fx_px) && std::isfinite(given.fy_px) && given.fx_px > 0 && given.fy_px > 0, "fx_px, fy_px: must be positive");
  need(std::isfinite(given.cx_px) && std::isfinite(given.cy_px), "cx_px, cy_px: must be finite");
  need(std::isfinite(given.time_s), "time_s: must be finite");
  need(given.pose_std_m >= 0 && given.pose_std_rad >= 0, "pose_std_m, pose_std_rad: must not be negative");
  DepthFrame frame;
  frame.time_s = given.time_s;
  frame.camera.width_px = given.width_px;
  frame.camera.height_px = given.height_px;
  frame.camera.fx_px = given.fx_px;
  frame.camera.fy_px = given.fy_px;
  frame.camera.cx_px = given.cx_px;
  frame.camera.cy_px = given.cy_px;
  frame.T_base_camera = pose_of(call, "T_base_camera", given.T_base_camera);
  frame.pose_std_m = given.pose_std_m;
  frame.pose_std_rad = given.pose_std_rad;
  if (given.noise_model != nullptr) {
    frame.noise.model = sensing::depth_noise_model(given.noise_model).name;
  } else {
    need(given.sigma_m > 0, "sigma_m: must be positive where no noise_model is named");
    frame.noise.sigma_m = given.sigma_m;
  }
  frame.depth_m = Eigen::Map<const DepthImage>(given.depth_m, given.height_px, given.width_px)
                      .unaryExpr([](float depth) { return std::isfinite(depth) && depth > 0 ? depth : 0.0F; });
  if (given.mask != nullptr)
    frame.mask = Eigen::Map<const MaskImage>(given.mask, given.height_px, given.width_px).cwiseMin(std::uint8_t{1});
  return frame;
}

double DriverRobot::travel_sigma_m() const {
  const double sigma_m = robot_.travel_sigma_m(robot_.self);
  if (!(sigma_m > 0) || !std::isfinite(sigma_m)) failed("travel_sigma_m", "must be positive");
  return sigma_m;
}

RobotLimits DriverRobot::limits() const {
  RobotLimits limits;
  if (robot_.limits == nullptr) return limits;
  PalpateLimits given{limits.force_n, limits.travel_m, limits.speed_m_s};
  expect_done("limits", robot_.limits(robot_.self, &given));
  const auto need = [&](double limit, const char* field) {
    if (!(limit > 0)) failed("limits", std::string(field) + ": must be positive; leave it infinite where there is no limit");
  };
  need(given.force_n, "force_n");
  need(given.travel_m, "travel_m");
  need(given.speed_m_s, "speed_m_s");
  return {given.force_n, given.travel_m, given.speed_m_s};
}

bool DriverRobot::reaches(const Pose& T_base_tip) const {
  const PalpatePose pose = pose_to_c(T_base_tip);
  return robot_.reaches == nullptr || robot_.reaches(robot_.self, &pose) != 0;
}

}  // namespace palpate::acquisition
