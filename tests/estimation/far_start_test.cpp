// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Where the fit of depth rays ends must not depend on where it began: a Neo-Hookean block whose truth is a finer mesh, from starts
// a factor of a hundred off in E, both ways.
#include <gtest/gtest.h>

#include <cmath>

#include "planned_scene.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::far_start_test {
namespace {

/// Rays of a camera above and beside the clamped block, as it sees the truth under every load.
Inputs rays_of(const PushedBlock& truth, const Recording& recording) {
  Unknowns unknowns;
  ForwardModel model(recording, simulated(fem::to_quadratic(kuhn_block(8, 6, 4, block_size_m)), truth.material), unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(truth.young_pa);
  at(poisson) = truth.poisson;
  std::mt19937 random(truth.seed);
  std::normal_distribution<double> normal;
  Inputs inputs;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const TriMesh seen{model.predict(s, at, false).surface_m, model.object().surface.rest().triangles};
    RayObservation image = look(seen, Vec3(0.3, -0.25, 0.35), 45, truth.sigma_m);
    image.pose_std_m = image.pose_std_rad = 0;
    for (Index i = 0; i < image.rays.range_m.size(); ++i) image.rays.range_m(i) += truth.sigma_m * normal(random);
    inputs.push_back({image});
  }
  return inputs;
}

TEST(FarStart, OfDepthRaysAndTheNeoHookeanLawEndsAtTheSameOptimum) {
  Recording recording = pushed_block_recording();
  for (Step& step : recording.pushes[0].steps) *step.loads[0].force_n *= 2.5;  // bent by 6 mm: far from small strains
  PushedBlock truth;
  truth.sigma_m = 3e-4;
  const Inputs inputs = rays_of(truth, recording);
  ASSERT_GT(std::get<RayObservation>(inputs[1][0]).rays.range_m.size(), 300);
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const auto fitted = [&](double factor) {
    options.young_start_pa = factor * truth.young_pa;
    options.poisson_start = factor < 1 ? 0.1 : 0.45;
    return fit(recording, coarse_block(), inputs, options);
  };
  const Identification near = fitted(1);
  ASSERT_EQ(near.termination, Termination::converged) << near.message;
  EXPECT_NEAR(near.parameters[0].value, truth.young_pa, 0.03 * truth.young_pa);  // the fit's mesh is half as fine
  for (const double factor : {0.01, 100.0}) {
    const Identification far = fitted(factor);
    EXPECT_EQ(far.termination, Termination::converged) << factor << " " << far.message;
    for (std::size_t k = 0; k < 2; ++k)
      EXPECT_NEAR(far.parameters[k].value, near.parameters[k].value, 0.05 * near.parameters[k].std) << factor << " " << far.parameters[k].name;
    ASSERT_FALSE(far.trace.empty());
    EXPECT_GT(std::abs(std::log(far.trace.front().young_modulus_pa / truth.young_pa)), std::log(10)) << "it did not begin far away";
  }
}

}  // namespace
}  // namespace palpate::estimation::far_start_test
