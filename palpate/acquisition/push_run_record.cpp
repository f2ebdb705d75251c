// SPDX-License-Identifier: Apache-2.0
// What is listened for while the tip stands, and what is written down of it.
#include "palpate/acquisition/push_run.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "palpate/acquisition/force_begin.hpp"
#include "palpate/sensing/plane_mask.hpp"
#include "palpate/sensing/rest_change.hpp"

namespace palpate::acquisition {

PushRun::FreeAir PushRun::listen() {
  FreeAir air;
  std::vector<Vec3> forces;
  std::vector<std::optional<Vec3>> torques;
  for (int i = 0; i < options_.free_air_samples; ++i) {
    ask_user();
    robot_.wait(options_.sample_period_s);
    air.last = robot_.read();
    forces.push_back(air.last.force_n);
    torques.push_back(air.last.torque_nm);
    air.mean_n += air.last.force_n / options_.free_air_samples;
    air.time_s += air.last.time_s / options_.free_air_samples;
  }
  double square = 0;
  Vec3 squares = Vec3::Zero();
  for (const Vec3& f : forces) {
    square += std::pow(along(f - air.mean_n), 2);
    squares += (f - air.mean_n).cwiseAbs2();
  }
  const int freedom = std::max(1, options_.free_air_samples - 1);
  air.std_n = std::sqrt(square / freedom);
  air.std_of_worst_axis_n = std::sqrt(squares.maxCoeff() / freedom);
  air.torque = torque_mean(torques);
  return air;
}

void PushRun::look_at_rest() {
  come_to_start();
  const FreeAir air = listen();
  report_.tare_n = air.mean_n;
  tared_at_s_ = air.time_s;
  free_air_std_n_ = air.std_n;
  worst_axis_std_n_ = air.std_of_worst_axis_n;
  R_base_tip_tared_ = air.last.T_base_tip.linear();
  torque_tare_ = air.torque;
  if (torque_tare_ && options_.contact_std_m > 0) {
    push_.torque_tare_std_nm = torque_tare_->mean_std_nm();
    push_.tip_std_m = options_.contact_std_m;  // where the arm believes its tip to be is what makes the contact uncertain
  }
  const double travel_sigma_m = robot_.travel_sigma_m();
  lengths_.state_noise(free_air_std_n_, travel_sigma_m);
  // A push that goes on is one push with one statement.
  push_.force_tare_std_n = std::max(free_air_std_n_ / std::sqrt(double(options_.free_air_samples)), recorded_.force_tare_std_n);
  push_.travel_offset_std_m = std::max(travel_offset_std_m(options_, travel_sigma_m), recorded_.travel_offset_std_m);
  if (!recorded_.rest) record(air.last, {}, 0, false);
}

PushRun::Settled PushRun::settle(bool unloading) {
  std::vector<sensing::ContactSample> samples;
  const double start = robot_.read().time_s;
  sensing::Settling state;
  Settled out;
  std::vector<std::optional<Vec3>> torques;
  do {
    ask_user();
    robot_.wait(options_.sample_period_s);
    out.last = robot_.read();
    samples.push_back(sample(out.last));
    torques.push_back(out.last.torque_nm);
    state = sensing::settling(samples, plan_.direction, options_.settling);
  } while (!state.settled && out.last.time_s - start < options_.settling_timeout_s);
  out.settled = state.settled;
  // The recorded force is the mean over the last window, as `settling` sees it.
  Vec3 square = Vec3::Zero();
  double count = 0;
  for (auto s = samples.rbegin(); s != samples.rend() && s->time_s >= out.last.time_s - options_.settling.window_s; ++s) {
    out.mean_n += s->force_n;
    square += s->force_n.cwiseAbs2();
    ++count;
  }
  out.mean_n /= count;
  out.torque = torque_mean({torques.end() - std::ptrdiff_t(count), torques.end()});
  const Vec3 variance = (square / count - out.mean_n.cwiseAbs2()).cwiseMax(0.0);
  out.sigma_n = std::sqrt(std::max(variance.mean(), free_air_std_n_ * free_air_std_n_ * 0.01) / count);
  history_.insert(history_.end(), samples.begin(), samples.end());
  if (!unloading) watch_out();
  begin_where_the_force_began();
  report_.deepest_m = std::max(report_.deepest_m, travel(out.last));  // as it is recorded: a touch of one step tells a stiffness
  return out;
}

void PushRun::settle_and_record(bool unloading) {
  if (recorded_at_m_ == at_m_) return;  // nothing moved since: it would be the same step once more
  recorded_at_m_ = at_m_;
  const Settled step = settle(unloading);
  if (!step.settled) report_.unsettled.push_back(next_index_);
  loaded_ = true;
  report_.turned_rad = std::max(report_.turned_rad, Eigen::AngleAxisd(R_base_tip_tared_.transpose() * step.last.T_base_tip.linear()).angle());
  record(step.last, step.mean_n, std::hypot(step.sigma_n, second_tare_std_n()), unloading, torque_of(step));
}

std::optional<Wrench> PushRun::torque_of(const Settled& step) const {
  if (!step.torque || !torque_tare_ || !(options_.contact_std_m > 0)) return std::nullopt;
  Wrench wrench;
  wrench.time_s = step.last.time_s;
  wrench.force_n = step.mean_n;
  constexpr double exact_n = 1e-6;  // of a sensor made of software
  wrench.force_sigma_n = std::max(step.sigma_n, exact_n);
  wrench.has_torque = true;
  wrench.torque_nm = step.torque->mean_nm - torque_tare_->mean_nm;
  const double noise_nm = std::max(step.torque->mean_std_nm(), 0.1 * torque_tare_->mean_std_nm());
  wrench.torque_sigma_nm = std::hypot(noise_nm, robot_.travel_sigma_m() * step.mean_n.norm());
  wrench.tool = plan_.tool;
  return wrench.torque_sigma_nm > 0 ? std::optional(wrench) : std::nullopt;
}

void PushRun::begin_where_the_force_began() {
  if (!begins_late_) return;
  begins_late_ = false;
  approach_.insert(approach_.end(), history_.begin(), history_.end());
  const ForceBeginSearch search{options_.search_distance_m, options_.increment_m, lengths_.finest_m()};
  const Vec3 began_m = noticed_m_ - force_began_before_m(approach_, noticed_m_, plan_.direction, search) * plan_.direction;
  approach_.clear();
  if (!recorded_.contact_m) {
    report_.contact_m = began_m;
    return;
  }
  // Each of the two is known as well as the push states; what is beyond that has moved since.
  const double moved_m = along(began_m - *recorded_.contact_m);
  if (std::abs(moved_m) > 4 * std::numbers::sqrt2 * push_.travel_offset_std_m)
    throw Stopped{StopReason::moved, "contact begins " + std::to_string(1000 * std::abs(moved_m)) + " mm " +
                                         (moved_m > 0 ? "deeper" : "earlier") +
                                         " than in the part that is recorded: object or arm moved in between; push there anew"};
}

void PushRun::record(const RobotState& state, const std::optional<Vec3>& force_n, double sigma_n, bool unloading,
                     const std::optional<Wrench>& torque) {
  Step step;
  step.time_s = state.time_s;
  step.joints_rad = state.joints_rad;
  step.T_base_tip = state.T_base_tip;
  step.unloading = unloading;
  if (force_n) {
    Load load;
    load.tool = plan_.tool;
    load.force_n = *force_n;
    load.force_std_n = sigma_n;
    load.contact_m = report_.contact_m;
    load.direction = plan_.direction;
    load.contact_std_m = options_.contact_std_m;
    step.loads.push_back(load);
    ToolTravel encoder;
    encoder.tool = plan_.tool;
    encoder.travel_m = travel(state);
    encoder.sigma_m = robot_.travel_sigma_m();
    step.observations.emplace_back(encoder);
    if (torque) step.observations.emplace_back(*torque);
  }
  DepthFrame image = robot_.take_depth_image();
  if (sensing::is_blank(image)) {  // a hiccup, or the arm before the lens: what is felt counts all the same
    ++report_.blank_images;
  } else {
    if (!force_n && !unloading) before_ = image;
    if (!force_n && unloading && before_) look_whether_it_came_back(image);
    step.observations.emplace_back(std::move(image));
  }
  if (on_step_) on_step_(push_, step);
  ++next_index_;
  ++report_.steps;
}

void PushRun::look_whether_it_came_back(const DepthFrame& after) {
  const DepthFrame& before = *before_;
  if (before.depth_m.rows() != after.depth_m.rows() || before.depth_m.cols() != after.depth_m.cols()) return;
  if (!before.T_base_camera.isApprox(after.T_base_camera, 1e-6)) return;
  report_.compared = true;
  report_.changed_share = sensing::changed_share(before, after);
  report_.came_back = report_.changed_share <= options_.changed_share;
}

}  // namespace palpate::acquisition
