// label: unit
// SPDX-License-Identifier: Apache-2.0
// Things that a recording states as exactly known and that are not so: each is named where it is due, with about its size, and
// nothing is said of a recording without fault.
#include "palpate/estimation/doubts.hpp"

#include <gtest/gtest.h>

#include "palpate/core/error.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::doubts_test {
namespace {

Recording glued_block() {
  std::vector<Vec3> forces_n;
  for (double newton : {1.5, 3.0, 4.5, 6.0}) forces_n.emplace_back(0.3 * newton, 0, -newton);
  return glued_block_recording(forces_n, 0.03, 0.02);
}

Identification fitted(const Recording& stated, const Recording& real, unsigned seed = 3) {
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 1500;
  truth.sigma_m = 2e-4;
  truth.seed = seed;
  FitOptions options;
  options.stresses = false;
  SimulatedObject object = simulated(fem::to_quadratic(kuhn_block(6, 4, 3, block_size_m)), "linear");
  Inputs inputs = clouds_of(truth, real);
  for (auto& step : inputs) {  // a smooth foot is free to drift
    std::get<PointCloud>(step[0]).pose_std_m = 1e-3;
    std::get<PointCloud>(step[0]).pose_std_rad = 5e-3;
  }
  return fit(stated, object, inputs, options);
}

std::vector<std::string> doubts_in(const Identification& answer) {
  std::vector<std::string> found;
  for (const auto& verdict : answer.verdicts) {
    for (const char* code : {"contact_slipped", "contact_elsewhere", "tool_radius_doubtful", "boundary_suspected"})
      if (verdict.code == code) found.push_back(verdict.code + ": " + verdict.message);
  }
  return found;
}

/// The number of millimetres after `words` in the only doubt of this code.
double millimetres_after(const Identification& answer, const std::string& code, const std::string& words) {
  const auto found = doubts_in(answer);
  EXPECT_EQ(found.size(), 1u);
  if (found.empty()) return 0;
  EXPECT_EQ(found.front().rfind(code, 0), 0u) << found.front();
  const auto at = found.front().find(words);
  EXPECT_NE(at, std::string::npos) << found.front();
  return at == std::string::npos ? 0 : std::stod(found.front().substr(at + words.size()));
}

TEST(Doubts, NothingIsSaidOfARecordingWithoutFault) {
  for (unsigned seed : {1u, 2u, 3u}) {
    const auto found = doubts_in(fitted(glued_block(), glued_block(), seed));
    EXPECT_TRUE(found.empty()) << found.front();
  }
}

TEST(Doubts, AContactThatIsElsewhere) {
  Recording real = glued_block();
  for (auto& step : real.pushes[0].steps) step.loads[0].contact_m += Vec3(0.003, -0.002, 0);
  const Identification answer = fitted(glued_block(), real);
  EXPECT_NEAR(millimetres_after(answer, "contact_elsewhere", "ask for a contact "), 3.6, 1.4);  // the derivative's answer
}

TEST(Doubts, APatchThatIsWider) {
  Recording real = glued_block();
  real.tools[0].radius_m *= 1.3;
  const Identification answer = fitted(glued_block(), real);
  EXPECT_NEAR(millimetres_after(answer, "tool_radius_doubtful", "whose radius is "), 3.6, 1.6);
}

TEST(Doubts, AFootThatIsNotGlued) {
  Recording real = glued_block();
  real.supports[0].contact = ContactLaw::frictionless;
  for (auto& step : real.pushes[0].steps) step.loads[0].force_n->x() = 0;
  Recording stated = glued_block();
  for (auto& step : stated.pushes[0].steps) step.loads[0].force_n->x() = 0;
  const Identification answer = fitted(stated, real);
  EXPECT_GT(millimetres_after(answer, "boundary_suspected", "moves by "), 0.1);
}

// Of two clouds in a step one stands 1.4 mm off and says so: what is asked beside it must not depend on which comes first.
TEST(Doubts, OfTwoCamerasEitherMayBeTheExactOne) {
  std::vector<Identification> answers;
  for (const bool exact_first : {true, false}) {
    PushedBlock truth;
    truth.material = "linear";
    truth.points = 700;
    truth.sigma_m = 2e-4;
    Inputs inputs = clouds_of(truth, glued_block());
    truth.seed = 8;
    const Inputs others = clouds_of(truth, glued_block());
    for (std::size_t s = 0; s < inputs.size(); ++s) {
      PointCloud off = std::get<PointCloud>(others[s][0]);
      off.points_m.rowwise() += Eigen::RowVector3d(1e-3, -0.7e-3, 0.7e-3);
      off.pose_std_m = 1e-3;
      inputs[s].insert(exact_first ? inputs[s].end() : inputs[s].begin(), off);
    }
    FitOptions options;
    options.stresses = false;
    answers.push_back(fit(glued_block(), simulated(fem::to_quadratic(kuhn_block(6, 4, 3, block_size_m)), "linear"), inputs, options));
    const auto found = doubts_in(answers.back());
    EXPECT_TRUE(found.empty()) << found.front();
  }
  const auto percent = [](const Identification& answer, const std::string& input) {
    for (const auto& entry : answer.budget_if)
      if (entry.input == input) return entry.young_modulus_percent;
    return 0.0;
  };
  for (const char* input : {"contact_shift", "tool_radius"}) {
    const double one = percent(answers[0], input), other = percent(answers[1], input);
    EXPECT_GT(one, 0) << input;
    EXPECT_NEAR(one, other, 0.05 * other) << input;
  }
}

TEST(Doubts, AContactThatSlipsWhereItIsStatedExactly) {
  Recording real = glued_block();
  for (std::size_t s : {2u, 3u}) real.pushes[0].steps[s].loads[0].contact_m += Vec3(0.004, 0, 0);
  const auto found = doubts_in(fitted(glued_block(), real));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found.front().rfind("contact_slipped", 0), 0u) << found.front();
  EXPECT_NE(found.front().find("step 2"), std::string::npos) << found.front();
}

/// What the residuals ask for beside the fit of a block that is linear.
Doubts asked(const Recording& stated, const Inputs& inputs, double nu, bool known, bool sites = true) {
  Unknowns unknowns;
  SimulatedObject object = simulated(fem::to_quadratic(kuhn_block(6, 4, 3, block_size_m)), "linear");
  if (!sites) object.region.assign(static_cast<std::size_t>(object.mesh.tetrahedra.rows()), 0), object.region_names = {"all"};
  ForwardModel model(stated, object, unknowns);
  Objective objective(model, inputs, unknowns);
  VectorX start = unknowns.prior_mean();
  start(log_young) = std::log(2e4);
  start(poisson) = nu;
  unknowns[poisson].fixed = known;
  Optimum at = optimise(objective, start, {}, {}, {});
  EXPECT_EQ(at.termination, Termination::converged) << at.message;
  SolveCount took;
  return look_for_doubts(stated, objective, at, inputs, {}, 1, 1, {}, took);
}

// At a bound that the data push it out of nu is as good as known: it must not make room for what is wrong.
TEST(Doubts, ANuThatIsHeldAtItsBoundDoesNotFollow) {
  Recording real = glued_block(), stated = real;
  real.tools[0].radius_m *= 1.3;
  stated.model.poisson_upper = 0.25;
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 800;
  truth.sigma_m = 2e-4;
  const Inputs inputs = clouds_of(truth, real);
  const Doubts held = asked(stated, inputs, 0.25, false), known = asked(stated, inputs, 0.25, true);
  ASSERT_FALSE(held.all.empty());
  ASSERT_EQ(held.all.size(), known.all.size());
  for (std::size_t k = 0; k < held.all.size(); ++k) {
    EXPECT_EQ(held.all[k].about, known.all[k].about);
    EXPECT_EQ(held.all[k].poisson, 0);
    EXPECT_NEAR(held.all[k].chi2, known.all[k].chi2, 1e-2 * known.all[k].chi2 + 0.01) << k;
    EXPECT_NEAR(held.all[k].log_young(0), known.all[k].log_young(0), 1e-2 * std::abs(known.all[k].log_young(0)) + 1e-4) << k;
  }
  ASSERT_EQ(held.unrecorded_slip.has_value(), known.unrecorded_slip.has_value());
  if (held.unrecorded_slip) {
    EXPECT_NEAR(held.unrecorded_slip->chi2, known.unrecorded_slip->chi2, 1e-2 * known.unrecorded_slip->chi2);
  }
}

// Where places differ each has its E in what a doubt would change.
TEST(Doubts, OfPlacesThatDifferEachIsToldWhatWouldChangeThere) {
  Recording recording = glued_block_recording({Vec3(0, 0, -1.5), Vec3(0, 0, -3)}, 0.015, 0.02);
  recording.pushes.push_back(glued_block_recording({Vec3(0, 0, -1.5), Vec3(0, 0, -3)}, 0.045, 0.02).pushes[0]);
  recording.pushes[1].name = "free";
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 800;
  truth.sigma_m = 2e-4;
  truth.free_half = 1.5;
  Recording real = recording;
  for (auto& step : real.pushes[1].steps) step.loads[0].contact_m += Vec3(0, 0.003, 0);
  const Doubts found = asked(recording, clouds_of(truth, real), 0.3, false);
  ASSERT_TRUE(found.sites);
  ASSERT_LT(found.sites->p_value, rare);
  ASSERT_FALSE(found.all.empty());
  const Doubt& contact = found.all.front();
  ASSERT_EQ(contact.log_young.size(), 2);
  EXPECT_GT(std::abs(contact.log_young(1) - contact.log_young(0)), 0.1 * std::abs(contact.log_young(0)));
}

/// What a doubt asks for, given as a prior, is found by the fit.
TEST(Doubts, AsNuisancesTheyAreFound) {
  Recording real = glued_block(), stated = real;
  real.tools[0].radius_m *= 1.15;
  stated.tools[0].radius_std_m = 2e-3;
  const Identification answer = fitted(stated, real);
  EXPECT_TRUE(doubts_in(answer).empty());
  bool found = false;
  for (const auto& nuisance : answer.nuisances) {
    if (nuisance.name != "tool_radius[finger]") continue;
    found = true;
    EXPECT_NEAR(nuisance.value, 0.15 * 0.012, 6e-4);
  }
  EXPECT_TRUE(found);
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_NEAR(young.value, 2e4, 0.01 * 2e4);
}

TEST(Doubts, NodesWithoutARimCannotSpread) {
  Recording recording = glued_block();
  recording.supports[0].kind = SupportKind::box;
  recording.supports[0].select = NodeSelection::box;
  recording.supports[0].box_min_m = Vec3::Constant(-1e-3);
  recording.supports[0].box_max_m = Vec3(0.061, 0.041, 0.016);
  recording.supports[0].spread_std_m = 1e-3;
  Unknowns unknowns;
  EXPECT_THROW(ForwardModel(recording, coarse_block(), unknowns), Error);
}

}  // namespace
}  // namespace palpate::estimation::doubts_test
