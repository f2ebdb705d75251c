// label: contract
// SPDX-License-Identifier: Apache-2.0
// Every exact sensitivity against central differences, at a state far from rest, for every law, both elements, oblique
// sliding supports, driven plates and free bodies.
#include <gtest/gtest.h>

#include <cmath>

#include "fem_meshes.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::sensitivity_test {
namespace {

struct Case {
  const MaterialLaw* law;
  int nodes;
  Dilatation dilatation;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const MaterialLaw* law : material_table())
    for (int nodes : {4, 10})
      for (Dilatation d : {Dilatation::pointwise, Dilatation::averaged}) all.push_back({law, nodes, d});
  return all;
}

// Held below, driven down at one edge of the top, pressed aside.
Boundary held_and_driven(const TetMesh& m) {
  Boundary b;
  std::vector<Eigen::Triplet<double>> motion;
  for (Index i = 0; i < m.nodes_m.rows(); ++i) {
    const Vec3 x = node_position(m, i);
    if (x.z() < 1e-9) b.constraints.push_back({i, Mat3::Identity(), 3});
    if (x.z() > 0.15 - 1e-9 && x.x() < 0.02) {
      b.constraints.push_back({i, Mat3::Identity(), 3});
      motion.emplace_back(3 * i + 2, 0, 1.0);
    }
  }
  b.motions.resize(3 * m.nodes_m.rows(), 1);
  b.motions.setFromTriplets(motion.begin(), motion.end());
  b.forces = spread_over_patch(m, {0.1, 0.05, 0.07}, 0.03);
  return b;
}

std::vector<int> layers(const TetMesh& m) {
  std::vector<int> region;
  for (Index e = 0; e < m.tetrahedra.rows(); ++e) {
    const double height = element_centre(m, e).z();
    region.push_back(height < 0.05 ? 1 : height < 0.09 ? 0 : 2);
  }
  return region;
}

class SensitivityContract : public testing::TestWithParam<Case> {
 protected:
  TetMesh mesh() const {
    const TetMesh linear = distorted(block_mesh(2, 2, 3, {0.1, 0.1, 0.15}), 0.008, 11);
    return GetParam().nodes == 4 ? linear : to_quadratic(linear);
  }
  // Differences divide what Newton leaves over by the step.
  static StaticsOptions tight() {
    StaticsOptions options;
    options.residual_tolerance = 1e-12;
    options.dilatation = GetParam().dilatation;
    return options;
  }
  // Parameters in one vector: log E, nu, extra, force coefficients, motion coefficients.
  struct Point {
    double log_young = std::log(20000.0), poisson = 0.35;
    VectorX extra, force, motion, log_stiffness, region_poisson;
  };
  static Point pressed_aside() {
    Point p;
    p.force = Vec3(-2, 1, 0.5);
    p.motion = VectorX::Constant(1, -0.01);
    return p;
  }
  static Equilibrium solve(Statics& s, const Point& p, const VectorX* start = nullptr) {
    if (p.log_stiffness.size() > 0) s.set_region_stiffness(p.log_stiffness.array().exp());
    if (p.region_poisson.size() > 0) s.set_region_poisson(p.region_poisson);
    return s.solve(std::exp(p.log_young), p.poisson, p.force, p.motion, start, p.extra);
  }
  void compare(Statics statics, Point p) const {
    p.extra.resize(static_cast<Index>(GetParam().law->extra_parameters().size()));
    for (Index i = 0; i < p.extra.size(); ++i) p.extra(i) = GetParam().law->extra_parameters()[i].initial;
    const Equilibrium e = solve(statics, p);
    ASSERT_TRUE(e.converged) << e.reason;
    ASSERT_GT(e.displacement_m.cwiseAbs().maxCoeff(), 0.004);
    const Sensitivity s = statics.sensitivity(e);
    const auto check = [&](const char* what, double step, const VectorX& exact, const VectorX& exact_reaction,
                           auto&& change) {
      Point up = p, down = p;
      change(up, step);
      change(down, -step);
      const Equilibrium a = solve(statics, up, &e.displacement_m), b = solve(statics, down, &e.displacement_m);
      ASSERT_TRUE(a.converged && b.converged) << a.reason << b.reason;
      const VectorX d = (a.displacement_m - b.displacement_m) / (2 * step);
      EXPECT_LT((d - exact).norm(), 2e-5 * d.norm()) << what;
      const VectorX r = (a.motion_reaction - b.motion_reaction) / (2 * step);
      EXPECT_LE((r - exact_reaction).norm(), 2e-5 * (r.norm() + 1e-3 * e.motion_reaction.norm())) << what;
    };
    check("log E", 1e-4, s.d_log_young, s.reaction_d_log_young, [](Point& x, double h) { x.log_young += h; });
    check("nu", 1e-4, s.d_poisson, s.reaction_d_poisson, [](Point& x, double h) { x.poisson += h; });
    for (Index k = 0; k < p.extra.size(); ++k)
      check("extra", 1e-3, s.d_extra.col(k), s.reaction_d_extra.col(k), [k](Point& x, double h) { x.extra(k) += h; });
    ASSERT_EQ(s.d_log_stiffness.cols(), p.log_stiffness.size());
    for (Index k = 0; k < p.log_stiffness.size(); ++k)
      check("stiffness of a region", 1e-4, s.d_log_stiffness.col(k), s.reaction_d_log_stiffness.col(k),
            [k](Point& x, double h) { x.log_stiffness(k) += h; });
    ASSERT_EQ(s.d_region_poisson.cols(), p.region_poisson.size());
    for (Index k = 0; k < p.region_poisson.size(); ++k) {
      if (std::isnan(p.region_poisson(k))) {
        EXPECT_TRUE(s.d_region_poisson.col(k).isZero(0) && s.reaction_d_region_poisson.col(k).isZero(0));
        continue;
      }
      check("nu of a region", 1e-4, s.d_region_poisson.col(k), s.reaction_d_region_poisson.col(k),
            [k](Point& x, double h) { x.region_poisson(k) += h; });
    }
    for (Index k = 0; k < p.force.size(); ++k)
      check("force", 3e-3, s.d_force.col(k), s.reaction_d_force.size() ? VectorX(s.reaction_d_force.col(k)) : VectorX(),
            [k](Point& x, double h) { x.force(k) += h; });
    for (Index k = 0; k < p.motion.size(); ++k)
      check("motion", 1e-5, s.d_motion.col(k), s.reaction_d_motion.col(k), [k](Point& x, double h) { x.motion(k) += h; });
  }
};

TEST_P(SensitivityContract, ClampedBottomPushedTop) {
  const TetMesh m = mesh();
  Boundary b;
  b.constraints = clamp(nodes_where(m, [](const Vec3& x) { return x.z() < 1e-9; }));
  b.forces = hstack({spread_over_patch(m, {0.05, 0.05, 0.15}, 0.03), body_force(m)});
  Point p;
  p.force = VectorX(6);
  p.force << 1.5, 0.5, -3.0, 0.0, 1000.0, -9000.0;  // stvk is stable up to here
  compare(Statics(m, std::string(GetParam().law->name()), b, tight()), p);
}

// The bottom slides on an oblique plane, two corner nodes keep it in place, the top is driven down and sideways.
TEST_P(SensitivityContract, ObliqueSlideAndDrivenTop) {
  const TetMesh m = mesh();
  Boundary b;
  const Vec3 normal = Vec3(0.2, -0.1, 1).normalized();
  Mat3 slide = Mat3::Zero();
  slide.col(0) = normal;
  std::vector<Eigen::Triplet<double>> motion;
  for (Index i = 0; i < m.nodes_m.rows(); ++i) {
    const Vec3 x = node_position(m, i);
    if (x.z() < 1e-9) b.constraints.push_back({i, slide, 1});
    if (x.z() > 0.15 - 1e-9) {
      b.constraints.push_back({i, Mat3::Identity(), 3});
      motion.emplace_back(3 * i + 2, 0, 1.0);
      motion.emplace_back(3 * i, 1, 1.0);
    }
  }
  b.motions.resize(3 * m.nodes_m.rows(), 2);
  b.motions.setFromTriplets(motion.begin(), motion.end());
  b.forces = spread_over_patch(m, {0, 0.05, 0.07}, 0.03);
  Point p;
  p.force = Vec3(2, 1, 0);
  p.motion = VectorX(2);
  p.motion << -0.02, 0.01;
  compare(Statics(m, std::string(GetParam().law->name()), b, tight()), p);
}

// Three parts of different stiffness, one of them between the others, under a force and a motion.
TEST_P(SensitivityContract, RegionsOfDifferentStiffness) {
  const TetMesh m = mesh();
  StaticsOptions options = tight();
  options.region = layers(m);
  Point p = pressed_aside();
  p.log_stiffness = Vec3(0.4, -0.3, 0.7);
  compare(Statics(m, std::string(GetParam().law->name()), held_and_driven(m), options), p);
}

// And of different Poisson ratios, the first one's that of the whole.
TEST_P(SensitivityContract, RegionsOfDifferentPoissonRatios) {
  const TetMesh m = mesh();
  StaticsOptions options = tight();
  options.region = layers(m);
  options.region_poisson = Vec3(std::nan(""), 0.2, 0.45);
  Point p = pressed_aside();
  p.log_stiffness = Vec3(0.4, -0.3, 0.7);
  p.region_poisson = options.region_poisson;
  compare(Statics(m, std::string(GetParam().law->name()), held_and_driven(m), options), p);
}

TEST_P(SensitivityContract, FreeBodyBetweenTwoPushes) {
  const TetMesh m = mesh();
  Boundary b;
  b.inertia_relief = true;
  b.forces = hstack({spread_over_patch(m, {0.05, 0.05, 0.15}, 0.03), spread_over_patch(m, {0.05, 0.05, 0}, 0.03)});
  Point p;
  p.force = VectorX(6);
  p.force << 0.3, -0.2, -8.0, 0.1, 0.0, 7.5;
  compare(Statics(m, std::string(GetParam().law->name()), b, tight()), p);
}

INSTANTIATE_TEST_SUITE_P(Laws, SensitivityContract, testing::ValuesIn(cases()), [](const auto& each) {
  return std::string(each.param.law->name()) + "_tet" + std::to_string(each.param.nodes) +
         (each.param.dilatation == Dilatation::averaged ? "_averaged" : "");
});

}  // namespace
}  // namespace palpate::fem::sensitivity_test
