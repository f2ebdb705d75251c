// label: unit
// SPDX-License-Identifier: Apache-2.0
// Two depth cameras that watch one push: each errs by itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "planned_scene.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::two_cameras_test {
namespace {

constexpr double far_m = 8e-4, near_m = -6e-4;  // by how much they measure too much

/// The glued block under three loads, seen by a camera from either side, without noise.
Inputs seen_by_two(const Recording& recording, const SimulatedObject& object, double young_pa) {
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(young_pa);
  at(poisson) = 0.3;
  Inputs inputs;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const TriMesh surface{model.predict(s, at, false).surface_m, model.object().surface.rest().triangles};
    auto& both = inputs.emplace_back();
    for (const auto& [name, eye_m, bias_m] :
         {std::tuple("0", Vec3(-0.25, 0.02, 0.3), far_m), std::tuple("1", Vec3(0.35, 0.05, 0.3), near_m)}) {
      RayObservation image = look(surface, eye_m, 40, 5e-4);
      image.pose_std_m = image.pose_std_rad = 0;
      image.bias_std_m = 1e-3;
      image.camera = name;
      image.rays.range_m.array() += bias_m;
      both.push_back(image);
    }
  }
  return inputs;
}

TEST(DepthBias, IsEachCamerasOwn) {
  constexpr double young_pa = 2e4;
  const Recording recording = glued_block_recording({Vec3(0, 0, -1.5), Vec3(0, 0, -3), Vec3(0, 0, -4.5)}, 0.03, 0.02);
  const SimulatedObject object = coarse_block("linear");
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const Identification answer = fit(recording, object, seen_by_two(recording, object, young_pa), options);
  const auto found = [&](const std::string& name) {
    const auto at = std::find_if(answer.nuisances.begin(), answer.nuisances.end(), [&](const Nuisance& one) { return one.name == name; });
    EXPECT_NE(at, answer.nuisances.end()) << name;
    return at == answer.nuisances.end() ? 0.0 : at->value;
  };
  // Truth and fit are one mesh here: what is looked at is whose error is whose.
  EXPECT_NEAR(found("depth_bias[down]"), far_m, 0.1e-3);
  EXPECT_NEAR(found("depth_bias[down, camera 1]"), near_m, 0.1e-3);
  EXPECT_NEAR(parameter(answer, "young_modulus").value / young_pa, 1, 0.02);
  EXPECT_LT(answer.fit.chi2_per_dof, 0.1);
}

}  // namespace
}  // namespace palpate::estimation::two_cameras_test
