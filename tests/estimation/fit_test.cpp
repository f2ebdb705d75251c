// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The whole fit against closed forms, and against clouds of a finer mesh with seeded noise.
#include "palpate/estimation/fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "pressed_bar.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::fit_test {
namespace {

// ---- Uniaxial compression between smooth platens: the state is homogeneous, so any mesh is exact.

class UniaxialCompression : public testing::TestWithParam<const char*> {};

TEST_P(UniaxialCompression, ClosedFormForcesGiveYoungsModulusExactly) {
  const std::string material = GetParam();
  const double young_pa = 31415, nu = 0.37;
  Recording recording = pressed_bar(material == "linear" ? linear_force_n : neo_hookean_force_n, young_pa, nu);
  recording.model.poisson_fixed = nu;
  const Identification answer = fit(recording, simulated(kuhn_block(2, 1, 2, bar_m), material), wrenches_of(recording), {});
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_NEAR(young.value, young_pa, 1e-6 * young_pa);
  // With nu known the forces are E times known numbers f: var(E)/E^2 = sigma^2 / sum f^2.
  double information = 0;
  for (const auto& step : recording.pushes[0].steps) {
    information += std::pow(std::get<Wrench>(step.observations[0]).force_n.z() / 0.02, 2);
  }
  // Derivatives may come from a solution a thousandth away.
  EXPECT_NEAR(young.std / young.value, 1 / std::sqrt(information), 1e-3 / std::sqrt(information));
  EXPECT_NEAR(std::log(young.upper_95 / young.lower_95), 2 * 1.959964 / std::sqrt(information),
              4e-3 / std::sqrt(information));
  EXPECT_DOUBLE_EQ(parameter(answer, "poisson_ratio").value, nu);
  EXPECT_DOUBLE_EQ(parameter(answer, "poisson_ratio").std, 0);
  EXPECT_FALSE(says(answer, "nu_not_determined"));
  EXPECT_FALSE(says(answer, "model_does_not_fit"));
  EXPECT_EQ(answer.fit.steps, 6u);
}

/// The state is homogeneous and uniaxial: von Mises stress is force over area as it is now (the linear law: as it was).
TEST_P(UniaxialCompression, StressOfEveryStepIsForceOverArea) {
  const std::string material = GetParam();
  const double young_pa = 31415, nu = 0.37;
  Recording recording = pressed_bar(material == "linear" ? linear_force_n : neo_hookean_force_n, young_pa, nu);
  recording.model.poisson_fixed = nu;
  const Identification answer = fit(recording, simulated(kuhn_block(2, 1, 2, bar_m), material), wrenches_of(recording), {});
  ASSERT_EQ(answer.steps.size(), 6u);
  for (const StepFit& step : answer.steps) {
    double volume_m3 = 0;  // the bar may have turned, so its width along x says nothing
    for (Index t = 0; t < answer.surface.triangles.rows(); ++t) {
      const auto corner = [&](int k) { return Vec3(step.surface_m.row(answer.surface.triangles(t, k))); };
      volume_m3 += corner(0).dot(corner(1).cross(corner(2))) / 6;
    }
    const double area_m2 = material == "linear" ? bar_m.x() * bar_m.y() : volume_m3 / (bar_m.z() - step.travel_m);
    const double stress_pa = step.force_measured_n / area_m2;
    ASSERT_EQ(step.von_mises_pa.size(), step.surface_m.rows());
    // The bar's turn about the push is taken out to first order, which changes its volume by the square.
    EXPECT_LT((step.von_mises_pa.array() - stress_pa).abs().maxCoeff(), (material == "linear" ? 1e-5 : 2e-4) * young_pa);
  }
}

/// With nu known the force is E times a known number, so its relative band is that of E.
TEST_P(UniaxialCompression, BandOfTheForceIsThatOfYoungsModulus) {
  const std::string material = GetParam();
  Recording recording = pressed_bar(material == "linear" ? linear_force_n : neo_hookean_force_n, 31415, 0.37);
  recording.model.poisson_fixed = 0.37;
  const Identification answer = fit(recording, simulated(kuhn_block(1, 1, 1, bar_m), material), wrenches_of(recording), {});
  const Parameter& young = parameter(answer, "young_modulus");
  for (const StepFit& step : answer.steps) {
    EXPECT_NEAR(step.force_predicted_std_n, step.force_predicted_n * young.std / young.value, 1e-3 * step.force_predicted_std_n + 1e-12);
  }
}

TEST_P(UniaxialCompression, WatchersSeeEveryAcceptedIterationAndChangeNothing) {
  const std::string material = GetParam();
  const Recording recording = pressed_bar(material == "linear" ? linear_force_n : neo_hookean_force_n, 31415, 0.37);
  const auto object = simulated(kuhn_block(1, 1, 1, bar_m), material);
  const Identification unwatched = fit(recording, object, wrenches_of(recording), {});
  std::vector<Identification> seen;
  FitOptions options;
  options.on_estimate = [&](const Identification& so_far) { seen.push_back(so_far); };
  double largest_share = 0;
  const Identification answer = fit(recording, object, wrenches_of(recording), options, [&](std::string_view stage, double share) {
    if (stage == "fit") {
      EXPECT_GE(share, largest_share);
      EXPECT_LT(share, 1);
      largest_share = share;
    }
    return true;
  });
  EXPECT_EQ(parameter(answer, "young_modulus").value, parameter(unwatched, "young_modulus").value);
  ASSERT_GE(answer.trace.size(), 2u);
  ASSERT_EQ(seen.size(), answer.trace.size() + 1);  // and once with the posterior
  for (std::size_t i = 0; i < answer.trace.size(); ++i) {
    EXPECT_EQ(seen[i].trace.size(), i + 1);
    EXPECT_EQ(parameter(seen[i], "young_modulus").value, answer.trace[i].young_modulus_pa);
    EXPECT_TRUE(std::isnan(parameter(seen[i], "young_modulus").lower_95));
    EXPECT_EQ(seen[i].steps.size(), 6u);
    if (i == 0 || answer.trace[i].round != answer.trace[i - 1].round) continue;
    EXPECT_LE(answer.trace[i].cost, answer.trace[i - 1].cost + 1e-6 * std::abs(answer.trace[i - 1].cost) + 1e-9);
  }
  EXPECT_EQ(parameter(seen.back(), "young_modulus").lower_95, parameter(answer, "young_modulus").lower_95);
}

TEST(UniaxialForces, OfTheLinearLawDoNotDetermineNuAndThatIsSaid) {
  const Recording recording = pressed_bar(linear_force_n, 31415, 0.37);
  const Identification answer = fit(recording, simulated(kuhn_block(1, 1, 1, bar_m), "linear"), wrenches_of(recording), {});
  EXPECT_TRUE(says(answer, "nu_not_determined"));
  EXPECT_FALSE(parameter(answer, "poisson_ratio").determined);
  EXPECT_NEAR(parameter(answer, "young_modulus").value, 31415, 1e-3 * 31415);
}

TEST(UniaxialForces, OfTheNeoHookeanLawDetermineNuByTheirCurvature) {
  const Recording recording = pressed_bar(neo_hookean_force_n, 31415, 0.37);
  const Identification answer =
      fit(recording, simulated(kuhn_block(1, 1, 1, bar_m), "neo_hookean"), wrenches_of(recording), {});
  EXPECT_FALSE(says(answer, "nu_not_determined"));
  EXPECT_NEAR(parameter(answer, "poisson_ratio").value, 0.37, 0.5 * parameter(answer, "poisson_ratio").std);
  EXPECT_NEAR(parameter(answer, "young_modulus").value, 31415, 0.5 * parameter(answer, "young_modulus").std);
}

INSTANTIATE_TEST_SUITE_P(Laws, UniaxialCompression, testing::Values("linear", "neo_hookean"));

TEST(ForceScale, ItsPriorBecomesTheErrorOfYoungsModulus) {
  Recording recording = pressed_bar(linear_force_n, 2e4, 0.3);
  recording.model.poisson_fixed = 0.3;
  recording.force_scale_std = 0.05;
  for (auto& step : recording.pushes[0].steps) std::get<Wrench>(step.observations[0]).force_sigma_n = 1e-3;
  const Identification answer = fit(recording, simulated(kuhn_block(1, 1, 1, bar_m), "linear"), wrenches_of(recording), {});
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_NEAR(young.value, 2e4, 1e-4 * 2e4);
  EXPECT_NEAR(young.std / young.value, 0.05, 0.001);
  ASSERT_FALSE(answer.budget.empty());
  EXPECT_EQ(answer.budget.front().input, "force_scale");
}

// The encoder reads what the bar gives and what the arm gives: with the arm's share unknown E is known by
// d(log E) = d(compliance) * stiffness of the bar.
TEST(Compliance, ItsPriorBecomesTheErrorOfYoungsModulus) {
  Recording recording = pressed_bar(linear_force_n, 2e4, 0.3);
  recording.model.poisson_fixed = 0.3;
  const double stiffness_n_m = linear_force_n(2e4, 0.3, 1), compliance_m_per_n = 1e-4;
  recording.tools[0].compliance_m_per_n = compliance_m_per_n;
  for (auto& step : recording.pushes[0].steps) {
    auto& wrench = std::get<Wrench>(step.observations[0]);
    wrench.force_sigma_n = 1e-3;
    *step.loads[0].travel_m -= compliance_m_per_n * wrench.force_n.z();
  }
  const auto fitted = [&](double std_m_per_n) {
    recording.tools[0].compliance_std_m_per_n = std_m_per_n;
    return fit(recording, simulated(kuhn_block(1, 1, 1, bar_m), "linear"), wrenches_of(recording), {});
  };
  const Identification exact = fitted(0), open = fitted(2e-4);
  EXPECT_NEAR(parameter(exact, "young_modulus").value, 2e4, 1);
  EXPECT_NEAR(parameter(open, "young_modulus").value, 2e4, 1);
  EXPECT_LT(parameter(exact, "young_modulus").std, 0.002 * 2e4);
  EXPECT_NEAR(parameter(open, "young_modulus").std / 2e4, 2e-4 * stiffness_n_m, 0.02 * 2e-4 * stiffness_n_m);
  ASSERT_FALSE(open.budget.empty());
  EXPECT_EQ(open.budget.front().input, "compliance");
  // Stated as exact it is in no interval, and is said all the same: a tenth of it.
  const auto said = [&](const std::string& input) {
    const auto at = std::find_if(exact.budget_if.begin(), exact.budget_if.end(), [&](const BudgetEntry& e) { return e.input == input; });
    return at == exact.budget_if.end() ? -1 : at->young_modulus_percent;
  };
  EXPECT_NEAR(said("compliance"), 100 * 0.1 * compliance_m_per_n * stiffness_n_m, 0.5 * compliance_m_per_n * stiffness_n_m);
  EXPECT_NEAR(said("force_scale"), 1, 0.01);
}

// Steps whose travel errs independently: weighed by their travels, var(log E) = sigma^2 / sum of travels squared.
TEST(ImposedTravel, ItsNoiseBecomesTheErrorOfYoungsModulus) {
  constexpr double sigma_m = 5e-5;
  Recording recording = pressed_bar(linear_force_n, 2e4, 0.3);
  recording.model.poisson_fixed = 0.3;
  for (auto& step : recording.pushes[0].steps) std::get<Wrench>(step.observations[0]).force_sigma_n = 1e-5;
  const auto object = simulated(kuhn_block(1, 1, 1, bar_m), "linear");
  const Identification exact = fit(recording, object, wrenches_of(recording), {});
  double squares = 0;
  for (auto& step : recording.pushes[0].steps) {
    squares += std::pow(*step.loads[0].travel_m, 2);
    step.observations.push_back(ToolTravel{"", *step.loads[0].travel_m, sigma_m});
  }
  const Identification open = fit(recording, object, wrenches_of(recording), {});
  const Parameter& young = parameter(open, "young_modulus");
  EXPECT_NEAR(young.value, 2e4, 1);
  EXPECT_NEAR(young.std / young.value, sigma_m / std::sqrt(squares), 0.02 * sigma_m / std::sqrt(squares));
  EXPECT_LT(parameter(exact, "young_modulus").std, 0.1 * young.std);
}

// ---- A pushed block, seen by noisy clouds.

void expect_inside(const Parameter& p, double truth) {
  EXPECT_LT(p.lower_95, truth) << p.name << " " << p.value;
  EXPECT_GT(p.upper_95, truth) << p.name << " " << p.value;
}

TEST(PushedBlockFit, CloudOfAFinerMeshGivesBothParametersWithinTheirIntervals) {
  const PushedBlock truth;
  const Identification answer = fit(pushed_block_recording(), coarse_block(), clouds_of(truth), {});
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  expect_inside(parameter(answer, "young_modulus"), truth.young_pa);
  expect_inside(parameter(answer, "poisson_ratio"), truth.poisson);
  EXPECT_LT(parameter(answer, "young_modulus").std, 0.1 * truth.young_pa);  // an interval that says something
  EXPECT_NEAR(answer.fit.chi2_per_dof, 1, 0.25);
  EXPECT_FALSE(says(answer, "model_does_not_fit"));
  EXPECT_FALSE(says(answer, "many_outliers"));
  ASSERT_EQ(answer.covariance.rows(), 2);
}

// The numbers of an inflated thing are those of the thing, not of its skin, and that is said of no other.
TEST(PushedBlockFit, OfAnInflatedObjectTheModulusIsApparentOnly) {
  const PushedBlock truth;
  Recording recording = pushed_block_recording();
  EXPECT_FALSE(says(fit(recording, coarse_block(), clouds_of(truth), {}), "apparent_modulus_only"));
  recording.rest.state = RestState::under_pressure;
  EXPECT_TRUE(says(fit(recording, coarse_block(), clouds_of(truth), {}), "apparent_modulus_only"));
}

TEST(PushedBlockFit, FivePercentGrossOutliersMoveLittle) {
  PushedBlock truth;
  const Identification clean = fit(pushed_block_recording(), coarse_block(), clouds_of(truth), {});
  truth.outlier_share = 0.05;
  const Identification spoilt = fit(pushed_block_recording(), coarse_block(), clouds_of(truth), {});
  const Parameter& young = parameter(clean, "young_modulus");
  EXPECT_NE(parameter(spoilt, "young_modulus").value, young.value);
  EXPECT_LT(std::abs(parameter(spoilt, "young_modulus").value - young.value), young.std);
  EXPECT_LT(spoilt.fit.points_used, clean.fit.points_used);
}

TEST(PushedBlockFit, SameInputSameDigitsAndAnyStart) {
  const Inputs inputs = clouds_of({});
  const Recording recording = pushed_block_recording();
  const Identification first = fit(recording, coarse_block(), inputs, {});
  const Identification second = fit(recording, coarse_block(), inputs, {});
  for (std::size_t k = 0; k < first.parameters.size(); ++k) {
    EXPECT_EQ(first.parameters[k].value, second.parameters[k].value);
    EXPECT_EQ(first.parameters[k].lower_95, second.parameters[k].lower_95);
    EXPECT_EQ(first.parameters[k].upper_95, second.parameters[k].upper_95);
  }
  for (double factor : {0.01, 100.0}) {
    FitOptions options;
    options.young_start_pa = factor * 2e4;
    options.poisson_start = factor < 1 ? 0.1 : 0.45;
    const Identification far = fit(recording, coarse_block(), inputs, options);
    EXPECT_EQ(far.termination, Termination::converged) << factor << " " << far.message;
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_NEAR(far.parameters[k].value, first.parameters[k].value, 0.05 * first.parameters[k].std) << factor;
    }
  }
}

// Up and down again on the way: the camera sees each force 50 ms later than the sensor says.
TEST(PushedBlockFit, ClocksThatDifferAreFoundFromLoadingAndUnloading) {
  Recording recording = pushed_block_recording();
  const Load down = recording.pushes[0].steps[0].loads[0];
  recording.pushes[0].steps.clear();
  constexpr double late_s = 0.05, rate_n_s = 0.25;
  for (const auto& [newton, sign] : {std::pair{0.05, 1}, {0.09, 1}, {0.13, 1}, {0.11, -1}, {0.07, -1}, {0.03, -1}}) {
    Step step;
    step.loads = {down};
    step.loads[0].force_n = Vec3(0, 0, -newton);
    step.loads[0].force_rate_n_s = Vec3(0, 0, -sign * rate_n_s);
    recording.pushes[0].steps.push_back(step);
  }
  Recording seen = recording;
  for (Step& step : seen.pushes[0].steps) *step.loads[0].force_n += late_s * step.loads[0].force_rate_n_s;
  const PushedBlock truth;
  const Inputs inputs = clouds_of(truth, seen);

  const Identification trusting = fit(recording, coarse_block(), inputs, {});
  recording.time_offset_std_s = 0.05;
  const Identification open = fit(recording, coarse_block(), inputs, {});
  const auto found = std::find_if(open.nuisances.begin(), open.nuisances.end(), [](const Nuisance& n) { return n.name == "time_offset"; });
  ASSERT_NE(found, open.nuisances.end());
  EXPECT_EQ(found->unit, "s");
  EXPECT_NEAR(found->value, late_s, 3 * found->std);
  EXPECT_LT(found->std, 0.2 * late_s);
  expect_inside(parameter(open, "young_modulus"), truth.young_pa);
  expect_inside(parameter(open, "poisson_ratio"), truth.poisson);
  EXPECT_GT(trusting.fit.chi2_per_dof, open.fit.chi2_per_dof + 0.03) << "of 1500 points: chi2 falls by 45 or more";
}

TEST(PushedBlockFit, FixedNuStaysAndDoesNotWidenYoungsModulus) {
  Recording recording = pushed_block_recording();
  const Inputs inputs = clouds_of({});
  const Identification open = fit(recording, coarse_block(), inputs, {});
  recording.model.poisson_fixed = 0.3;
  const Identification held = fit(recording, coarse_block(), inputs, {});
  EXPECT_EQ(parameter(held, "poisson_ratio").value, 0.3);
  EXPECT_EQ(parameter(held, "poisson_ratio").lower_95, 0.3);
  EXPECT_EQ(parameter(held, "poisson_ratio").upper_95, 0.3);
  EXPECT_LE(parameter(held, "young_modulus").std, 1.01 * parameter(open, "young_modulus").std);
  expect_inside(parameter(held, "young_modulus"), 2e4);
}

// A dent moves with its tool: what is linear in a shift of the contact holds for a tenth of the tool's radius, not for most of it.
TEST(ShiftedContact, IsFoundWhereItIsHoweverFarThatIs) {
  const Vec3 shift_m(-0.008, 0.004, 0);
  Recording truly = pushed_block_recording();
  for (Step& step : truly.pushes[0].steps) step.loads[0].contact_m += shift_m;
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 1500;
  truth.sigma_m = 3e-4;
  truly.model.poisson_fixed = truth.poisson;  // or E would follow a nu that these data hardly know
  const Inputs inputs = clouds_of(truth, truly);
  Recording stated = pushed_block_recording();
  stated.model.poisson_fixed = truth.poisson;
  for (Step& step : stated.pushes[0].steps) step.loads[0].contact_std_m = 0.006;
  const Identification known = fit(truly, coarse_block("linear"), inputs, {});
  const Identification found = fit(stated, coarse_block("linear"), inputs, {});
  ASSERT_EQ(found.termination, Termination::converged) << found.message;
  ASSERT_EQ(found.nuisances.size(), 2u);
  Vec3 found_m = Vec3::Zero();
  const auto across = tangents(stated.pushes[0].steps[0].loads[0].direction);
  for (std::size_t k = 0; k < 2; ++k) {
    found_m += found.nuisances[k].value * across[k];
    EXPECT_LT(found.nuisances[k].std, 0.002);
    EXPECT_NEAR(found.nuisances[k].value, shift_m.dot(across[k]), 4 * found.nuisances[k].std) << found.nuisances[k].name;
    EXPECT_LT(std::abs(found.nuisances[k].pull), 4);
  }
  // As good as told, but for what the place leaves open.
  for (Step& step : truly.pushes[0].steps) step.loads[0].contact_m += found_m - shift_m;
  const Identification told = fit(truly, coarse_block("linear"), inputs, {});
  EXPECT_NEAR(parameter(found, "young_modulus").value, parameter(told, "young_modulus").value, 0.05 * parameter(told, "young_modulus").std);
  EXPECT_NEAR(found.fit.chi2_per_dof, known.fit.chi2_per_dof, 0.01);
  EXPECT_GT(parameter(found, "young_modulus").std, parameter(told, "young_modulus").std);
  for (std::size_t i = 1; i < found.trace.size(); ++i) EXPECT_GE(found.trace[i].round, found.trace[i - 1].round);
}

PushedBlock with_displaced_clamp() {
  PushedBlock truth;
  truth.clamp.translation_m = Vec3(0.001, -0.002, 0.004);
  truth.clamp.rotation_rad = Vec3(0.02, 0.06, -0.03);
  return truth;
}

TEST(DisplacedClamp, HeldFixedItDoesNotFitAndThatIsSaid) {
  const Identification answer = fit(pushed_block_recording(), coarse_block(), clouds_of(with_displaced_clamp()), {});
  EXPECT_TRUE(says(answer, "model_does_not_fit")) << answer.fit.chi2_per_dof;
}

TEST(Readings, ThatContradictTheSurfaceAreSaidThoughItsPointsOutweighThem) {
  constexpr double sigma_m = 1e-4;
  Recording recording = pushed_block_recording();
  auto& steps = recording.pushes[0].steps;
  const Step like = steps.back();
  steps.clear();
  for (int k = 1; k <= 6; ++k) {
    steps.push_back(like);
    steps.back().loads[0].force_n = Vec3(0, 0, -0.02 * k);
  }
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 1000;
  const Inputs clouds = clouds_of(truth, recording);
  Unknowns unknowns;
  ForwardModel model(recording, coarse_block("linear"), unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(truth.young_pa);
  at(poisson) = truth.poisson;
  for (const double off : {0.5, 8.0}) {  // up and down in turn, in standard deviations
    Inputs inputs = clouds;
    for (std::size_t s = 0; s < inputs.size(); ++s)
      inputs[s].push_back(ToolTravel{"", model.predict(s, at, false).travel_m(0) + (s % 2 == 0 ? off : -off) * sigma_m, sigma_m});
    const Identification answer = fit(recording, coarse_block("linear"), inputs, {});
    EXPECT_LT(answer.fit.chi2_per_dof, 1.2) << "over all";
    EXPECT_EQ(says(answer, "model_does_not_fit"), off > 1) << off;
  }
}

TEST(DisplacedClamp, WithAPriorItFitsAndThePoseIsFound) {
  Recording recording = pushed_block_recording();
  recording.supports[0].pose_std_m = 0.005;
  recording.supports[0].pose_std_rad = 0.05;
  const PushedBlock truth = with_displaced_clamp();
  const Identification answer = fit(recording, coarse_block(), clouds_of(truth), {});
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  EXPECT_FALSE(says(answer, "model_does_not_fit")) << answer.fit.chi2_per_dof;
  EXPECT_FALSE(says(answer, "nuisance_beyond_prior"));
  expect_inside(parameter(answer, "young_modulus"), truth.young_pa);
  ASSERT_EQ(answer.nuisances.size(), 6u);
  for (int d = 0; d < 3; ++d) {
    const Nuisance& translation = answer.nuisances[static_cast<std::size_t>(d)];
    const Nuisance& rotation = answer.nuisances[static_cast<std::size_t>(d) + 3];
    EXPECT_NEAR(translation.value, truth.clamp.translation_m(d), 4 * translation.std) << translation.name;
    EXPECT_NEAR(rotation.value, truth.clamp.rotation_rad(d), 4 * rotation.std) << rotation.name;
    EXPECT_LT(translation.std, 1e-3);
  }
}

TEST(DisplacedClamp, FarBeyondItsPriorIsSaid) {
  Recording recording = pushed_block_recording();
  recording.supports[0].pose_std_m = 0.0005;
  recording.supports[0].pose_std_rad = 0.01;
  const Identification answer = fit(recording, coarse_block(), clouds_of(with_displaced_clamp()), {});
  // Once, whatever the number of nuisances.
  EXPECT_EQ(std::count_if(answer.verdicts.begin(), answer.verdicts.end(),
                          [](const Verdict& each) { return each.code == "nuisance_beyond_prior"; }),
            1);
}

TEST(FitOptionsCheck, EveryFieldOutOfItsRangeIsNamed) {
  const auto where = [](auto&& spoil) -> std::string {
    FitOptions options;
    spoil(options);
    try {
      check(options);
    } catch (const Error& error) {
      return error.where();
    }
    return "";
  };
  EXPECT_EQ(where([](FitOptions&) {}), "");
  EXPECT_EQ(where([](FitOptions& o) { o.max_iterations = 0; }), "FitOptions.max_iterations");
  EXPECT_EQ(where([](FitOptions& o) { o.tukey_cut = 1; }), "FitOptions.tukey_cut");
  EXPECT_EQ(where([](FitOptions& o) { o.tukey_cut = std::nan(""); }), "FitOptions.tukey_cut");
  EXPECT_EQ(where([](FitOptions& o) { o.young_start_pa = -1; }), "FitOptions.young_start_pa");
  EXPECT_EQ(where([](FitOptions& o) { o.poisson_start = 0.5; }), "FitOptions.poisson_start");
  EXPECT_EQ(where([](FitOptions& o) { o.threads = -1; }), "FitOptions.threads");
}

TEST(FitWithoutObservations, IsAnError) {
  EXPECT_THROW(fit(pushed_block_recording(), coarse_block(), Inputs(2), {}), Error);
}

}  // namespace
}  // namespace palpate::estimation::fit_test
