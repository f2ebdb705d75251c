// label: unit
// SPDX-License-Identifier: Apache-2.0
// Parts of a recording that disagree are found, and parts that agree are left alone; pushes that the fit has not seen are
// predicted better than by doing nothing.
#include "palpate/estimation/cross_check.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/estimation/homogeneity.hpp"

#include "pushed_block.hpp"

namespace palpate::estimation::cross_check_test {
namespace {

bool says(const Identification& answer, const std::string& code) {
  for (const auto& verdict : answer.verdicts) {
    if (verdict.code == code) return true;
  }
  return false;
}

/// The block pushed twice, as if the second push met a body of another E.
Identification fit_of_two(double first_young_pa, double second_young_pa) {
  Recording recording = pushed_block_recording();
  recording.pushes.push_back(recording.pushes[0]);
  recording.pushes[1].name = "again";
  PushedBlock one, two;
  one.young_pa = first_young_pa;
  two.young_pa = second_young_pa;
  two.seed = 8;
  Inputs inputs = clouds_of(one);
  for (auto& step : clouds_of(two)) inputs.push_back(step);
  return fit(recording, coarse_block(), inputs, {});
}

TEST(CrossCheck, PushesOnOneBodyAgreeAndPredictEachOther) {
  const Identification answer = fit_of_two(2e4, 2e4);
  EXPECT_FALSE(says(answer, "not_homogeneous"));
  EXPECT_FALSE(says(answer, "not_linear"));
  ASSERT_EQ(answer.per_push.size(), 2u);
  for (const auto& push : answer.per_push) EXPECT_NEAR(push.value, 2e4, 4 * push.std) << push.region;
  ASSERT_TRUE(answer.prediction.available);
  EXPECT_LT(answer.prediction.surface_rms_m, 1.15 * PushedBlock{}.sigma_m);  // noise is all that is left
  EXPECT_GT(answer.prediction.baseline_no_deformation_rms_m, 2 * answer.prediction.surface_rms_m);
  EXPECT_GT(answer.prediction.baseline_last_step_rms_m, 1.2 * answer.prediction.surface_rms_m);
  EXPECT_LT(answer.prediction.force_error, 0.1);
  EXPECT_GT(answer.prediction.deformation_explained, 0.98);
}

/// One push up and back, as robots record it: the unloaded object last.
Recording one_push_and_back(const std::vector<double>& newtons) {
  Recording recording = pushed_block_recording();
  Push& push = recording.pushes[0];
  const Step pressed = push.steps[0];
  push.steps.clear();
  for (const double newton : newtons) {
    push.steps.push_back(newton > 0 ? pressed : Step());
    if (newton > 0) push.steps.back().loads[0].force_n = Vec3(0, 0, -newton);
  }
  return recording;
}

TEST(CrossCheck, OnePushIsPredictedAtItsHighestLoad) {
  const Recording recording = one_push_and_back({0, 0.12, 0.24, 0.235, 0.12, 0});
  const Identification answer = fit(recording, coarse_block(), clouds_of({}, recording), {});
  const HeldOut& held_out = answer.prediction;
  ASSERT_TRUE(held_out.available);
  EXPECT_EQ(held_out.what, "the highest load");
  const double noise_m = PushedBlock{}.sigma_m;
  EXPECT_LT(held_out.surface_rms_m, 1.2 * noise_m);
  EXPECT_GT(held_out.baseline_no_deformation_rms_m, 3 * held_out.surface_rms_m);
  // The step before both of the highest ones bends half as far; its twin would be as good as the truth.
  EXPECT_GT(held_out.baseline_last_step_rms_m, 1.5 * held_out.surface_rms_m);
  EXPECT_LT(held_out.force_error, 0.1);
  EXPECT_GT(held_out.deformation_explained, 0.98);
}

TEST(CrossCheck, APredictionOfAnotherBodyIsSeenToBeWrong) {
  const Recording recording = one_push_and_back({0, 0.05, 0.1, 0});
  PushedBlock stiff;
  stiff.young_pa *= 1.5;
  Inputs inputs = clouds_of({}, recording);
  inputs[2] = clouds_of(stiff, recording)[2];  // the highest load meets a stiffer body
  const HeldOut held_out = fit(recording, coarse_block(), inputs, {}).prediction;
  ASSERT_TRUE(held_out.available);
  // Bent by d where 1.5 d is foretold: 1 - 0.5^2 of the squares are explained, and a third less force would do for that bend.
  EXPECT_NEAR(held_out.deformation_explained, 0.75, 0.1);
  EXPECT_NEAR(held_out.force_error, 1.0 / 3, 0.06);
}

// A clamp that stands 5 mm off is no deformation: an object that nothing bends is not seen where the recording has it, but there.
TEST(CrossCheck, AClampThatIsElsewhereExplainsNoDeformation) {
  Recording recording = one_push_and_back({0, 0.12, 0.24, 0});
  recording.supports[0].pose_std_m = 5e-3;
  PushedBlock as_stated, elsewhere;
  elsewhere.clamp.translation_m = Vec3(0, 3e-3, 4e-3);
  std::vector<HeldOut> found;
  for (const PushedBlock& truth : {as_stated, elsewhere}) {
    found.push_back(fit(recording, coarse_block(), clouds_of(truth, one_push_and_back({0, 0.12, 0.24, 0})), {}).prediction);
    ASSERT_TRUE(found.back().available);
  }
  EXPECT_NEAR(found[1].baseline_no_deformation_rms_m, found[0].baseline_no_deformation_rms_m, 0.1 * found[0].baseline_no_deformation_rms_m);
  EXPECT_NEAR(found[1].baseline_last_step_rms_m, found[0].baseline_last_step_rms_m, 0.1 * found[0].baseline_last_step_rms_m);
}

TEST(CrossCheck, WhereNothingLoadedCanBeLeftOutNothingIsSaid) {
  const Recording recording = one_push_and_back({0, 0, 0.1, 0});
  EXPECT_FALSE(fit(recording, coarse_block(), clouds_of({}, recording), {}).prediction.available);
}

TEST(CrossCheck, UnloadedStepsOfPushesThatAreLeftOutDoNotCount) {
  const Recording once = one_push_and_back({0.06, 0.12});
  const Recording rested = one_push_and_back({0, 0, 0, 0.06, 0.12, 0, 0, 0});
  const auto predicted = [](Recording recording) {
    recording.pushes.push_back(recording.pushes[0]);
    return fit(recording, coarse_block(), clouds_of({}, recording), {}).prediction;
  };
  const HeldOut loads = predicted(once), all = predicted(rested);
  ASSERT_TRUE(loads.available && all.available);
  EXPECT_NEAR(all.baseline_no_deformation_rms_m, loads.baseline_no_deformation_rms_m, 0.05 * loads.baseline_no_deformation_rms_m);
  EXPECT_NEAR(all.surface_rms_m, loads.surface_rms_m, 0.15 * loads.surface_rms_m);
}

TEST(CrossCheck, PushesOnBodiesOfDifferentStiffnessAreCalledSo) {
  const Identification answer = fit_of_two(2e4, 3e4);
  EXPECT_TRUE(says(answer, "not_homogeneous"));
  ASSERT_EQ(answer.per_push.size(), 2u);
  EXPECT_NEAR(answer.per_push[0].value, 2e4, 0.1 * 2e4);
  EXPECT_NEAR(answer.per_push[1].value, 3e4, 0.1 * 3e4);
  EXPECT_NEAR(answer.prediction.force_error, 0.45, 0.15);  // |2/3 - 1| and |3/2 - 1|
}

TEST(CrossCheck, SitesHoldAllTheirPushes) {
  Recording recording = pushed_block_recording();
  Inputs inputs;
  for (int p = 0; p < 3; ++p) {
    if (p > 0) recording.pushes.push_back(recording.pushes[0]);
    recording.pushes[static_cast<std::size_t>(p)].name = "push " + std::to_string(p + 1);
    recording.pushes[static_cast<std::size_t>(p)].site = p < 2 ? "soft side" : "stiff side";
    PushedBlock truth;
    truth.young_pa = p < 2 ? 2e4 : 3e4;
    truth.seed = 7 + static_cast<unsigned>(p);
    for (auto& step : clouds_of(truth)) inputs.push_back(step);
  }
  const Identification answer = fit(recording, coarse_block(), inputs, {});
  ASSERT_EQ(answer.per_push.size(), 3u);
  ASSERT_EQ(answer.per_site.size(), 2u);
  EXPECT_EQ(answer.per_site[0].region, "soft side");
  EXPECT_EQ(answer.per_site[1].region, "stiff side");
  EXPECT_NEAR(answer.per_site[0].value, 2e4, 0.1 * 2e4);
  EXPECT_NEAR(answer.per_site[1].value, 3e4, 0.1 * 3e4);
  EXPECT_LT(answer.per_site[0].std, 0.85 * answer.per_push[0].std);  // two pushes know more than one

  // Without names, contacts within one patch are one place: here all of them.
  for (auto& push : recording.pushes) push.site.clear();
  EXPECT_TRUE(fit(recording, coarse_block(), inputs, {}).per_site.empty());
}

/// A sensor whose scale is hardly known is wrong by the same share at low and at high loads, in one push and the next.
class CrossCheckOfScale : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(KnownTo, CrossCheckOfScale, testing::Values(0.0, 0.05, 0.3));

TEST_P(CrossCheckOfScale, HidesNoMaterialThatStiffens) {
  Recording recording = pushed_block_recording();
  recording.force_scale_std = GetParam();
  PushedBlock soft, stiff;
  stiff.young_pa = 1.25 * soft.young_pa;
  Inputs inputs = clouds_of(soft);
  inputs[1] = clouds_of(stiff)[1];
  EXPECT_TRUE(says(fit(recording, coarse_block(), inputs, {}), "not_linear"));
  EXPECT_FALSE(says(fit(recording, coarse_block(), clouds_of(soft), {}), "not_linear"));
}

TEST_P(CrossCheckOfScale, HidesNoBodyThatDiffers) {
  Recording recording = pushed_block_recording();
  recording.force_scale_std = GetParam();
  recording.pushes.push_back(recording.pushes[0]);
  recording.pushes[1].name = "again";
  PushedBlock soft, stiff;
  stiff.young_pa = 1.25 * soft.young_pa;
  stiff.seed = 8;
  Inputs inputs = clouds_of(soft);
  for (auto& step : clouds_of(stiff)) inputs.push_back(step);
  EXPECT_TRUE(says(fit(recording, coarse_block(), inputs, {}), "not_homogeneous"));
}

TEST(CrossCheck, MaterialThatStiffensBeyondItsLawIsCalledSo) {
  Recording recording = pushed_block_recording();
  PushedBlock soft, stiff;
  stiff.young_pa = 1.5 * soft.young_pa;
  Inputs inputs = clouds_of(soft);
  inputs[1] = clouds_of(stiff)[1];  // the higher load meets a stiffer body
  const Identification answer = fit(recording, coarse_block(), inputs, {});
  EXPECT_TRUE(says(answer, "not_linear"));
}

TEST(CrossCheck, APushOfOneLoadAtAStifferPlaceIsNoMaterialThatStiffens) {
  Recording recording = pushed_block_recording();
  recording.pushes.push_back(recording.pushes[0]);
  recording.pushes[1].name = "once";
  recording.pushes[1].steps.erase(recording.pushes[1].steps.begin());
  PushedBlock soft, stiff;
  stiff.young_pa = 1.5 * soft.young_pa;
  stiff.seed = 8;
  Inputs inputs = clouds_of(soft);
  inputs.push_back(clouds_of(stiff).back());
  const Identification answer = fit(recording, coarse_block(), inputs, {});
  EXPECT_TRUE(says(answer, "not_homogeneous"));
  EXPECT_FALSE(says(answer, "not_linear"));
}

/// Steps of these loads in newtons; below zero: on the way back.
Push up_and_back(const Recording& like, const std::vector<double>& newtons) {
  Push push = like.pushes[0];
  const Step pressed = push.steps[0];
  push.steps.clear();
  for (const double newton : newtons) {
    push.steps.push_back(newton != 0 ? pressed : Step());
    push.steps.back().unloading = newton < 0;
    if (newton != 0) push.steps.back().loads[0].force_n = Vec3(0, 0, -std::abs(newton));
  }
  return push;
}

// A push that was not recorded on its way back, at a place that is stiffer.
TEST(CrossCheck, AStifferPlaceWithoutAWayBackIsNoHysteresis) {
  const Recording like = pushed_block_recording();
  Recording recording = like;
  recording.pushes = {up_and_back(like, {0.06, 0.12}), up_and_back(like, {0.06, 0.12, -0.12, -0.06})};
  recording.pushes[1].name = "again";
  Recording first = like, second = like;
  first.pushes = {recording.pushes[0]};
  second.pushes = {recording.pushes[1]};
  PushedBlock soft, stiff;
  stiff.young_pa = 1.5 * soft.young_pa;
  stiff.seed = 8;
  Inputs inputs = clouds_of(stiff, first);
  for (auto& step : clouds_of(soft, second)) inputs.push_back(step);
  const Identification answer = fit(recording, coarse_block(), inputs, {});
  EXPECT_TRUE(says(answer, "not_homogeneous"));
  EXPECT_FALSE(says(answer, "hysteresis"));
}

// On the way back there is no load as high as the highest, which meets a stiffer body.
TEST(CrossCheck, AMaterialThatStiffensIsNoHysteresis) {
  Recording recording = pushed_block_recording();
  recording.pushes = {up_and_back(recording, {0, 0.06, 0.12, 0.24, -0.11, -0.06, 0})};
  PushedBlock soft, stiff;
  stiff.young_pa = 1.5 * soft.young_pa;
  Inputs inputs = clouds_of(soft, recording);
  inputs[3] = clouds_of(stiff, recording)[3];
  const Identification answer = fit(recording, coarse_block(), inputs, {});
  EXPECT_TRUE(says(answer, "not_linear"));
  EXPECT_FALSE(says(answer, "hysteresis"));
  // What is softer at the same loads on the way back still is.
  PushedBlock let_go;
  let_go.young_pa = 0.8 * soft.young_pa;
  inputs = clouds_of(soft, recording);
  for (const std::size_t s : {4u, 5u}) inputs[s] = clouds_of(let_go, recording)[s];
  EXPECT_TRUE(says(fit(recording, coarse_block(), inputs, {}), "hysteresis"));
}

TEST(CochranQ, IsTheChiSquareTestOfWeightedMeans) {
  // Upper tails from tables of the chi-square distribution.
  EXPECT_NEAR(chi_square_tail(3.841, 1), 0.05, 1e-4);
  EXPECT_NEAR(chi_square_tail(5.991, 2), 0.05, 1e-4);
  EXPECT_NEAR(chi_square_tail(7.815, 3), 0.05, 1e-4);
  EXPECT_NEAR(chi_square_tail(18.307, 10), 0.05, 1e-4);
  EXPECT_NEAR(chi_square_tail(24.725, 11), 0.01, 1e-4);
  EXPECT_EQ(chi_square_tail(0, 3), 1);

  const VectorX apart = (VectorX(2) << 0, std::log(1.1)).finished();
  MatrixX covariance = MatrixX::Identity(2, 2) * 0.05 * 0.05;
  const auto chance = [&](double of_one) { return std::erfc(std::log(1.1) / std::sqrt(2 * of_one) / std::sqrt(2.0)); };
  EXPECT_NEAR(homogeneity_p_value(apart, covariance), chance(0.05 * 0.05 + 0.02 * 0.02), 1e-9);
  // What both are wrong by together is no reason to agree.
  covariance.array() += 0.3 * 0.3;
  EXPECT_NEAR(homogeneity_p_value(apart, covariance), chance(0.05 * 0.05 + 0.02 * 0.02), 1e-9);
  EXPECT_EQ(homogeneity_p_value(apart.head(1), covariance.topLeftCorner(1, 1)), 1);
}

}  // namespace
}  // namespace palpate::estimation::cross_check_test
