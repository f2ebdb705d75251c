// label: unit
// SPDX-License-Identifier: Apache-2.0
// When a search has arrived.
#include "palpate/estimation/optimise.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <memory>
#include <optional>

#include "palpate/geometry/triangle_tree.hpp"

#include "pushed_block.hpp"

namespace palpate::estimation::optimise_test {
namespace {

struct Searched {
  Recording recording = pushed_block_recording();
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;
  Optimum optimum;
  /// @param also  seen in the last step beside the surface's points
  explicit Searched(const std::optional<RayObservation>& also = std::nullopt) {
    PushedBlock truth;
    truth.material = "linear";
    truth.sigma_m = 2e-4;
    model = std::make_unique<ForwardModel>(recording, coarse_block("linear"), unknowns);
    Inputs inputs = clouds_of(truth);
    if (also) inputs.back().push_back(*also);
    objective = std::make_unique<Objective>(*model, inputs, unknowns);
    VectorX start = unknowns.prior_mean();
    start(log_young) = std::log(truth.young_pa);
    start(poisson) = truth.poisson;
    optimum = optimise(*objective, start, {}, {}, {});
  }
  /// One step from a place that is so many standard deviations of E away.
  Optimum one_step_from(double stds) {
    const MatrixX covariance = MatrixX(optimum.evaluation.curvature).inverse();
    VectorX start = optimum.unknowns;
    start(log_young) += stds * std::sqrt(covariance(log_young, log_young));
    OptimiseOptions one;
    one.max_iterations = 1;
    return optimise(*objective, start, {}, one, {});
  }
};

// A search whose steps are larger than its tolerance to the last may be where nothing is to be gained any more: in a valley that hardly
// falls it would go on for hundreds of steps.
TEST(Optimise, ALastStepThatLeavesNothingToGainIsAnEnd) {
  Searched block;
  ASSERT_EQ(block.optimum.termination, Termination::converged) << block.optimum.message;
  const Optimum near = block.one_step_from(0.3);
  EXPECT_EQ(near.termination, Termination::converged) << near.message;
  EXPECT_LT(near.evaluation.cost - block.optimum.evaluation.cost, 0.02);
}

TEST(Optimise, OneThatStillFallsIsNot) {
  Searched block;
  VectorX far = block.optimum.unknowns;
  far(log_young) += std::log(30.0);
  OptimiseOptions one;
  one.max_iterations = 1;
  const Optimum at = optimise(*block.objective, far, {}, one, {});
  EXPECT_EQ(at.termination, Termination::max_iterations);
  EXPECT_EQ(at.message, "stopped after 1 iterations");
}

// A ray at the upper rim of the block's free end, which it meets where the block is two standard deviations (of E alone) stiffer than it
// is, and passes by where it is softer.
RayObservation ray_at_rim(Searched& block, VectorX& start) {
  const double std_dev = 1 / std::sqrt(block.optimum.evaluation.curvature(log_young, log_young));
  VectorX rim = block.optimum.unknowns;
  rim(log_young) += 2 * std_dev;
  start = rim;
  start(log_young) += 1e-6 * std_dev;
  const std::size_t last = block.model->step_count() - 1;
  const TriMesh surface{block.model->predict(last, rim).surface_m, block.model->object().surface.rest().triangles};
  const geometry::TriangleTree tree(surface);
  const auto from = [](double z) { return Vec3(0.9 * block_size_m.x(), -0.1, z); };
  double meets = 0.1 * block_size_m.z(), passes = 1.5 * block_size_m.z();
  for (int k = 0; k < 60; ++k) {
    const double z = 0.5 * (meets + passes);
    (tree.cast(from(z), Vec3::UnitY()) ? meets : passes) = z;
  }
  RayObservation seen;
  seen.rays.origins_m = from(meets).transpose();
  seen.rays.directions = Vec3::UnitY().transpose();
  seen.rays.range_m = VectorX::Constant(1, tree.cast(from(meets), Vec3::UnitY())->range_m);
  seen.rays.sigma_m = VectorX::Constant(1, 2e-4);
  return seen;
}

// Where a ray comes to pass the object by the cost jumps by more than there is to gain beyond, and no step is short enough to show it.
TEST(Optimise, AJumpOfTheCostDoesNotHoldTheSearch) {
  Searched plain;
  ASSERT_EQ(plain.optimum.termination, Termination::converged) << plain.optimum.message;
  VectorX start;
  const RayObservation at_rim = ray_at_rim(plain, start);
  Searched block(at_rim);
  const double at_jump = block.objective->evaluate(start, {}).cost, beyond = block.objective->evaluate(plain.optimum.unknowns, {}).cost;
  ASSERT_GT(beyond, at_jump + 0.5) << "uphill: the ray costs more than the way beyond it gains";
  const Optimum found = optimise(*block.objective, start, {}, {}, {});
  EXPECT_EQ(found.termination, Termination::converged) << found.message;
  EXPECT_NEAR(found.unknowns(log_young), plain.optimum.unknowns(log_young), 0.1 * (start(log_young) - plain.optimum.unknowns(log_young)));
}

}  // namespace
}  // namespace palpate::estimation::optimise_test
