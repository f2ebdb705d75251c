// label: unit
// SPDX-License-Identifier: Apache-2.0
// Clouds of a camera whose calibration is off: all of them err alike, and more of them tell no more of where the object is.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/identify.hpp"
#include "palpate/lab/random.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::cloud_camera_test {
namespace {

constexpr double pose_m = 1e-3, pose_rad = 0.02;
constexpr int steps = 8;

/// One load, looked at again and again.
Recording recording_of_steps() {
  Recording recording = pushed_block_recording();
  Push& push = recording.pushes[0];
  const Step like = push.steps.back();
  push.steps.clear();
  for (int k = 0; k < steps; ++k) {
    push.steps.push_back(like);
    push.steps.back().loads[0].force_n = Vec3(0, 0, -0.12);
  }
  return recording;
}

/// Root mean square of what E is off by, in stated standard deviations, where each recording's clouds are all off by one motion.
double rms_pull(const std::string& camera) {
  constexpr int seeds = 30;
  const Recording recording = recording_of_steps();
  const SimulatedObject object = coarse_block("linear");
  FitMemory memory;
  double squares = 0;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    PushedBlock block;
    block.material = "linear";
    block.seed = seed;
    Inputs inputs = clouds_of(block, recording);
    lab::Random random(seed, 1);
    RigidOffset off;
    off.translation_m = pose_m * random.normal3();
    off.rotation_rad = pose_rad * random.normal3();
    off.pivot_m = 0.5 * block_size_m;
    for (auto& step : inputs) {
      auto& cloud = std::get<PointCloud>(step[0]);
      for (Index i = 0; i < cloud.points_m.rows(); ++i) cloud.points_m.row(i) = off.apply_inverse(cloud.points_m.row(i)).transpose();
      cloud.pose_std_m = pose_m;
      cloud.pose_std_rad = pose_rad;
      cloud.camera = camera;
    }
    FitOptions options;
    options.cross_checks = options.stresses = false;
    const Identification answer = fit(recording, object, inputs, options, {}, nullptr, &memory);
    const Parameter& young = parameter(answer, "young_modulus");
    squares += std::pow(std::log(young.value / block.young_pa) * young.value / young.std, 2);
  }
  return std::sqrt(squares / seeds);
}

TEST(CloudCamera, WhatAllCloudsAreOffByIsOneError) {
  EXPECT_NEAR(rms_pull("clouds 0"), 1, 0.35);
  EXPECT_GT(rms_pull(""), 1.6) << "taken for as many errors as there are clouds, it is hidden in no interval";
}

TEST(CloudCamera, ObservedCloudsAreOneCamerasWhereThereAreSeveral) {
  const SimulatedObject object = coarse_block("linear");
  for (const int count : {1, steps}) {
    Recording recording = recording_of_steps();
    const Inputs seen = clouds_of({}, recording);
    recording.pushes[0].steps.resize(static_cast<std::size_t>(count));
    for (int k = 0; k < count; ++k) {
      auto& observations = recording.pushes[0].steps[static_cast<std::size_t>(k)].observations;
      observations.assign(2, std::get<PointCloud>(seen[static_cast<std::size_t>(k)][0]));
    }
    for (const auto& step : observe(recording)) {
      ASSERT_EQ(step.size(), 2u);
      EXPECT_EQ(std::get<PointCloud>(step[0]).camera, count > 1 ? "clouds 0" : "");
      EXPECT_EQ(std::get<PointCloud>(step[1]).camera, count > 1 ? "clouds 1" : "") << "a second camera's";
    }
    for (Step& step : recording.pushes[0].steps) std::get<PointCloud>(step.observations[1]).camera = "0";
    for (const auto& step : observe(recording)) EXPECT_EQ(std::get<PointCloud>(step[1]).camera, "clouds of 0") << "not that of images";
  }
}

}  // namespace
}  // namespace palpate::estimation::cloud_camera_test
