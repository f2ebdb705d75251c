// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block between two smooth plates: closed form, and no support holds it sideways or keeps it from turning.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimation/pushed_block.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/identify.hpp"

namespace palpate::estimation::smooth_platens_test {
namespace {

constexpr double young_pa = 30e3, nu = 0.3, height_m = 0.06, width_m = 0.1;

/// Pressed by up to 2 %, seen as clouds of its five free faces; in every step it has slid by `slide_m` and turned by `turn_rad`.
Recording pressed(bool as_surface, double sigma_m, double slide_m = 0, double turn_rad = 0) {
  Recording recording;
  recording.name = "block between plates";
  TetMesh block = kuhn_block(6, 6, 4, Vec3(width_m, width_m, height_m));
  block.nodes_m.leftCols<2>().array() -= 0.5 * width_m;
  if (as_surface)
    recording.rest.surface = geometry::boundary_surface(block).surface;
  else
    recording.rest.volume = block;
  recording.rest.state = RestState::stress_free;
  recording.environment.gravity_m_s2.setZero();
  recording.model.material = "linear";
  recording.model.refine = "none";
  Support table;
  table.kind = SupportKind::plane;
  table.name = "table";
  table.plane.normal = Vec3::UnitZ();
  table.contact = ContactLaw::frictionless;
  recording.supports = {table};
  Tool press;
  press.name = "press";
  press.shape = ToolShape::platen;
  press.plane.point_m = Vec3(0, 0, height_m);
  press.plane.normal = -Vec3::UnitZ();
  press.contact = ContactLaw::frictionless;
  recording.tools = {press};
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> across(-0.5, 0.5);
  Push push;
  push.name = "press";
  for (int k = 0; k <= 4; ++k) {
    const double strain = 0.005 * k;
    Step step;
    step.time_s = k;
    Load load;
    load.tool = "press";
    load.travel_m = strain * height_m;
    load.direction = -Vec3::UnitZ();
    load.contact_m = press.plane.point_m;
    step.loads = {load};
    Wrench force;
    force.tool = "press";
    force.force_n = Vec3(0, 0, -young_pa * strain * width_m * width_m);
    force.force_sigma_n = 0.02;
    PointCloud seen;
    constexpr int points = 1500;
    seen.points_m.resize(points, 3);
    const Eigen::AngleAxisd turned(turn_rad * k, Vec3::UnitZ());
    for (int i = 0; i < points; ++i) {
      const int face = i % 4;
      Vec3 at(width_m * across(random), width_m * across(random), height_m * (0.5 + across(random)));
      at(face / 2) = (face % 2 == 0 ? -0.5 : 0.5) * width_m;
      at.head<2>() *= 1 + nu * strain;
      at.z() *= 1 - strain;
      at = turned * at + Vec3(slide_m * k, -0.5 * slide_m * k, 0);
      for (int d = 0; d < 3; ++d) at(d) += sigma_m * normal(random);
      seen.points_m.row(i) = at;
    }
    seen.sigma_m = VectorX::Constant(1, sigma_m);
    step.observations = {force, seen};
    push.steps.push_back(step);
  }
  recording.pushes = {push};
  return recording;
}

class SmoothPlatens : public testing::TestWithParam<bool> {};

TEST_P(SmoothPlatens, BothParametersAreThoseOfTheClosedForm) {
  for (const double sigma_m : {5e-5, 5e-4}) {
    IdentifyOptions options;
    options.fit.cross_checks = options.fit.stresses = false;
    const Identification answer = identify(pressed(GetParam(), sigma_m), options).answer;
    const Parameter &young = answer.parameters.at(0), &ratio = answer.parameters.at(1);
    EXPECT_NEAR(young.value, young_pa, 0.003 * young_pa) << sigma_m;
    EXPECT_LT(std::abs(ratio.value - nu), 3 * ratio.std) << sigma_m << ": " << ratio.value << " +- " << ratio.std;
    EXPECT_LT(ratio.std, 60 * sigma_m) << "it is measured";
    EXPECT_LT(answer.fit.chi2_per_dof, 1.1);
  }
}

TEST_P(SmoothPlatens, AnObjectThatSlidAndTurnedIsTheSame) {
  IdentifyOptions options;
  options.fit.cross_checks = options.fit.stresses = false;
  const Parameter ratio = identify(pressed(GetParam(), 5e-5, 5e-4, 2e-3), options).answer.parameters.at(1);
  EXPECT_LT(std::abs(ratio.value - nu), 3 * ratio.std) << ratio.value << " +- " << ratio.std;
}

INSTANTIATE_TEST_SUITE_P(Shape, SmoothPlatens, testing::Bool(),
                         [](const auto& one) { return std::string(one.param ? "surface" : "volume"); });

}  // namespace
}  // namespace palpate::estimation::smooth_platens_test
