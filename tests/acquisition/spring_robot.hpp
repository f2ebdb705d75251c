// SPDX-License-Identifier: Apache-2.0
// A robot that presses a spring, for tests of the push protocol.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition {

// A linear spring whose surface lies at height 0.1 m; pressed from above. The force relaxes after every motion.
struct SpringRobot : Robot {
  double stiffness_n_m = 400, surface_m = 0.1, noise_n = 0.02;
  double relaxation = 0.1, relaxation_s = 0.3;  // share of the last increase that fades
  Vec3 bias_n{0.4, -0.2, 0.9}, drift_n_s = Vec3::Zero();
  double stiffens_at_m = 1e9;  // ten times
  double slips_at_m = 1e9, loses_at_m = 1e9, yields_at_m = 1e9, refuses_at_m = 1e9;
  double clock_s = 0, moved_s = -100, faded_n = 0;
  Pose tip = Pose(Eigen::Translation3d(0, 0, 0.3));
  bool stopped = false;
  int errs_after_touch = 0;  // motions that end 2 mm short, from the first after the first touch on
  double repeat_std_m = 0;   // every motion ends this far from where the encoders say
  double unseen_m = 0;       // the last one's error, deeper
  int images = 0;
  int blank_images = 0;  // to come, without a depth
  double highest_n = 0;  // of the spring, as nobody reads it
  bool camera_moves = false;
  double rolls_rad_m = 0;  // around its axis, with the way it goes down
  double breaks_beyond_m = 1e9;  // cannot be read any more
  std::mt19937 generator{7};

  double depth() const { return surface_m - tip.translation().z() + unseen_m; }
  double spring() const {
    if (depth() <= 0 || depth() > loses_at_m) return 0;
    const double stiff_m = std::max(0.0, depth() - stiffens_at_m);
    return stiffness_n_m * (depth() + 9 * stiff_m) * (depth() > yields_at_m ? 0.5 : 1.0);
  }
  RobotState read() override {
    if (depth() > breaks_beyond_m) throw Error("no answer", "robot");
    std::normal_distribution<double> noise(0, noise_n);
    RobotState state;
    state.time_s = clock_s;
    state.joints_rad = {tip.translation().z(), 0.5};
    state.T_base_tip = tip;
    state.T_base_tip.rotate(Eigen::AngleAxisd(rolls_rad_m * depth(), Vec3::UnitZ()));
    if (depth() > slips_at_m) state.T_base_tip.translation().x() += 0.004;
    const double fading = depth() > 0 ? faded_n * std::exp(-(clock_s - moved_s) / relaxation_s) : 0;
    state.force_n =
        bias_n + clock_s * drift_n_s + Vec3(noise(generator), noise(generator), noise(generator) - (spring() > 0 ? spring() + fading : 0));
    return state;
  }
  Motion move(const Pose& pose, double speed_m_s) override {
    if (surface_m - pose.translation().z() > refuses_at_m) return Motion::refused;
    const double before = spring();
    const bool errs = before > 0 && errs_after_touch > 0;
    clock_s += (pose.translation() - tip.translation()).norm() / speed_m_s;
    tip = pose;
    if (repeat_std_m > 0) unseen_m = std::normal_distribution<double>(0, repeat_std_m)(generator);
    if (errs) {
      tip.translation().z() += 0.002;
      --errs_after_touch;
    }
    highest_n = std::max(highest_n, spring());
    moved_s = clock_s;
    faded_n = relaxation * std::max(0.0, spring() - before);
    return Motion::done;
  }
  void stop() override { stopped = true; }
  DepthFrame take_depth_image() override {
    ++images;
    DepthFrame frame;
    frame.time_s = clock_s;
    frame.camera = {2, 2, 2, 2, 0.5, 0.5, DistortionModel::none, {}};
    frame.noise.sigma_m = 1e-3;
    frame.depth_m = DepthImage::Constant(2, 2, blank_images > 0 ? 0.0f : 1.0f);
    blank_images = std::max(0, blank_images - 1);
    if (camera_moves) frame.T_base_camera.translation().x() = 1e-3 * images;
    return frame;
  }
  void wait(double duration_s) override { clock_s += duration_s; }
  double travel_sigma_m() const override { return sigma_m; }
  double sigma_m = 3e-4;
};

inline PushPlan plan() {
  PushPlan p;
  p.name = "push 1";
  p.tool = "stick";
  p.contact_m = Vec3(0, 0, 0.102);  // expected 2 mm too high
  return p;
}

inline PushOptions options() {
  PushOptions o;
  o.force_limit_n = 8;
  o.travel_limit_m = 0.03;
  return o;
}

struct Result {
  PushReport report;
  Push push;
};

inline Result run(SpringRobot& robot, const PushOptions& o = options(), const std::function<bool()>& keep_going = {},
           const Push* so_far = nullptr) {
  Result result;
  result.report = run_push(
      robot, plan(), o,
      [&](const Push& push, const Step& step) {
        std::vector<Step> steps = std::move(result.push.steps);
        result.push = push;
        result.push.steps = std::move(steps);
        result.push.steps.push_back(step);
      },
      keep_going, so_far);
  return result;
}

/// Pressing, of a recorded step.
inline double force(const Step& step) { return step.loads.empty() ? 0 : -step.loads[0].force_n->z(); }

}  // namespace palpate::acquisition
