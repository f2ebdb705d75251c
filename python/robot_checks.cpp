// SPDX-License-Identifier: Apache-2.0
#include "python/robot_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>

#include "palpate/core/error.hpp"
#include "palpate/core/physical_range.hpp"
#include "palpate/core/recording_values.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::python {
namespace {

constexpr int largest_side_px = 16384;  // as of drivers

/// Of one call of the robot.
class Checked {
 public:
  explicit Checked(const char* call) : call_(call) {}

  [[noreturn]] void fail(const std::string& field, const std::string& what) const { throw Error(what, "robot." + std::string(call_) + "()." + field); }
  void need(bool good, const char* field, const std::string& what) const {
    if (!good) fail(field, what);
  }
  void need_time(double time_s) const {
    need(std::isfinite(time_s), "time_s", "must be finite");
    const PhysicalRange& range = ranges::time;
    need(time_s >= range.least && time_s <= range.most, "time_s", fmt::format("is {:g} s, which cannot be; {}", time_s, range.slip));
  }
  /// What another room refuses, by the call that it came from.
  template <typename Check>
  void as(Check&& check) const {
    try {
      check();
    } catch (const Error& wrong) {
      fail(wrong.where(), wrong.message());
    }
  }

 private:
  const char* call_;
};

/// Whatever else a recording's step may not hold.
DepthFrame as_recorded(DepthFrame frame, const Checked& of) {
  Step step;
  step.observations.emplace_back(std::move(frame));
  const std::string place = "observations[0].";
  for (const WrongValue& wrong : wrong_values(step, {}, "")) of.fail(wrong.where.substr(wrong.where.starts_with(place) ? place.size() : 0), wrong.what);
  return std::get<DepthFrame>(std::move(step.observations[0]));
}

}  // namespace

void check_state(const acquisition::RobotState& state, double& clock_s) {
  const Checked of("read");
  of.need(state.force_n.allFinite(), "force_n", "is not finite; is the sensor connected?");
  if (state.torque_nm) of.need(state.torque_nm->allFinite(), "torque_nm", "is not finite; give None where none is measured");
  of.need(std::all_of(state.joints_rad.begin(), state.joints_rad.end(), [](double q) { return std::isfinite(q); }), "joints_rad", "is not finite");
  of.need_time(state.time_s);
  of.need(state.time_s >= clock_s, "time_s", fmt::format("the clock must not go back, from {:.6f} to {:.6f} s", clock_s, state.time_s));
  clock_s = state.time_s;
}

DepthFrame checked_frame(DepthFrame frame, const char* call) {
  const Checked of(call);
  const auto is_side = [](int side_px) { return side_px > 0 && side_px <= largest_side_px; };
  of.need(is_side(frame.camera.width_px) && is_side(frame.camera.height_px), "camera.width_px, height_px", "must be from 1 to " + std::to_string(largest_side_px));
  of.as([&] { sensing::check(frame.camera); });
  of.need_time(frame.time_s);
  of.need(frame.pose_std_m >= 0 && frame.pose_std_rad >= 0, "pose_std_m, pose_std_rad", "must not be negative");
  of.as([&] { sensing::axial_sigma_m(frame.noise, {}); });  // a model that is known, or a sigma of its own
  frame = as_recorded(std::move(frame), of);
  frame.depth_m = frame.depth_m.unaryExpr([](float depth) { return std::isfinite(depth) ? depth : 0.0F; }).eval();
  of.need((frame.depth_m.array() >= 0).all(), "depth_m", "holds a negative depth; depth is positive along the optical axis, 0 where there is none");
  frame.mask = frame.mask.cwiseMin(std::uint8_t{1}).eval();
  return frame;
}

void check_limits(const acquisition::RobotLimits& limits) {
  const auto need = [](double limit, const char* field) {
    if (!(limit > 0)) throw Error("must be positive; leave it infinite where there is no limit", std::string("robot.limits.") + field);
  };
  need(limits.force_n, "force_n");
  need(limits.travel_m, "travel_m");
  need(limits.speed_m_s, "speed_m_s");
}

}  // namespace palpate::python
