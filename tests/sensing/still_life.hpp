// SPDX-License-Identifier: Apache-2.0
// Sensors that look at something that stands still, with noise that is known and stated rightly or wrongly.
#pragma once

#include <cmath>
#include <random>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

struct StillLife {
  double depth_m = 2e-3, force_n = 0.05;
  double stated_depth_m = 2e-3, stated_force_n = 0.05;
  int frames = 4;
  double step_m = 0;         ///< that depths are rounded to
  double intruder = 0;       ///< share of the picture that something has come into in the last frame
  bool along_z_only = false; ///< a single-axis cell
};

/// A slanted wall, seen by a camera that stands still; two pushes with unloaded steps, and a loaded one that must not count.
inline Recording still_life(const StillLife& truth) {
  constexpr int width = 80, height = 60;
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  Recording recording;
  for (int p = 0; p < 2; ++p) {
    Push& push = recording.pushes.emplace_back();
    const Vec3 zero(normal(random), normal(random), normal(random));  // the tare of this push: far more than the noise
    for (int s = 0; s <= truth.frames; ++s) {
      const bool loaded = s == truth.frames;
      Step& step = push.steps.emplace_back();
      step.time_s = s;
      if (loaded) {
        Load load;
        load.force_n = Vec3(0, 0, -5);
        step.loads = {load};
      }
      DepthFrame frame;
      frame.camera = {width, height, 90, 90, 39.5, 29.5, DistortionModel::none, {}};
      frame.noise.sigma_m = truth.stated_depth_m;
      frame.depth_m.resize(height, width);
      for (int r = 0; r < height; ++r)
        for (int c = 0; c < width; ++c) {
          double depth_m = 0.6 + 0.001 * c + (loaded ? 0.1 : 0) + truth.depth_m * normal(random);
          if (p == 1 && s == truth.frames - 1 && r < truth.intruder * height) depth_m -= 0.02;
          if (truth.step_m > 0) depth_m = truth.step_m * std::round(depth_m / truth.step_m);
          frame.depth_m(r, c) = static_cast<float>(depth_m);
        }
      Wrench wrench;
      wrench.force_n = zero + truth.force_n * Vec3(normal(random), normal(random), normal(random)) + Vec3(0, 0, loaded ? -5 : 0);
      wrench.force_sigma_n = truth.stated_force_n;
      if (truth.along_z_only) {
        wrench.along = Vec3::UnitZ();
        wrench.force_n = wrench.force_n.z() * Vec3::UnitZ();
      }
      step.observations = {frame, wrench};
    }
  }
  return recording;
}

}  // namespace palpate::sensing
