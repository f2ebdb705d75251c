// label: unit
// SPDX-License-Identifier: Apache-2.0
// A tool that slides aside in the middle of a push and has to come deeper before it presses again: found where nobody says so, and
// E is right with its contact and zero as unknowns of their own. Clouds and travels are of a finer mesh, by our solver or CalculiX.
#include "palpate/estimation/slips.hpp"

#include <gtest/gtest.h>

#include "palpate/estimation/deep_loads.hpp"
#include "fem/calculix.hpp"
#include "palpate/fem/boundary.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::slips_test {
namespace {

constexpr std::size_t slips_at = 3;
constexpr double travel_sigma_m = 5e-5, young_pa = 2e4;

Recording stated() {
  std::vector<Vec3> forces_n;
  for (double newton : {1.0, 2.0, 3.0, 4.0, 5.0, 6.0}) forces_n.emplace_back(0, 0, -newton);
  Recording recording = glued_block_recording(forces_n, 0.028, 0.02);
  recording.pushes[0].travel_offset_std_m = 2e-4;
  return recording;
}

struct Truth {
  std::string material = "linear";
  double free_half = 1;  ///< stiffness of x > 30 mm over that of the rest
  double read_sigma_m = travel_sigma_m, zero_std_m = 2e-4;  ///< of a travel
};

struct Slid {
  Recording recording;
  Inputs inputs;
};

/// @param aside_m  and deeper from `slips_at` on; both zero: no slip
Slid slid(unsigned seed, double aside_m, double deeper_m, const Recording& as_stated = stated(), const Truth& stuff = {}) {
  Recording real = as_stated;
  for (std::size_t s = slips_at; s < real.pushes[0].steps.size(); ++s) real.pushes[0].steps[s].loads[0].contact_m.x() += aside_m;
  PushedBlock truth;
  truth.material = stuff.material;
  truth.free_half = stuff.free_half;
  truth.points = 800;
  truth.sigma_m = 3e-4;
  truth.seed = seed;
  Slid out{as_stated, clouds_of(truth, real)};
  Unknowns unknowns;
  SimulatedObject object = simulated(fem::to_quadratic(kuhn_block(8, 6, 4, block_size_m)), stuff.material);
  if (stuff.free_half != 1) put_two_halves(object);
  ForwardModel model(real, object, unknowns);
  VectorX at = unknowns.prior_mean();
  if (stuff.free_half != 1) at(first_ratio) = std::log(stuff.free_half);
  at(log_young) = std::log(young_pa);
  at(poisson) = truth.poisson;
  std::mt19937 random(seed + 100);
  std::normal_distribution<double> normal;
  const double zero_m = stuff.zero_std_m * normal(random);
  for (std::size_t s = 0; s < out.inputs.size(); ++s) {
    const StepIndex of = model.index(s);
    ToolTravel travel;
    travel.tool = "finger";
    travel.sigma_m = stuff.read_sigma_m;
    travel.travel_m = model.predict(s, at, false).travel_m(0) + zero_m + (of.step >= slips_at ? deeper_m : 0) + stuff.read_sigma_m * normal(random);
    out.inputs[s].emplace_back(travel);
    out.recording.pushes[of.push].steps[of.step].observations.emplace_back(travel);
  }
  return out;
}

// The same of what CalculiX makes of the two places.
Slid slid_by_calculix(unsigned seed, double aside_m, double deeper_m) {
  Slid out{stated(), {}};
  std::vector<Step>& steps = out.recording.pushes[0].steps;
  const double radius_m = out.recording.tools[0].radius_m;
  const TetMesh mesh = fem::to_quadratic(kuhn_block(8, 6, 4, block_size_m));
  const Triangles faces = fem::boundary_triangles(mesh);
  std::vector<Index> held;
  for (Index n = 0; n < mesh.nodes_m.rows(); ++n)
    if (mesh.nodes_m(n, 2) < 1e-9) held.push_back(n);
  struct PerNewton {
    VectorX moved_m;
    double travel_m = 0;
  };
  const auto pressed_at = [&](const Vec3& contact_m) {
    const VectorX load = -fem::spread_over_patch(mesh, contact_m, radius_m).col(2);
    PerNewton all{fem::calculix_displacements(mesh, held, load, false, young_pa, 0.3)};
    all.travel_m = load.dot(all.moved_m);
    return all;
  };
  const Vec3 stated_m = steps[0].loads[0].contact_m;
  const PerNewton before = pressed_at(stated_m), after = pressed_at(stated_m + aside_m * Vec3::UnitX());
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::uniform_int_distribution<Index> pick(0, faces.rows() - 1);
  for (std::size_t s = 0; s < steps.size(); ++s) {
    const PerNewton& now = s < slips_at ? before : after;
    const double force_n = steps[s].loads[0].force_n->norm();
    const Points nodes_m = mesh.nodes_m + force_n * Eigen::Map<const Points>(now.moved_m.data(), mesh.nodes_m.rows(), 3);
    PointCloud cloud;
    cloud.points_m.resize(800, 3);
    cloud.sigma_m = VectorX::Constant(1, 3e-4);
    for (Index i = 0; i < cloud.points_m.rows(); ++i) {
      const Index t = pick(random);
      const double u = std::sqrt(uniform(random)), v = uniform(random);
      cloud.points_m.row(i) = (1 - u) * nodes_m.row(faces(t, 0)) + u * (1 - v) * nodes_m.row(faces(t, 1)) + u * v * nodes_m.row(faces(t, 2)) +
                              3e-4 * Eigen::RowVector3d(normal(random), normal(random), normal(random));
    }
    ToolTravel travel;
    travel.tool = "finger";
    travel.sigma_m = travel_sigma_m;
    travel.travel_m = force_n * now.travel_m + (s < slips_at ? 0 : deeper_m) + travel_sigma_m * normal(random);
    steps[s].observations.emplace_back(travel);
    out.inputs.push_back({cloud, travel});
  }
  return out;
}

Identification fitted(const Recording& recording, const Inputs& inputs, bool checks = false) {
  FitOptions options;
  options.cross_checks = checks, options.stresses = false;
  options.find_slips = true;
  return fit(recording, simulated(fem::to_quadratic(kuhn_block(6, 4, 3, block_size_m)), "linear"), inputs, options);
}

const Nuisance& nuisance(const Identification& answer, const std::string& name) {
  for (const Nuisance& one : answer.nuisances)
    if (one.name == name) return one;
  throw std::runtime_error("no nuisance " + name);
}

TEST(Slips, AreFoundAndThenFittedAlong) {
  Slid push = slid(5, 0.004, 0.0015);
  const Identification as_stated = fitted(push.recording, push.inputs);
  ASSERT_TRUE(as_stated.slip);
  EXPECT_EQ(as_stated.slip->push, 0u);
  EXPECT_EQ(as_stated.slip->step, slips_at);
  EXPECT_NEAR(as_stated.slip->deeper_m, 0.0015, 3e-4);
  EXPECT_NEAR(as_stated.slip->across_m, 0.004, 0.002);  // the derivative's answer
  EXPECT_TRUE(says(as_stated, "contact_slipped"));
  const Parameter& wrong = parameter(as_stated, "young_modulus");
  EXPECT_GT(std::abs(wrong.value - young_pa), 4 * wrong.std);  // else this proves nothing

  int fits = 0;
  const Identification answer = fit_with_slips(push.recording, [&](const Identification*) {
    ++fits;
    return fitted(push.recording, push.inputs);
  });
  EXPECT_EQ(fits, 2);
  EXPECT_FALSE(answer.slip);
  EXPECT_TRUE(push.recording.pushes[0].steps[slips_at].slipped);
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_NEAR(young.value, young_pa, 2.5 * young.std);
  EXPECT_LT(young.std, 0.03 * young_pa);  // all steps are of use
  const Nuisance &before = nuisance(answer, "travel_zero[down]"), &after = nuisance(answer, "travel_zero[down, slipped]");
  EXPECT_NEAR(after.value - before.value, 0.0015, 2.5 * std::hypot(before.std, after.std));
  const Nuisance &x = nuisance(answer, "contact_shift[down, slipped]_1"), &y = nuisance(answer, "contact_shift[down, slipped]_2");
  EXPECT_NEAR(std::hypot(x.value, y.value), 0.004, 0.001);
  const auto said = std::count_if(answer.verdicts.begin(), answer.verdicts.end(), [](const Verdict& v) { return v.code == "contact_slipped"; });
  ASSERT_EQ(said, 1);
  EXPECT_NE(answer.verdicts.front().message.find("step 3 of push 'down'"), std::string::npos) << answer.verdicts.front().message;
}

TEST(Slips, ThatTheRecordingTellsNeedNotBeFound) {
  Slid push = slid(5, 0.004, 0.0015);
  push.recording.pushes[0].steps[slips_at].slipped = true;
  free_contacts_after_slips(push.recording);
  const Identification answer = fitted(push.recording, push.inputs);
  EXPECT_FALSE(answer.slip);
  EXPECT_FALSE(says(answer, "contact_slipped"));
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_NEAR(young.value, young_pa, 2.5 * young.std);
}

TEST(Slips, OfATruthByCalculiX) {
  if (!fem::calculix_is_there()) GTEST_SKIP() << "CalculiX (ccx) is not installed";
  Slid push = slid_by_calculix(4, 0.004, 0.0015);
  const Identification as_stated = fitted(push.recording, push.inputs);
  ASSERT_TRUE(as_stated.slip);
  EXPECT_EQ(as_stated.slip->step, slips_at);
  const Parameter& wrong = parameter(as_stated, "young_modulus");
  EXPECT_GT(std::abs(wrong.value - young_pa), 4 * wrong.std);
  const Identification answer = fit_with_slips(push.recording, [&](const Identification*) { return fitted(push.recording, push.inputs); });
  const Parameter &young = parameter(answer, "young_modulus"), &poisson = parameter(answer, "poisson_ratio");
  EXPECT_NEAR(poisson.value, 0.3, 2.5 * poisson.std);
  EXPECT_NEAR(nuisance(answer, "travel_zero[down, slipped]").value - nuisance(answer, "travel_zero[down]").value, 0.0015, 3e-4);
  // What the fit's own mesh does to E (2 %, not corrected here) it does with and without a slip.
  const Slid none = slid_by_calculix(4, 0, 0);
  const Identification without = fitted(none.recording, none.inputs);
  EXPECT_FALSE(without.slip);
  const Parameter& unslipped = parameter(without, "young_modulus");
  std::printf("by CalculiX, 20 kPa: %.0f +- %.0f Pa with a slip that is not fitted, %.0f +- %.0f with it, %.0f +- %.0f where there is none\n",
              wrong.value, wrong.std, young.value, young.std, unslipped.value, unslipped.std);
  EXPECT_NEAR(young.value, unslipped.value, 2.5 * std::hypot(young.std, unslipped.std));
  EXPECT_NEAR(young.value, young_pa, 0.03 * young_pa);
}

TEST(Slips, ATravelAloneTellsOne) {
  Slid push = slid(6, 0, 0.001);
  const Identification answer = fitted(push.recording, push.inputs);
  ASSERT_TRUE(answer.slip);
  EXPECT_EQ(answer.slip->step, slips_at);
  EXPECT_NEAR(answer.slip->deeper_m, 0.001, 2e-4);
}

TEST(Slips, AreNotInventedWhereThereAreNone) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const Slid push = slid(seed, 0, 0);
    const Identification answer = fitted(push.recording, push.inputs);
    EXPECT_FALSE(answer.slip) << "seed " << seed << ": step " << answer.slip->step << ", p " << answer.slip->p_value;
  }
}

// A zero that is stated as exact has no prior in the fit: none may be taken off what its steps say of it.
TEST(Slips, AreToldAlikeWhereTheZeroOfTheTravelIsExact) {
  Recording exact = stated();
  exact.pushes[0].travel_offset_std_m = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Slid push = slid(seed, 0, 0, exact, {"linear", 1, 4.6e-4, 0});
    const Identification answer = fitted(push.recording, push.inputs, true);
    EXPECT_FALSE(answer.slip) << "seed " << seed << ": step " << answer.slip->step << ", chi2 " << answer.slip->chi2;
    const Slid deeper = slid(seed, 0, 0.003, exact, {"linear", 1, 6e-4, 0});
    EXPECT_TRUE(fitted(deeper.recording, deeper.inputs, true).slip) << "seed " << seed;
  }
}

// What goes on with the load is no slip: a law that does not fit, here that of small strains under up to a half of E.
TEST(Slips, AreNotInventedForAWrongLaw) {
  for (const double step : {0.04, 0.06, 0.08}) {
    Recording deep = stated();
    for (std::size_t s = 0; s < deep.pushes[0].steps.size(); ++s)
      deep.pushes[0].steps[s].loads[0].force_n = Vec3(0, 0, -step * static_cast<double>(s + 1) * young_pa * EIGEN_PI * 0.012 * 0.012);
    const Slid push = slid(1, 0, 0, deep, {"neo_hookean", 1});
    const Identification answer = fitted(push.recording, push.inputs);
    EXPECT_FALSE(answer.slip) << step << " of E a step: step " << answer.slip->step << ", chi2 " << answer.slip->chi2;
  }
}

// Nor is an object that is stiffer at the one place than at the other: with a factor of two and more slips would explain a part of it.
TEST(Slips, AreNotInventedForAnObjectOfTwoStiffnesses) {
  Recording two = stated();
  two.pushes.push_back(two.pushes[0]);
  two.pushes[0].name = "left", two.pushes[1].name = "right";
  for (Step& step : two.pushes[0].steps) step.loads[0].contact_m.x() = 0.014;
  for (Step& step : two.pushes[1].steps) step.loads[0].contact_m.x() = 0.046;
  for (const double ratio : {1.3, 2.0, 4.0}) {
    const Slid push = slid(2, 0, 0, two, {"linear", ratio});
    const Identification answer = fitted(push.recording, push.inputs);
    EXPECT_FALSE(answer.slip) << "ratio " << ratio << ": push " << answer.slip->push << ", step " << answer.slip->step << ", chi2 " << answer.slip->chi2;
    EXPECT_TRUE(says(answer, "not_homogeneous"));
  }
}

TEST(Slips, ARefitWithoutAnAnswerChangesNothing) {
  Recording recording = stated();
  Identification first;
  first.termination = Termination::converged;
  first.parameters = {Parameter{}};
  first.slip = Slip{0, 2, 1e-3, 1e-3, 30, 1e-6};
  const Identification answer = fit_with_slips(recording, [&](const Identification* before) {
    if (before == nullptr) return first;
    EXPECT_TRUE(recording.pushes[0].steps[2].slipped);
    return Identification{};
  });
  EXPECT_TRUE(answer.slip);
  EXPECT_EQ(answer.termination, Termination::converged);
  EXPECT_FALSE(recording.pushes[0].steps[2].slipped);
  EXPECT_EQ(recording.pushes[0].steps[2].loads[0].contact_std_m, 0);
}

TEST(Slips, EveryStretchHasItsName) {
  Recording recording = stated();
  Push& push = recording.pushes[0];
  push.steps[2].slipped = push.steps[4].slipped = true;
  EXPECT_EQ(stretch_of(push, 1), "[down]");
  EXPECT_EQ(stretch_of(push, 2), "[down, slipped]");
  EXPECT_EQ(stretch_of(push, 3), "[down, slipped]");
  EXPECT_EQ(stretch_of(push, 5), "[down, slipped 2 times]");
  push.steps[3].loads[0].contact_std_m = 0.02;
  free_contacts_after_slips(recording);
  EXPECT_EQ(push.steps[1].loads[0].contact_std_m, 0);
  EXPECT_EQ(push.steps[2].loads[0].contact_std_m, 0.006);  // half the finger's radius
  EXPECT_EQ(push.steps[3].loads[0].contact_std_m, 0.02);   // what is stated is wider
  Unknowns unknowns;
  const ForwardModel model(recording, coarse_block(), unknowns);
  EXPECT_EQ(unknowns.named({"contact_shift[down]_1"}).size(), 0u);
  EXPECT_EQ(unknowns.named({"contact_shift[down, slipped]_1", "contact_shift[down, slipped 2 times]_2"}).size(), 2u);
}

// A first answer that a slip spoilt must not take in loads that the right one leaves out.
TEST(Slips, NoHigherLoadsAreTakenThanBefore) {
  Recording recording = stated();
  for (Step& step : recording.pushes[0].steps) step.loads[0].force_n = Vec3(0, 0, -0.1 * young_pa * EIGEN_PI * 0.012 * 0.012);
  for (std::size_t s = 3; s < 6; ++s) recording.pushes[0].steps[s].loads[0].force_n->z() *= 6;
  FitOptions options;
  options.young_start_pa = 10 * young_pa;
  StepCounts fitted_steps{3};
  const Identification answer = fit_within_pressure(recording, coarse_block("neo_hookean"), Inputs(6), options, [&](const StepCounts& steps) {
    EXPECT_EQ(steps, StepCounts{3});
    Identification found;
    found.termination = Termination::converged;
    found.parameters = {{"young_modulus", "", "Pa", 10 * young_pa, 0, 0, 0, true}};
    return found;
  }, &fitted_steps);
  EXPECT_EQ(fitted_steps, StepCounts{3});
  EXPECT_TRUE(says(answer, "deep_loads_left_out"));
}

}  // namespace
}  // namespace palpate::estimation::slips_test
