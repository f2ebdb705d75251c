// label: unit
// SPDX-License-Identifier: Apache-2.0
// Pushes at one place that go different ways: each shifts its contact along its own two tangents, and what was solved for one model
// serves the next.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/estimation/load_columns.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::contact_shift_test {
namespace {

constexpr double young_pa = 2e4, size_m = 0.012;
const Vec3 slanted = Vec3(1, 0, -1).normalized(), turned = Vec3(0.3, -0.5, -1).normalized();

/// The block on its large face, pressed at one place from above and slantwise.
Recording pushed_both_ways(const Vec3& second = slanted) {
  Recording recording = glued_block_recording({Vec3(0, 0, -0.4), Vec3(0, 0, -0.8)}, 0.028, 0.021);
  recording.pushes.push_back(recording.pushes[0]);
  recording.pushes[1].name = "slanted";
  for (Push& push : recording.pushes) {
    for (Step& step : push.steps) {
      Load& load = step.loads[0];
      load.direction = push.name == "slanted" ? second : Vec3(-Vec3::UnitZ());
      load.force_n = load.force_n->norm() * load.direction;
      load.contact_std_m = 3e-3;
    }
  }
  return recording;
}

SimulatedObject block(const std::string& material = "linear") { return simulated(kuhn_block(9, 6, 4, block_size_m), material); }

VectorX as_stated(const Unknowns& unknowns) {
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(young_pa);
  at(poisson) = 0.3;
  return at;
}

std::vector<int> shift_of(const Unknowns& unknowns, const std::string& push) {
  return unknowns.named({"contact_shift[" + push + "]_1", "contact_shift[" + push + "]_2"});
}

class Ways : public testing::TestWithParam<Vec3> {};

// To first order: half of what two contacts differ by that are stated one on each side.
TEST_P(Ways, AShiftIsAContactThatIsStatedThere) {
  const Recording recording = pushed_both_ways(GetParam());
  Unknowns unknowns;
  ForwardModel model(recording, block(), unknowns);
  const VectorX at = as_stated(unknowns);
  for (const std::size_t push : {0u, 1u}) {
    const std::size_t s = 2 * push + 1;
    const std::vector<int> shift = shift_of(unknowns, recording.pushes[push].name);
    ASSERT_EQ(shift.size(), 2u);
    for (std::size_t k = 0; k < 2; ++k) {
      const double off_m = size_m / 8;
      const auto surface_m = [&](double sign) {
        Recording there = recording;
        for (Step& step : there.pushes[push].steps) {
          Load& load = step.loads[0];
          load.contact_m += sign * off_m * tangents(load.direction)[k];
          load.contact_std_m = 0;
        }
        Unknowns exact;
        ForwardModel other(there, block(), exact);
        return other.predict(s, as_stated(exact), false).surface_m;
      };
      const Points stated_m = 0.5 * (surface_m(1) - surface_m(-1));
      VectorX shifted = at;
      shifted(shift[k]) = off_m;
      const Points by_shift_m = model.predict(s, shifted, false).surface_m - model.predict(s, at, false).surface_m;
      EXPECT_GT(stated_m.norm(), 1e-5);
      EXPECT_LT((by_shift_m - stated_m).norm(), 0.03 * stated_m.norm()) << recording.pushes[push].name << " along tangent " << k + 1;
    }
  }
}

// What a fit re-linearises around, and what a wrist's torque says, is the same place.
TEST_P(Ways, TheLeverIsWhereTheContactWasFound) {
  const Recording recording = pushed_both_ways(GetParam());
  Unknowns unknowns;
  ForwardModel model(recording, block(), unknowns);
  for (std::size_t k = 0; k < 2; ++k) {
    VectorX at = as_stated(unknowns);
    const Vec3 before_m = model.acting_force(3, 0, at)->lever_m;
    at(shift_of(unknowns, "slanted")[k]) = 2e-3;
    const Vec3 found_m = model.contact_found_m(3, 0, at), lever_m = model.acting_force(3, 0, at)->lever_m - before_m;
    EXPECT_NEAR(found_m.norm(), 2e-3, 1e-9);
    // On a flat face the patch moves along the face: of a shift that leaves it the part in it.
    const Vec3 along = GetParam(), in_face_m = found_m - found_m.z() * Vec3::UnitZ();
    EXPECT_LT((lever_m - (in_face_m - along.dot(in_face_m) * along)).norm(), 1e-4) << "tangent " << k + 1;
  }
}

TEST_P(Ways, DerivativesAreThoseOfDifferences) {
  for (const char* material : {"linear", "neo_hookean"}) {
    const Recording recording = pushed_both_ways(GetParam());
    Unknowns unknowns;
    ForwardModel model(recording, simulated(kuhn_block(4, 3, 2, block_size_m), material), unknowns, tight());
    VectorX at = as_stated(unknowns);
    for (const char* push : {"down", "slanted"}) at(shift_of(unknowns, push)[0]) = 1e-3, at(shift_of(unknowns, push)[1]) = -7e-4;
    for (const std::size_t s : {1u, 3u}) {
      const StepPrediction here = model.predict(s, at);
      const ActingForce acting = *model.acting_force(s, 0, at);
      for (const int k : shift_of(unknowns, recording.pushes[s / 2].name)) {
        const double h = 1e-5;
        VectorX ahead = at, behind = at;
        ahead(k) += h;
        behind(k) -= h;
        const StepPrediction a = model.predict(s, ahead, false), b = model.predict(s, behind, false);
        const auto column = std::find(here.columns.begin(), here.columns.end(), k) - here.columns.begin();
        ASSERT_LT(column, static_cast<std::ptrdiff_t>(here.columns.size()));
        const Points moved = (a.surface_m - b.surface_m) / (2 * h);
        const VectorX flat = Eigen::Map<const VectorX>(moved.data(), moved.size());
        EXPECT_LT((here.d_surface.col(column) - flat).norm(), 1e-5 * flat.norm()) << material << " step " << s << " " << unknowns[k].name;
        EXPECT_NEAR(here.d_travel(0, column), (a.travel_m(0) - b.travel_m(0)) / (2 * h), 1e-6 + 1e-5 * std::abs(here.d_travel(0, column)));
        ASSERT_EQ(std::count(acting.unknowns.begin(), acting.unknowns.end(), k), 1);
        const auto own = std::find(acting.unknowns.begin(), acting.unknowns.end(), k) - acting.unknowns.begin();
        const Vec3 lever = (model.acting_force(s, 0, ahead)->lever_m - model.acting_force(s, 0, behind)->lever_m) / (2 * h);
        EXPECT_LT((acting.d_lever.col(own) - lever).norm(), 1e-8);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AtOnePlace, Ways, testing::Values(slanted, turned));

TEST(WaysAtOnePlace, ASecondModelSolvesForNothing) {
  const Recording recording = pushed_both_ways();
  Unknowns first, second;
  ForwardModel model(recording, block(), first);
  model.predict(3, as_stated(first));
  EXPECT_GT(model.load_cases(), 0);
  ForwardModel next(recording, block(), second, {}, model.solved());
  next.predict(3, as_stated(second));
  EXPECT_EQ(next.load_cases(), 0);
}

}  // namespace
}  // namespace palpate::estimation::contact_shift_test
