// SPDX-License-Identifier: Apache-2.0
// Masking a 49 k-triangle arm in a 640 x 480 image: posing, z-buffer and comparison with the measurement.
#include <benchmark/benchmark.h>

#include "palpate/lab/arm.hpp"
#include "palpate/lab/scene.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace {

using namespace palpate;

void mask_arm(benchmark::State& state) {
  lab::ArmOptions options;
  options.round_sides = 76;
  options.rings = 41;
  const sensing::RobotMask mask(lab::arm(options));
  DepthFrame frame;
  frame.camera = {640, 480, 525, 525, 319.5, 239.5, DistortionModel::none, {}};
  frame.T_base_camera = lab::look_at(Vec3(0.3, -1.0, 0.7), Vec3(0.25, 0, 0.45));
  frame.noise.model = "realsense_d435";
  frame.depth_m = DepthImage::Constant(480, 640, 1.2F);
  const auto& names = mask.kinematics().free_joints();
  const std::vector<double> joints{0, 0.6, 1.2, 0, 1.3, 0, 0.05};
  int masked = 0;
  for (auto _ : state) {
    const MaskImage image = mask.mask(frame, names, joints);
    benchmark::DoNotOptimize(masked = image.cast<int>().sum());
  }
  state.counters["triangles"] = mask.triangle_count();
  state.counters["masked_px"] = masked;
}
BENCHMARK(mask_arm)->Unit(benchmark::kMillisecond);

}  // namespace
