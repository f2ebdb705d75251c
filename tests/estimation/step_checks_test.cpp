// label: unit
// SPDX-License-Identifier: Apache-2.0
// What single steps say against the joint fit: each verdict where it is due, and none of them where nothing is wrong.
#include "palpate/estimation/step_checks.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pushed_block.hpp"

namespace palpate::estimation::step_checks_test {
namespace {

constexpr std::size_t steps = 6;

/// Six loads on the clamped block; contact and frames are not exactly known.
Recording six_loads(bool same_force = false) {
  Recording recording = pushed_block_recording();
  auto& all = recording.pushes[0].steps;
  const Step last = all.back();
  all.clear();
  for (std::size_t k = 0; k < steps; ++k) {
    all.push_back(last);
    all.back().time_s = double(k);
    all.back().loads[0].force_n = Vec3(0, 0, same_force ? -0.12 : -0.02 * double(k + 1));
    all.back().loads[0].contact_std_m = 2e-3;
  }
  return recording;
}

Identification fitted(const Recording& recording, Inputs inputs) {
  for (auto& step : inputs) {
    std::get<PointCloud>(step[0]).pose_std_m = 5e-4;
    std::get<PointCloud>(step[0]).pose_std_rad = 2e-3;
  }
  FitOptions options;
  options.cross_checks = options.stresses = false;
  return fit(recording, coarse_block("linear"), inputs, options);
}

PushedBlock linear_block() {
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 1200;
  truth.sigma_m = 2e-4;
  return truth;
}

/// From step `from` on as in the other recording.
Inputs changed(const Inputs& before, const Inputs& after, std::size_t from) {
  Inputs out = before;
  for (std::size_t s = from; s < out.size(); ++s) out[s] = after[s];
  return out;
}

const std::vector<std::string> codes{"object_moved", "contact_slipped", "not_settled", "residual_pattern", "pressure_beyond_model"};

void expect_only(const Identification& answer, const std::string& due) {
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  for (const auto& code : codes) {
    std::string message;
    for (const auto& verdict : answer.verdicts) {
      if (verdict.code == code) message = verdict.message;
    }
    EXPECT_EQ(!message.empty(), code == due) << code << ": " << message;
  }
}

TEST(StepChecks, NothingIsSaidOfARecordingWithoutFault) {
  for (unsigned seed : {1u, 2u, 3u, 4u}) {
    PushedBlock truth = linear_block();
    truth.seed = seed;
    expect_only(fitted(six_loads(), clouds_of(truth, six_loads())), "");
    expect_only(fitted(six_loads(true), clouds_of(truth, six_loads(true))), "");
  }
}

TEST(StepChecks, AContactThatSlips) {
  Recording slipped = six_loads();
  for (Step& step : slipped.pushes[0].steps) step.loads[0].contact_m += Vec3(-0.006, 0, 0);
  const PushedBlock truth = linear_block();
  const Identification answer = fitted(six_loads(), changed(clouds_of(truth, six_loads()), clouds_of(truth, slipped), 3));
  EXPECT_TRUE(says(answer, "contact_slipped"));  // a misfit may be said too: the shift of all steps together is none of them
  EXPECT_FALSE(says(answer, "object_moved") || says(answer, "not_settled"));
  for (const auto& verdict : answer.verdicts) {
    if (verdict.code == "contact_slipped") {
      EXPECT_NE(verdict.message.find("step 3"), std::string::npos) << verdict.message;
    }
  }
}

// What the steps say is asked without the contact's prior, which is part of their sum only where the contact is fitted.
TEST(StepChecks, AContactThatIsHeldIsAskedTheSame) {
  const Recording recording = six_loads();
  Recording slipped = recording;
  for (Step& step : slipped.pushes[0].steps) step.loads[0].contact_m += Vec3(-0.006, 0, 0);
  const PushedBlock truth = linear_block();
  const Inputs inputs = changed(clouds_of(truth, recording), clouds_of(truth, slipped), 3);
  Unknowns unknowns;
  ForwardModel model(recording, coarse_block("linear"), unknowns);
  Objective objective(model, inputs, unknowns);
  const auto asked = [&](bool held) {
    for (const int k : unknowns.named({"contact_shift[down]_1", "contact_shift[down]_2"})) unknowns[k].fixed = held;
    Optimum at;
    at.unknowns = unknowns.prior_mean();
    at.unknowns(log_young) = std::log(truth.young_pa);
    at.unknowns(poisson) = truth.poisson;
    at.evaluation = objective.evaluate(at.unknowns, at.loss);
    return contact_slip(objective, at, 1);
  };
  const auto fitted = asked(false), held = asked(true);
  ASSERT_TRUE(fitted && held);
  EXPECT_EQ(held->step, fitted->step);
  EXPECT_NEAR(held->size, fitted->size, 1e-9 * fitted->size);
  EXPECT_NEAR(std::log(held->p_value), std::log(fitted->p_value), 1e-6);
}

// Of many pushes without a fault one looks worst: a chance is that of the recording, not of the push.
TEST(StepChecks, ChancesAreOverAllPushes) {
  const PushedBlock truth = linear_block();
  PushedBlock softer = truth;
  softer.young_pa *= 0.9;
  Recording slipped = six_loads();
  for (Step& step : slipped.pushes[0].steps) step.loads[0].contact_m += Vec3(-0.002, 0, 0);
  const Inputs slips = changed(clouds_of(truth, six_loads()), clouds_of(truth, slipped), 3);
  const Inputs settles = changed(clouds_of(truth, six_loads(true)), clouds_of(softer, six_loads(true)), 3);
  struct Found {
    std::optional<StepChange> slip, motion, settled;
  };
  const auto found = [&](int pushes, bool same_force) {
    Recording recording = six_loads(same_force);
    const Push like = recording.pushes[0];
    recording.pushes.clear();
    Inputs inputs;
    for (int p = 0; p < pushes; ++p) {
      recording.pushes.push_back(like);
      recording.pushes.back().name = "push " + std::to_string(p);
      for (const auto& step : same_force ? settles : slips) inputs.push_back(step);
    }
    for (auto& step : inputs) std::get<PointCloud>(step[0]).pose_std_m = 5e-4;
    Unknowns unknowns;
    ForwardModel model(recording, coarse_block("linear"), unknowns);
    Objective objective(model, inputs, unknowns);
    Optimum at;
    at.unknowns = unknowns.prior_mean();
    at.unknowns(log_young) = std::log(truth.young_pa);
    at.unknowns(poisson) = truth.poisson;
    for (int p = 0; p < pushes; ++p)  // where the fit ended
      for (std::size_t s = 3; s < steps; ++s)
        at.unknowns(unknowns.named({"frame_x[push " + std::to_string(p) + ":" + std::to_string(s) + "]"}).at(0)) = 2e-3;
    at.evaluation = objective.evaluate(at.unknowns, at.loss);
    return Found{contact_slip(objective, at, 1), object_motion(objective, at), settling(objective, at, 1)};
  };
  constexpr int many = 5;
  const Found one = found(1, false), all = found(many, false);
  ASSERT_TRUE(one.slip && all.slip && one.motion && all.motion);
  EXPECT_NEAR(all.slip->p_value / one.slip->p_value, many, 1e-6);
  EXPECT_NEAR(all.motion->p_value / one.motion->p_value, many, 1e-6);
  const Found held = found(1, true), held_often = found(many, true);
  ASSERT_TRUE(held.settled && held_often.settled);
  ASSERT_LT(held.settled->p_value, 0.1);
  EXPECT_NEAR(held_often.settled->p_value / held.settled->p_value, many, 1e-6);
}

TEST(StepChecks, AnObjectThatWasMoved) {
  PushedBlock truth = linear_block(), moved = truth;
  moved.clamp.translation_m = Vec3(0.002, 0.0015, 0.001);
  const Identification answer = fitted(six_loads(), changed(clouds_of(truth, six_loads()), clouds_of(moved, six_loads()), 4));
  expect_only(answer, "object_moved");
  for (const auto& verdict : answer.verdicts) {
    if (verdict.code == "object_moved") {
      EXPECT_NE(verdict.message.find("step 4"), std::string::npos) << verdict.message;
    }
  }
}

TEST(StepChecks, AnObjectThatGoesOnGivingWay) {
  const Recording held = six_loads(true);
  Inputs inputs;
  for (std::size_t s = 0; s < steps; ++s) {
    PushedBlock truth = linear_block();
    truth.young_pa *= std::exp(-0.03 * double(s));
    inputs.push_back(clouds_of(truth, held)[s]);
  }
  expect_only(fitted(held, inputs), "not_settled");
}

TEST(StepChecks, ErrorsThatNeighboursShare) {
  PushedBlock truth = linear_block();
  truth.points = 2500;
  Inputs inputs = clouds_of(truth, six_loads());
  for (auto& step : inputs) {
    Points& points = std::get<PointCloud>(step[0]).points_m;
    for (Index i = 0; i < points.rows(); ++i) points(i, 2) += 5e-4 * std::sin(2 * EIGEN_PI * points(i, 0) / 0.03);
  }
  expect_only(fitted(six_loads(), inputs), "residual_pattern");
}

TEST(StepChecks, APressureBeyondThePatch) {
  Recording sharp = six_loads();
  sharp.tools[0].radius_m = 0.0025;
  PushedBlock truth = linear_block();
  truth.young_pa = 1e4;
  const Identification answer = fitted(sharp, clouds_of(truth, sharp));
  EXPECT_TRUE(says(answer, "pressure_beyond_model"));
}

}  // namespace
}  // namespace palpate::estimation::step_checks_test
