// label: oracle
// SPDX-License-Identifier: Apache-2.0
// What the budget says of inputs that are stated as exact, against fits of the same data with inputs that are off by that much,
// and against closed forms.
#include "palpate/estimation/exact_inputs.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "palpate/estimation/load_columns.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::exact_inputs_test {
namespace {

constexpr double noise_m = 3e-4;

/// Pressed beside its middle.
Recording glued_block() { return glued_block_recording({Vec3(0, 0, -0.75), Vec3(0, 0, -1.5)}, 0.036, 0.022); }

SimulatedObject object() { return simulated(fem::to_quadratic(kuhn_block(9, 6, 4, block_size_m)), "linear"); }

Inputs seen_of(const Recording& real) {
  PushedBlock truth;
  truth.material = "linear";
  truth.points = 1500;
  truth.sigma_m = noise_m;
  return clouds_of(truth, real);
}

Identification fitted(const Recording& stated, const Inputs& inputs, bool checks = false) {
  FitOptions options;
  options.stresses = false;
  options.cross_checks = checks;
  return fit(stated, object(), inputs, options);
}

struct Shift {
  double young_percent = 0, poisson = 0;
};

/// Half of what the answer changes by between an input that is off one way and the other.
Shift between(const Identification& ahead, const Identification& behind) {
  const auto change = [&](const char* name) { return parameter(ahead, name).value - parameter(behind, name).value; };
  const double young_pa = 0.5 * (parameter(ahead, "young_modulus").value + parameter(behind, "young_modulus").value);
  return {50 * change("young_modulus") / young_pa, 0.5 * change("poisson_ratio")};
}

Shift in_squares(const std::vector<Shift>& shifts) {
  Shift sum;
  for (const Shift& one : shifts) sum = {std::hypot(sum.young_percent, one.young_percent), std::hypot(sum.poisson, one.poisson)};
  return sum;
}

const BudgetEntry& said_of(const Identification& answer, const std::string& input) {
  for (const auto& entry : answer.budget_if)
    if (entry.input == input) return entry;
  throw std::runtime_error("nothing is said of " + input);
}

void expect_said(const Identification& answer, const std::string& input, const Shift& real) {
  const BudgetEntry& said = said_of(answer, input);
  testing::Test::RecordProperty(input, std::to_string(said.young_modulus_percent) + " said, real " + std::to_string(real.young_percent) + "; nu " + std::to_string(said.poisson_shift) + " said, real " + std::to_string(real.poisson));
  EXPECT_GT(real.young_percent, 0.1) << input << " should matter, else this says nothing";
  EXPECT_NEAR(said.young_modulus_percent, real.young_percent, 0.2 * real.young_percent) << input;
  // Below a twentieth of what nu is known to, a fit stops where it stops.
  EXPECT_NEAR(said.poisson_shift, real.poisson, 0.2 * real.poisson + 0.05 * parameter(answer, "poisson_ratio").std) << input;
}

TEST(BudgetIf, IsWhatFitsWithWrongInputsAreOffBy) {
  const Recording stated = glued_block();
  const Inputs inputs = seen_of(stated);
  const Identification answer = fitted(stated, inputs, true);
  EXPECT_TRUE(std::none_of(answer.budget.begin(), answer.budget.end(), [](const auto& e) { return e.input == "contact_shift"; }));

  std::vector<Shift> contact;
  for (const Vec3& tangent : tangents(stated.pushes[0].steps[0].loads[0].direction)) {
    const auto off_by = [&](double size_m) {
      Recording wrong = stated;
      for (auto& step : wrong.pushes[0].steps) step.loads[0].contact_m += size_m * tangent;
      return fitted(wrong, inputs);
    };
    contact.push_back(between(off_by(1e-3), off_by(-1e-3)));
  }
  expect_said(answer, "contact_shift", in_squares(contact));

  const auto wider_by = [&](double share) {
    Recording wrong = stated;
    wrong.tools[0].radius_m *= 1 + share;
    return fitted(wrong, inputs);
  };
  expect_said(answer, "tool_radius", in_squares({between(wider_by(0.1), wider_by(-0.1))}));

  std::vector<Shift> moved, turned;
  for (int axis = 0; axis < 3; ++axis) {
    const auto off_by = [&](double size_m, double angle_rad) {
      Inputs other = inputs;
      for (auto& step : other) {
        Points& points_m = std::get<PointCloud>(step[0]).points_m;
        const Eigen::RowVector3d middle_m = points_m.colwise().mean();
        const Mat3 turn = Eigen::AngleAxisd(angle_rad, Vec3(Vec3::Unit(axis))).toRotationMatrix();
        points_m = ((points_m.rowwise() - middle_m) * turn.transpose()).rowwise() + (middle_m + size_m * Eigen::RowVector3d::Unit(axis));
      }
      return fitted(stated, other);
    };
    constexpr double part = 0.2;  // farther off than their noise clouds are weighed otherwise: a part, and that part of the shift
    const auto whole = [&](Shift one) { return Shift{one.young_percent / part, one.poisson / part}; };
    const TypicalErrors errors;
    moved.push_back(whole(between(off_by(part * errors.camera_m, 0), off_by(-part * errors.camera_m, 0))));
    turned.push_back(between(off_by(0, errors.camera_rad), off_by(0, -errors.camera_rad)));
  }
  expect_said(answer, "camera", in_squares(moved));
  expect_said(answer, "camera_rotation", in_squares(turned));
}

// E is proportional to the force that acts, and the shape says nothing of the force.
TEST(BudgetIf, OnePerCentOfTheForcesScaleIsOnePerCentOfYoungsModulusAndNothingOfNu) {
  const Identification answer = fitted(glued_block(), seen_of(glued_block()), true);
  const BudgetEntry& said = said_of(answer, "force_scale");
  EXPECT_NEAR(said.young_modulus_percent, 1, 1e-3);
  EXPECT_LT(said.poisson_shift, 1e-5);
  EXPECT_EQ(said.off_by, "1 %");
  EXPECT_EQ(said.field, "force_scale_std");
}

TEST(BudgetIf, WhatIsStatedAsUncertainIsInTheIntervalAndNotThere) {
  Recording recording = glued_block();
  const Inputs inputs = seen_of(recording);
  recording.force_scale_std = 0.02;
  for (auto& step : recording.pushes[0].steps) step.loads[0].contact_std_m = 5e-4;
  const Identification answer = fitted(recording, inputs, true);
  for (const char* input : {"force_scale", "contact_shift"}) {
    const auto is_it = [&](const BudgetEntry& entry) { return entry.input == input; };
    EXPECT_TRUE(std::any_of(answer.budget.begin(), answer.budget.end(), is_it)) << input;
    EXPECT_TRUE(std::none_of(answer.budget_if.begin(), answer.budget_if.end(), is_it)) << input;
  }
  EXPECT_GT(said_of(answer, "tool_radius").young_modulus_percent, 0);
}

// The scale is every region's, whatever else is known of it.
TEST(BudgetIf, EveryRegionHasItsShare) {
  PushedBlock truth;
  truth.free_half = 2;
  truth.sigma_m = 1e-4;
  SimulatedObject halves = coarse_block();
  put_two_halves(halves);
  Recording recording = pushed_block_recording();
  const Inputs inputs = clouds_of(truth, recording);
  recording.model.poisson_fixed = 0.3;  // all is normal then
  const Identification exact = fit(recording, halves, inputs, {});
  recording.force_scale_std = 0.05;
  const Identification open = fit(recording, halves, inputs, {});
  const auto expect_shares = [](const BudgetEntry& entry, double percent) {
    ASSERT_EQ(entry.regions.size(), 2u);
    EXPECT_EQ(entry.regions[0].region, "clamped half");
    EXPECT_EQ(entry.regions[1].region, "free half");
    for (const RegionShare& share : entry.regions) EXPECT_NEAR(share.young_modulus_percent, percent, 0.02 * percent) << share.region;
  };
  expect_shares(said_of(exact, "force_scale"), 1);
  const auto scale = std::find_if(open.budget.begin(), open.budget.end(), [](const auto& e) { return e.input == "force_scale"; });
  ASSERT_NE(scale, open.budget.end());
  expect_shares(*scale, 5);
  // Where nothing else is uncertain all of each half's standard deviation is noise.
  const auto noise = std::find_if(exact.budget.begin(), exact.budget.end(), [](const auto& e) { return e.input == "sensor noise"; });
  ASSERT_NE(noise, exact.budget.end());
  ASSERT_EQ(noise->regions.size(), 2u);
  for (std::size_t r = 0; r < 2; ++r) {
    const Parameter& young = exact.parameters[r == 0 ? 0 : 2];
    EXPECT_NEAR(noise->regions[r].young_modulus_percent, 100 * young.std / young.value, 0.05 * 100 * young.std / young.value);
  }
}

}  // namespace
}  // namespace palpate::estimation::exact_inputs_test
