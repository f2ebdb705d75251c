// label: unit
// SPDX-License-Identifier: Apache-2.0
// Torques of a wrist sensor: the lever of a patch at an edge is that of half discs, a contact that is not where it was
// stated is found to about sigma over force and E is known better for it, and what is wrong with a torque is said and not believed.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/lab/random.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::torque_term_test {
namespace {

const Vec3 off_m(0.0032, -0.0024, 0);  // 4 mm beside the stated place
constexpr double sigma_nm = 2e-3;

/// With 2 to 5 N; the contact is known to 4 mm.
Recording glued_block(double contact_std_m = 0.004) {
  std::vector<Vec3> forces_n;
  for (double newton : {2.0, 3.0, 4.0, 5.0}) forces_n.emplace_back(0.2 * newton, 0, -newton);
  Recording recording = glued_block_recording(forces_n, 0.03, 0.02);
  for (Step& step : recording.pushes[0].steps) {
    step.loads[0].direction = -Vec3::UnitZ();
    step.loads[0].contact_std_m = contact_std_m;
  }
  return recording;
}

/// The block in a clamp at one end and pressed at the other: a contact further out asks for a stiffer material.
Recording cantilever() {
  Recording recording = glued_block();
  recording.supports = pushed_block_recording().supports;
  for (auto& step : recording.pushes[0].steps) step.loads[0].contact_m.x() = 0.042;
  return recording;
}
constexpr double rubber_pa = 8e5;

Recording pressed_beside(Recording recording) {
  for (auto& step : recording.pushes[0].steps) step.loads[0].contact_m += off_m;
  return recording;
}

/// What the sensor reads of forces that act `lever_m` beside the tip.
Inputs with_torques(Inputs inputs, const Recording& recording, const Vec3& lever_m, unsigned seed,
                    const Vec3& tare_nm = Vec3::Zero()) {
  lab::Random random(seed, 5);
  for (std::size_t s = 0; s < inputs.size(); ++s) {
    Wrench wrench;
    wrench.force_n = *recording.pushes[0].steps[s].loads[0].force_n;
    wrench.force_sigma_n = 0.05;
    wrench.torque_nm = lever_m.cross(wrench.force_n) + tare_nm + sigma_nm * random.normal3();
    wrench.torque_sigma_nm = sigma_nm;
    wrench.has_torque = true;
    inputs[s].push_back(wrench);
  }
  return inputs;
}

/// Clouds of a mesh with twice as many elements along every edge as the fit's.
Inputs clouds(unsigned seed, const Recording& real, double noise_m = 1e-3, int points = 300, double young_pa = 2e4) {
  PushedBlock truth;
  truth.young_pa = young_pa;
  truth.material = "linear";
  truth.points = points;
  truth.sigma_m = noise_m;
  truth.seed = seed;
  truth.finer = 3;
  Inputs inputs = clouds_of(truth, real);
  for (auto& step : inputs) {
    std::get<PointCloud>(step[0]).pose_std_m = 1e-3;
    std::get<PointCloud>(step[0]).pose_std_rad = 5e-3;
  }
  return inputs;
}

Identification fitted(const Recording& stated, const Inputs& inputs, bool checks = false) {
  FitOptions options;
  options.stresses = false;
  options.cross_checks = checks;
  return fit(stated, simulated(fem::to_quadratic(kuhn_block(6, 4, 3, block_size_m)), "linear"), inputs, options);
}

const Nuisance& nuisance(const Identification& answer, const std::string& name) {
  for (const auto& one : answer.nuisances)
    if (one.name == name) return one;
  throw std::runtime_error("no nuisance " + name);
}

/// The shift's two numbers as a vector.
Vec3 shift_m(const Identification& answer) {
  const auto across = tangents(-Vec3::UnitZ());
  return nuisance(answer, "contact_shift[down]_1").value * across[0] +
         nuisance(answer, "contact_shift[down]_2").value * across[1];
}

TEST(TorqueTerm, TheLeverOfAPatchIsItsMiddle) {
  Recording recording = glued_block();
  const double radius_m = recording.tools[0].radius_m;
  const SimulatedObject object = coarse_block("linear");
  const auto lever_m = [&](const Vec3& contact_m, const Vec3& moved_m) {
    for (auto& step : recording.pushes[0].steps) step.loads[0].contact_m = contact_m;
    Unknowns unknowns;
    ForwardModel model(recording, object, unknowns);
    VectorX at = unknowns.prior_mean();
    const auto across = tangents(-Vec3::UnitZ());
    for (int k = 0; k < unknowns.size(); ++k) {
      if (unknowns[k].name == "contact_shift[down]_1") at(k) = across[0].dot(moved_m), at(k + 1) = across[1].dot(moved_m);
    }
    return model.acting_force(0, 0, at)->lever_m;
  };
  EXPECT_LT(lever_m({0.03, 0.02, 0.03}, Vec3::Zero()).norm(), 2e-4);
  EXPECT_LT((lever_m({0.03, 0.02, 0.03}, off_m) - off_m).norm(), 3e-4);
  // At an edge the patch is two half discs, one on top and one on the side, which is straight below the edge.
  EXPECT_NEAR(lever_m({0.06, 0.02, 0.03}, Vec3::Zero()).x(), -0.5 * 4 * radius_m / (3 * EIGEN_PI), 1e-5);
  EXPECT_EQ(lever_m({0.06, 0.02, 0.03}, Vec3::Zero()).z(), 0);

  // A tip that met the object elsewhere than the contact was stated: the torque is about the tip.
  recording.pushes[0].steps[0].T_base_tip = Pose(Eigen::Translation3d(Vec3(0.03, 0.02, 0.026) + off_m));
  EXPECT_LT((lever_m({0.03, 0.02, 0.03}, Vec3::Zero()) + off_m).norm(), 3e-4);
}

TEST(TorqueTerm, AContactBesideTheStatedPlaceIsFoundAndEKnownBetter) {
  constexpr int seeds = 6;
  const double per_axis_m = sigma_nm / std::sqrt(2 * 2 + 3 * 3 + 4 * 4 + 5 * 5.0);
  const Recording stated = cantilever(), real = pressed_beside(stated);
  struct Tally {
    int held = 0;
    double shift_std_m = 0, young_std = 0, error2 = 0;
    void add(const Identification& answer) {
      const Parameter& young = parameter(answer, "young_modulus");
      held += young.lower_95 < rubber_pa && rubber_pa < young.upper_95;
      shift_std_m += nuisance(answer, "contact_shift[down]_1").std / seeds;
      young_std += young.std / rubber_pa / seeds;
      error2 += std::pow(young.value / rubber_pa - 1, 2) / seeds;
    }
    void print(const char* what) const {
      std::printf("%s: contact known to %.2f mm, E to %.2f %%, its rms error %.2f %%, %d of %d held\n", what,
                  1e3 * shift_std_m, 100 * young_std, 100 * std::sqrt(error2), held, seeds);
    }
  } all_with, all_without;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    const Inputs seen = clouds(seed, real, 1e-3, 150, rubber_pa);
    const Identification without = fitted(stated, seen), with = fitted(stated, with_torques(seen, stated, off_m, seed));
    for (const char* name : {"contact_shift[down]_1", "contact_shift[down]_2"}) {
      EXPECT_LT(nuisance(with, name).std, 1.05 * per_axis_m);
      EXPECT_LT(nuisance(with, name).std, nuisance(without, name).std);
    }
    EXPECT_LT((shift_m(with) - off_m).norm(), 5 * per_axis_m);
    EXPECT_LT(with.fit.chi2_per_dof, 1.2);
    all_with.add(with);
    all_without.add(without);
  }
  all_with.print("with torques");
  all_without.print("without torques");
  EXPECT_LT(all_with.young_std, 0.8 * all_without.young_std);
  EXPECT_GE(all_with.held, seeds - 1);
  EXPECT_GE(all_without.held, seeds - 1);
}

TEST(TorqueTerm, ATareIsToldFromAMovedContactByItsSteps) {
  Recording stated = glued_block();
  stated.pushes[0].torque_tare_std_nm = 0.02;
  const Vec3 tare_nm(0.02, -0.015, 0.01);
  const Identification answer = fitted(stated, with_torques(clouds(3, pressed_beside(stated)), stated, off_m, 3, tare_nm));
  for (const auto& [axis, value] : {std::pair{"x", tare_nm.x()}, {"y", tare_nm.y()}}) {
    const Nuisance& tare = nuisance(answer, std::string("torque_tare[down]_") + axis);
    EXPECT_NEAR(tare.value, value, 4 * tare.std);
    EXPECT_LT(tare.std, 0.005);
  }
  EXPECT_LT((shift_m(answer) - off_m).norm(), 0.003);
  EXPECT_LT(answer.fit.chi2_per_dof, 1.15);
}

/// Arm and camera that do not agree where the tip is: torques say less, and no less than nothing.
TEST(TorqueTerm, ATipOfUncertainPlaceLeavesTheContactUncertain) {
  Recording stated = cantilever();
  stated.pushes[0].tip_std_m = 0.003;
  // The arm believes to have met the object at the stated place, and sees no lever.
  const Inputs seen = with_torques(clouds(4, pressed_beside(stated), 1e-3, 150, rubber_pa), stated, Vec3::Zero(), 4);
  const Identification answer = fitted(stated, seen);
  for (int k : {1, 2}) {
    const Nuisance& shift = nuisance(answer, "contact_shift[down]_" + std::to_string(k));
    EXPECT_GT(shift.std, sigma_nm / 5) << shift.name;
    EXPECT_NEAR(shift.value, tangents(-Vec3::UnitZ())[std::size_t(k - 1)].dot(off_m), 3.5 * shift.std) << shift.name;
  }
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_LT(young.lower_95, rubber_pa);
  EXPECT_GT(young.upper_95, rubber_pa);
  const auto of_tip = [](const BudgetEntry& entry) { return entry.input == "tip_offset"; };
  EXPECT_TRUE(std::any_of(answer.budget.begin(), answer.budget.end(), of_tip));
}

TEST(TorqueTerm, AWrongTorqueIsSaid) {
  const Recording stated = glued_block();
  const Identification answer = fitted(stated, with_torques(clouds(5, stated), stated, Vec3(0.03, 0, 0), 5));
  bool said = false;
  for (const char* code : {"nuisance_beyond_prior", "model_does_not_fit", "not_converged"})
    said = said || says(answer, code);
  EXPECT_TRUE(said);
  EXPECT_GT(std::abs(shift_m(answer).x() / 0.004), 3) << answer.fit.chi2_per_dof;
}

/// Stated as exactly known, a contact takes nothing from a torque; that the two do not agree is said.
TEST(TorqueTerm, OfAContactStatedAsExactlyKnownItIsACheck) {
  const Recording stated = glued_block(0);
  const Recording real = pressed_beside(stated);
  const Inputs seen = clouds(6, real, 2e-3, 60);
  const Identification without = fitted(stated, seen, true);
  const Identification with = fitted(stated, with_torques(seen, stated, off_m, 6), true);
  EXPECT_EQ(parameter(with, "young_modulus").value, parameter(without, "young_modulus").value);
  EXPECT_EQ(with.fit.chi2_per_dof, without.fit.chi2_per_dof);
  EXPECT_FALSE(says(without, "contact_elsewhere"));
  EXPECT_TRUE(says(with, "contact_elsewhere"));
  const Inputs fine = clouds(7, stated, 2e-3, 60);
  const Identification right = fitted(stated, with_torques(fine, stated, Vec3::Zero(), 7), true);
  EXPECT_FALSE(says(right, "contact_elsewhere"));
  // A tare that the recording states is no moved contact.
  Recording tared = stated;
  tared.pushes[0].torque_tare_std_nm = 0.02;
  const Vec3 tare_nm(0.02, -0.015, 0);
  const Identification cleared = fitted(tared, with_torques(fine, stated, Vec3::Zero(), 7, tare_nm), true);
  EXPECT_FALSE(says(cleared, "contact_elsewhere"));
  EXPECT_FALSE(says(cleared, "contact_slipped"));
}

TEST(TorqueTerm, WithoutItsDeviationItIsRefused) {
  const Recording stated = glued_block();
  Inputs seen = with_torques(clouds(1, stated, 2e-3, 20), stated, off_m, 1);
  std::get<Wrench>(seen[1][1]).torque_sigma_nm = std::nan("");
  EXPECT_THROW(fitted(stated, seen), Error);
  Inputs alone = with_torques(Inputs(4), stated, off_m, 1);
  EXPECT_THROW(fitted(stated, alone), Error) << "torques alone say nothing of the object";
}

}  // namespace
}  // namespace palpate::estimation::torque_term_test
