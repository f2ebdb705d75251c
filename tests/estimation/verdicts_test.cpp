// label: unit
// SPDX-License-Identifier: Apache-2.0
// Verdicts on recordings whose truth has what they speak of, and on the nearest ones that do not have it.
#include "palpate/estimation/verdicts.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pushed_block.hpp"

namespace palpate::estimation::verdicts_test {
namespace {

PushedBlock clear_view(const std::string& material = "linear") {
  PushedBlock truth;
  truth.material = material;
  truth.points = 600;
  truth.sigma_m = 2e-4;
  return truth;
}

Identification quick_fit(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, bool cross_checks = false) {
  FitOptions options;
  options.cross_checks = cross_checks;
  options.stresses = false;
  return fit(recording, object, inputs, options);
}

std::string message(const Identification& answer, const std::string& code) {
  for (const Verdict& verdict : answer.verdicts)
    if (verdict.code == code) return verdict.message;
  return "";
}

// ---- Units

/// The block with every length written `factor` times as large, and every force `force_factor` times.
Identification miswritten(double factor, double force_factor) {
  Recording recording = pushed_block_recording();
  Inputs inputs = clouds_of(clear_view());
  for (auto& step : inputs) {
    auto& cloud = std::get<PointCloud>(step[0]);
    cloud.points_m *= factor;
    cloud.sigma_m *= factor;
  }
  recording.tools[0].radius_m *= factor;
  for (Step& step : recording.pushes[0].steps) {
    step.loads[0].contact_m *= factor;
    *step.loads[0].force_n *= force_factor;
  }
  return quick_fit(recording, simulated(fem::to_quadratic(kuhn_block(4, 3, 2, factor * block_size_m)), "linear"), inputs);
}

TEST(YoungModulusAtBound, MillimetresTakenForMetresAreSaid) {
  const Identification answer = miswritten(1000, 1);
  EXPECT_NEAR(parameter(answer, "young_modulus").value, 2e4 * 1e-6, 0.1 * 2e4 * 1e-6);
  EXPECT_NE(message(answer, "young_modulus_at_bound").find("millimetres"), std::string::npos);
}

TEST(YoungModulusAtBound, TheEndsOfTheSearchAreSaid) {
  // 2e4 Pa times 1e-8 lies below where the search ends, times 1e9 above.
  const Identification soft = miswritten(1000, 1e-2), stiff = miswritten(1, 1e9);
  EXPECT_TRUE(says(soft, "young_modulus_at_bound")) << parameter(soft, "young_modulus").value;
  EXPECT_TRUE(says(stiff, "young_modulus_at_bound")) << parameter(stiff, "young_modulus").value;
  EXPECT_NE(message(stiff, "young_modulus_at_bound").find("millinewtons"), std::string::npos);
}

TEST(YoungModulusAtBound, IsNotSaidOfGelsAndStones) {
  EXPECT_FALSE(says(miswritten(1, 1), "young_modulus_at_bound"));
  EXPECT_FALSE(says(miswritten(1, 1e-3), "young_modulus_at_bound"));  // 20 Pa
  EXPECT_FALSE(says(miswritten(1, 1e6), "young_modulus_at_bound"));   // 20 GPa
}

// ---- The search and its points

TEST(NotConverged, IsSaidOfASearchThatWasCutShort) {
  const Inputs inputs = clouds_of(clear_view("neo_hookean"));
  FitOptions options;
  options.cross_checks = options.stresses = false;
  options.young_start_pa = 1e6;
  options.max_iterations = 1;
  const Identification cut = fit(pushed_block_recording(), coarse_block(), inputs, options);
  EXPECT_TRUE(says(cut, "not_converged"));
  EXPECT_NE(cut.termination, Termination::converged);
  options.max_iterations = FitOptions{}.max_iterations;
  EXPECT_FALSE(says(fit(pushed_block_recording(), coarse_block(), inputs, options), "not_converged"));
}

TEST(ManyOutliers, AreSaidWhereMoreThanASeventhOfThePointsIsElsewhere) {
  const auto with = [](double share) {
    PushedBlock truth = clear_view();
    truth.outlier_share = share;
    return quick_fit(pushed_block_recording(), coarse_block("linear"), clouds_of(truth));
  };
  EXPECT_TRUE(says(with(0.25), "many_outliers"));
  EXPECT_FALSE(says(with(0.05), "many_outliers"));
}

TEST(YoungNotDetermined, IsSaidWhereTheBlockHardlyMovesAndNotOfAClearView) {
  Recording recording = pushed_block_recording();
  EXPECT_FALSE(says(quick_fit(recording, coarse_block("linear"), clouds_of(clear_view())), "e_not_determined"));
  for (Step& step : recording.pushes[0].steps) *step.loads[0].force_n *= 1e-3;
  EXPECT_TRUE(says(quick_fit(recording, coarse_block("linear"), clouds_of(clear_view(), recording)), "e_not_determined"));
}

// ---- Loading and unloading

/// Up in three steps and back in two, when the block has a share of its E only.
Identification up_and_down(double unloading_share) {
  Recording recording = pushed_block_recording();
  const Step last = recording.pushes[0].steps.back();
  recording.pushes[0].steps.clear();
  const double newtons[] = {0.04, 0.08, 0.12, 0.08, 0.04};
  for (int k = 0; k < 5; ++k) {
    Step step = last;
    step.time_s = k;
    step.loads[0].force_n = Vec3(0, 0, -newtons[k]);
    step.unloading = k > 2;
    recording.pushes[0].steps.push_back(step);
  }
  const PushedBlock up = clear_view();
  PushedBlock down = up;
  down.young_pa *= unloading_share;
  Inputs inputs = clouds_of(up, recording);
  const Inputs back = clouds_of(down, recording);
  for (std::size_t s = 3; s < 5; ++s) inputs[s] = back[s];
  return quick_fit(recording, coarse_block("linear"), inputs, true);
}

TEST(Hysteresis, IsSaidWhereTheBlockComesBackSofterThanItWent) {
  const Identification answer = up_and_down(0.75);
  const std::string said = message(answer, "hysteresis");
  ASSERT_FALSE(said.empty());
  EXPECT_NEAR(std::stod(said.substr(said.find("gives ") + 6)), 0.75, 0.08) << said;
}

TEST(Hysteresis, IsNotSaidOfAnElasticBlock) { EXPECT_FALSE(says(up_and_down(1), "hysteresis")); }

// ---- Few data

/// The block seen by this many points of its surface in all.
Identification seen_by(Index points) {
  Inputs inputs = clouds_of(clear_view());
  for (auto& step : inputs) std::get<PointCloud>(step[0]).points_m.conservativeResize(points / 2, 3);
  return quick_fit(pushed_block_recording(), coarse_block("linear"), inputs);
}

TEST(TooFewPoints, IsSaidWhereFewerThanFiveAreLeftToTestWith) {
  const Identification answer = seen_by(6);  // two of them are E and nu
  EXPECT_NE(message(answer, "too_few_points").find("Only 6 measured numbers"), std::string::npos) << message(answer, "too_few_points");
}

TEST(TooFewPoints, IsNotSaidOfMore) { EXPECT_FALSE(says(seen_by(40), "too_few_points")); }

// ---- Ends of the range of nu

Identification nu_within(double lower, double upper, double truth) {
  Recording recording = pushed_block_recording();
  recording.model.poisson_lower = lower;
  recording.model.poisson_upper = upper;
  PushedBlock block = clear_view();
  block.poisson = truth;
  return quick_fit(recording, coarse_block("linear"), clouds_of(block));
}

TEST(PoissonAtBound, IsSaidAtEitherEnd) {
  EXPECT_NE(message(nu_within(0.05, 0.25, 0.42), "nu_at_bound").find("(0.25)"), std::string::npos);
  EXPECT_NE(message(nu_within(0.25, 0.45, 0.05), "nu_at_bound").find("(0.25)"), std::string::npos);
}

TEST(PoissonAtBound, NoPartOfTheBudgetIsLargerThanTheWhole) {
  const Identification answer = nu_within(0.24, 0.25, 0.42);
  const Parameter& young = parameter(answer, "young_modulus");
  const Parameter& nu = parameter(answer, "poisson_ratio");
  ASSERT_FALSE(answer.budget.empty());
  for (const auto& entry : answer.budget) {
    EXPECT_LE(entry.young_modulus_percent, 105 * young.std / young.value) << entry.input;
    EXPECT_LE(entry.poisson_shift, 1.05 * nu.std) << entry.input;
  }
}

TEST(PoissonAtBound, IsNotSaidInside) {
  const Identification answer = nu_within(0.05, 0.45, 0.3);
  EXPECT_TRUE(parameter(answer, "poisson_ratio").determined);
  EXPECT_FALSE(says(answer, "nu_at_bound"));
}

// ---- What is doubted of a nu

// A doubt speaks of the first region's nu, which is well known here; that of the other one is not.
TEST(ContactElsewhere, IsSaidWhereItMattersForTheFirstRegionsNu) {
  const Recording recording = pushed_block_recording();
  SimulatedObject object = coarse_block("linear");
  put_two_halves(object);
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns);
  Objective objective(model, clouds_of(clear_view()), unknowns);
  Optimum at;
  at.unknowns = unknowns.prior_mean();
  at.unknowns(log_young) = std::log(2e4);
  at.unknowns(poisson) = 0.3;
  at.evaluation = objective.evaluate(at.unknowns, at.loss);
  at.termination = Termination::converged;
  Identification answer;
  answer.material = "linear";
  for (const char* region : {"clamped half", "free half"}) {
    const bool first = answer.parameters.empty();
    answer.parameters.push_back({"young_modulus", region, "Pa", 2e4, 200, 1.96e4, 2.04e4, true});
    answer.parameters.push_back({"poisson_ratio", region, "1", 0.3, first ? 0.01 : 0.2, 0.28, 0.32, true});
  }
  Doubts doubts;
  Doubt contact;
  contact.name = "down";
  contact.size_m = 0.005, contact.scale_m = 0.012;
  contact.p_value = 0;
  contact.log_young = VectorX::Zero(2);
  contact.poisson = 0.05;
  doubts.all = {contact};
  const auto codes = [&] {
    std::vector<std::string> out;
    for (const Verdict& verdict : judge({recording, objective, at, objective.summarise(at.loss), answer, CrossChecks{}, doubts, std::nullopt}))
      out.push_back(verdict.code);
    return out;
  };
  const auto says_it = [](const std::vector<std::string>& all) { return std::count(all.begin(), all.end(), "contact_elsewhere") == 1; };
  EXPECT_TRUE(says_it(codes()));
  std::swap(answer.parameters[1].std, answer.parameters[3].std);
  EXPECT_FALSE(says_it(codes())) << "a quarter of a standard deviation";
}

// ---- Strains beyond the linear law

/// Bent so far that linear theory turns what is compressed at the clamp inside out: a strain of M c / (E I) = 3.6 at 80 times the load.
Identification linear_under(double factor) {
  Recording recording = pushed_block_recording();
  for (Step& step : recording.pushes[0].steps) *step.loads[0].force_n *= factor;
  return quick_fit(recording, coarse_block("linear"), clouds_of(clear_view(), recording));
}

TEST(BeyondSmallStrain, IsSaidWhereLinearElementsTurnInsideOut) {
  const Identification answer = linear_under(80);
  EXPECT_TRUE(says(answer, "beyond_small_strain"));
  EXPECT_FALSE(says(answer, "inverted_elements"));  // that is the other laws'
}

TEST(BeyondSmallStrain, IsNotSaidOfALittleBending) { EXPECT_FALSE(says(linear_under(1), "beyond_small_strain")); }

// ---- Loads beyond a law

/// Seen without error through the fit's own mesh, pressed with `over_young` of its E (mean over the patch).
Identification corotational_under(double over_young) {
  PushedBlock truth;
  truth.material = "corotational";
  truth.finer = 1;
  Recording recording = glued_block_recording({Vec3(0, 0, -0.1), Vec3(0, 0, -1)}, 0.03, 0.02);
  const double radius_m = recording.tools[0].radius_m, newton = over_young * truth.young_pa * EIGEN_PI * radius_m * radius_m;
  recording.pushes[0].steps[1].loads[0].force_n = Vec3(0, 0, -newton);
  return quick_fit(recording, coarse_block(truth.material), clouds_of(truth, recording));
}

TEST(InvertedElements, AreSaidOfALoadThatTurnsThemInsideOut) {
  const Identification answer = corotational_under(1);
  EXPECT_TRUE(says(answer, "inverted_elements"));
  EXPECT_NE(message(answer, "inverted_elements").find("neo_hookean"), std::string::npos);
  EXPECT_FALSE(says(corotational_under(0.05), "inverted_elements"));
}

// ---- Two equilibria

const Vec3 column_m(0.02, 0.03, 0.3);

double euler_n(double young_pa) {
  return EIGEN_PI * EIGEN_PI * young_pa * column_m.y() * std::pow(column_m.x(), 3) / 12 / (4 * column_m.z() * column_m.z());
}

/// A column that is bent to one side first, and then loaded along its axis with a trace of force to the other side: above Euler's
/// load it stays where it is, although from rest it would bend the other way.
Identification column_under(double share_of_euler) {
  const TetMesh mesh = fem::to_quadratic(kuhn_block(1, 1, 10, column_m));
  Recording recording;
  Support foot;
  foot.name = "foot";
  foot.kind = SupportKind::clamp;
  foot.vertices = nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; });
  recording.supports = {foot};
  Tool cap;
  cap.name = "cap";
  cap.shape = ToolShape::vertices;
  cap.vertices = nodes_where(mesh, [](const Vec3& x) { return x.z() > column_m.z() - 1e-9; });
  recording.tools = {cap};
  Push push;
  push.name = "squeeze";
  const double load_n = share_of_euler * euler_n(2e4);
  for (const auto& [share, aside] : {std::pair{0.4, 0.06}, {0.9, 0.06}, {0.98, 0.03}, {1.0, -0.003}}) {
    Load load;
    load.tool = "cap";
    load.force_n = load_n * Vec3(aside, 0, -share);
    load.direction = -Vec3::UnitZ();
    push.steps.emplace_back().loads = {load};
  }
  recording.pushes = {push};
  recording.model.poisson_fixed = 0.3;

  Unknowns unknowns;
  ForwardModel model(recording, simulated(mesh, "neo_hookean"), unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(2e4);
  at(poisson) = 0.3;
  std::mt19937 random(4);
  std::normal_distribution<double> normal(0, 3e-4);
  Inputs inputs;
  double last_aside_m = 0;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    PointCloud cloud;
    cloud.points_m = model.predict(s, at, false).surface_m;
    cloud.sigma_m = VectorX::Constant(1, 3e-4);
    last_aside_m = cloud.points_m.col(0).maxCoeff() - column_m.x();
    for (Index i = 0; i < cloud.points_m.rows(); ++i) cloud.points_m.row(i) += Vec3(normal(random), normal(random), normal(random)).transpose();
    inputs.push_back({cloud});
  }
  if (share_of_euler > 1) {
    EXPECT_GT(last_aside_m, 0.05) << "the truth is not bent to the side that it was pushed to";
  }
  FitOptions options;
  options.stresses = false;
  options.young_start_pa = 2.1e4;
  return fit(recording, simulated(mesh, "neo_hookean"), inputs, options);
}

TEST(TwoEquilibria, IsSaidOfAColumnAboveEulersLoad) {
  const Identification answer = column_under(1.2);
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  EXPECT_NEAR(parameter(answer, "young_modulus").value, 2e4, 0.05 * 2e4);
  EXPECT_TRUE(says(answer, "two_equilibria"));
}

TEST(TwoEquilibria, IsNotSaidBelowIt) { EXPECT_FALSE(says(column_under(0.6), "two_equilibria")); }

}  // namespace
}  // namespace palpate::estimation::verdicts_test
