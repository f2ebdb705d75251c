// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Regions of other stiffness: a bar of two halves is two springs in a row. Regions of other Poisson ratios.
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>

#include "fem/fem_meshes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::region_stiffness_test {
namespace {

// A bar along x, held at x = 0 and drawn at its other end by a force.
struct Bar {
  TetMesh mesh = to_quadratic(block_mesh(6, 2, 2, Vec3(0.3, 0.1, 0.1)));
  Boundary boundary;
  std::vector<Index> end;
  Bar() {
    for (Index n = 0; n < mesh.nodes_m.rows(); ++n) {
      if (mesh.nodes_m(n, 0) < 1e-9) boundary.constraints.push_back({n, Mat3::Identity(), 3});
      if (mesh.nodes_m(n, 0) > 0.3 - 1e-9) end.push_back(n);
    }
    // Uniform traction on a flat quadratic face: a third of its force at each midpoint.
    VectorX column = VectorX::Zero(3 * mesh.nodes_m.rows());
    const Tetrahedra faces = boundary_faces(mesh);
    for (Index f = 0; f < faces.rows(); ++f) {
      const Vec3 a = mesh.nodes_m.row(faces(f, 0)), b = mesh.nodes_m.row(faces(f, 1)), c = mesh.nodes_m.row(faces(f, 2));
      if (std::min({a.x(), b.x(), c.x()}) < 0.3 - 1e-9) continue;
      for (int k = 3; k < 6; ++k) column(3 * faces(f, k)) += 0.5 * (b - a).cross(c - a).norm() / 0.01 / 3;
    }
    boundary.forces = MatrixX(column).sparseView();
  }
  std::vector<int> halves() const {
    std::vector<int> region;
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) region.push_back(element_centre(mesh, e).x() < 0.15 ? 0 : 1);
    return region;
  }
};

TEST(RegionStiffness, TwoHalvesAreSpringsInARow) {
  const Bar bar;
  for (const char* material : {"linear", "neo_hookean"})
    for (const Dilatation dilatation : {Dilatation::pointwise, Dilatation::averaged}) {
      StaticsOptions options;
      options.dilatation = dilatation;
      options.region = bar.halves();
      options.region_stiffness = Eigen::Vector2d(1, 4);
      const Statics statics(bar.mesh, material, bar.boundary, options);
      const auto at = statics.solve(1e4, 0.0, VectorX::Constant(1, 0.01), VectorX(0));  // strain 1e-4: nu = 0, no necking
      ASSERT_TRUE(at.converged) << at.reason;
      double stretch = 0;
      for (const Index n : bar.end) stretch += at.displacement_m(3 * n) / double(bar.end.size());
      EXPECT_NEAR(stretch / (0.01 / (1e4 * 0.01) * (0.15 + 0.15 / 4)), 1, 3e-4) << material;
    }
}

TEST(RegionStiffness, OneFactorEverywhereIsAnotherYoungModulus) {
  const Bar bar;
  for (const char* material : {"linear", "neo_hookean"})
    for (const Dilatation dilatation : {Dilatation::pointwise, Dilatation::averaged}) {
      StaticsOptions options;
      options.dilatation = dilatation;
      const Statics plain(bar.mesh, material, bar.boundary, options);
      options.region = bar.halves();
      Statics stiff(bar.mesh, material, bar.boundary, options);
      const VectorX force = VectorX::Constant(1, 8.0);
      stiff.solve(1e4, 0.3, force, VectorX(0));  // what it remembers must not survive the change
      stiff.set_region_stiffness(Eigen::Vector2d(2.5, 2.5));
      const auto a = stiff.solve(1e4, 0.3, force, VectorX(0)), b = plain.solve(2.5e4, 0.3, force, VectorX(0));
      ASSERT_TRUE(a.converged && b.converged);
      EXPECT_LT((a.displacement_m - b.displacement_m).norm(), 1e-7 * b.displacement_m.norm()) << material;
      const Sensitivity one = stiff.sensitivity(a);
      EXPECT_LT((one.d_log_stiffness.rowwise().sum() - one.d_log_young).norm(), 1e-7 * one.d_log_young.norm()) << material;
    }
}

// What averaged dilatations become where the regions' bulk terms differ: with one nu what they are without regions, with two what
// plain quadratic elements say, which this mesh is fine enough for.
TEST(RegionPoisson, AveragedDilatationsAreWeighedWithEachRegionsBulkTerm) {
  const TetMesh mesh = to_quadratic(block_mesh(8, 6, 6, Vec3(0.1, 0.075, 0.075)));
  Boundary boundary;
  for (Index n = 0; n < mesh.nodes_m.rows(); ++n)
    if (mesh.nodes_m(n, 2) < 1e-9) boundary.constraints.push_back({n, Mat3::Identity(), 3});
  boundary.forces = spread_over_patch(mesh, {0.05, 0.04, 0.075}, 0.03);
  const Vec3 force_n(0.5, 0, -3);
  for (const char* material : {"linear", "neo_hookean"}) {
    StaticsOptions options;
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) options.region.push_back(element_centre(mesh, e).x() < 0.05 ? 0 : 1);
    const auto solved = [&](Dilatation dilatation, double poisson) {
      options.dilatation = dilatation;
      options.region_poisson = Eigen::Vector2d(std::nan(""), poisson);
      const Equilibrium at = Statics(mesh, material, boundary, options).solve(1e4, 0.4, force_n, VectorX(0));
      EXPECT_TRUE(at.converged) << at.reason;
      return at.displacement_m;
    };
    StaticsOptions plain;
    plain.dilatation = Dilatation::averaged;
    const VectorX shared = Statics(mesh, material, boundary, plain).solve(1e4, 0.4, force_n, VectorX(0)).displacement_m;
    EXPECT_LT((solved(Dilatation::averaged, 0.4) - shared).norm(), 1e-7 * shared.norm()) << material;
    for (const double poisson : {0.0, 0.2}) {
      const VectorX averaged = solved(Dilatation::averaged, poisson), pointwise = solved(Dilatation::pointwise, poisson);
      EXPECT_LT((averaged - pointwise).norm(), 0.01 * pointwise.norm()) << material << poisson;
      EXPECT_GT((averaged - shared).norm(), 0.05 * pointwise.norm()) << material << poisson;
    }
  }
}

// What was remembered of the factors must not survive a change.
TEST(RegionPoisson, ChangesAreFollowed) {
  const Bar bar;
  for (const char* material : {"linear", "neo_hookean"})
    for (const Dilatation dilatation : {Dilatation::pointwise, Dilatation::averaged}) {
      StaticsOptions options;
      options.dilatation = dilatation;
      options.region = bar.halves();
      options.region_poisson = Eigen::Vector2d(std::nan(""), 0.2);
      Statics moved(bar.mesh, material, bar.boundary, options);
      const VectorX force = VectorX::Constant(1, 8.0);
      moved.sensitivity(moved.solve(1e4, 0.3, force, VectorX(0)));
      moved.set_region_poisson(Eigen::Vector2d(std::nan(""), 0.45));
      const auto there = moved.solve(1e4, 0.3, force, VectorX(0));
      moved.set_region_poisson({});
      const auto shared = moved.solve(1e4, 0.3, force, VectorX(0));
      options.region_poisson = Eigen::Vector2d(std::nan(""), 0.45);
      const auto anew = Statics(bar.mesh, material, bar.boundary, options).solve(1e4, 0.3, force, VectorX(0));
      options.region_poisson = {};
      const auto plain = Statics(bar.mesh, material, bar.boundary, options).solve(1e4, 0.3, force, VectorX(0));
      EXPECT_LT((there.displacement_m - anew.displacement_m).norm(), 1e-7 * anew.displacement_m.norm()) << material;
      EXPECT_LT((shared.displacement_m - plain.displacement_m).norm(), 1e-7 * plain.displacement_m.norm()) << material;
    }
}

TEST(RegionPoisson, WhatDoesNotFitIsRefused) {
  const Bar bar;
  StaticsOptions options;
  options.region = bar.halves();
  Statics statics(bar.mesh, "linear", bar.boundary, options);
  EXPECT_THROW(statics.set_region_poisson(Eigen::Vector2d(0.3, 0.5)), Error);
  EXPECT_THROW(statics.set_region_poisson(Vec3(0.3, 0.3, 0.3)), Error);
  options.dilatation = Dilatation::averaged;
  options.region_poisson = Eigen::Vector2d(std::nan(""), -0.2);
  EXPECT_THROW(Statics(bar.mesh, "linear", bar.boundary, options).solve(1e4, 0.3, VectorX::Constant(1, 1.0), VectorX(0)), Error);
}

TEST(RegionStiffness, WhatDoesNotFitIsRefused) {
  const Bar bar;
  StaticsOptions options;
  options.region = bar.halves();
  Statics statics(bar.mesh, "linear", bar.boundary, options);
  EXPECT_THROW(statics.set_region_stiffness(Eigen::Vector2d(1, 0)), Error);
  EXPECT_THROW(statics.set_region_stiffness(Eigen::Vector3d(1, 1, 1)), Error);
  options.region.pop_back();
  EXPECT_THROW(Statics(bar.mesh, "linear", bar.boundary, options), Error);
}

Region part(const std::string& name, RegionSelection select) {
  Region region;
  region.name = name;
  region.select = select;
  return region;
}

// Boxes before points, and every element somewhere.
TEST(RegionsOf, ElementsBelongWhereTheirCentresAre) {
  const Bar bar;
  Region low = part("low", RegionSelection::box);
  const Region rest = part("rest", RegionSelection::rest);
  low.box_min_m = Vec3(-1, -1, -1);
  low.box_max_m = Vec3(0.1, 1, 1);
  const auto both = regions_of(bar.mesh, {rest, low});
  for (Index e = 0; e < bar.mesh.tetrahedra.rows(); ++e) EXPECT_EQ(both[e], element_centre(bar.mesh, e).x() <= 0.1 ? 1 : 0);
  Region left = part("left", RegionSelection::points), right = part("right", RegionSelection::points);
  left.points_m = Vec3(0.0, 0, 0).transpose();
  right.points_m = Vec3(0.3, 0, 0).transpose();
  const auto three = regions_of(bar.mesh, {left, right, low});
  for (Index e = 0; e < bar.mesh.tetrahedra.rows(); ++e) {
    const Vec3 at = element_centre(bar.mesh, e);
    EXPECT_EQ(three[e], at.x() <= 0.1 ? 2 : at.x() < 0.15 ? 0 : 1);
  }
  Region listed = part("listed", RegionSelection::elements);
  for (Index e = 0; e < bar.mesh.tetrahedra.rows(); ++e)
    if (element_centre(bar.mesh, e).x() < 0.2) listed.elements.push_back(e);
  const TetMesh corners{bar.mesh.nodes_m, bar.mesh.tetrahedra.leftCols(4)};
  const TetMesh finer = refine_uniform(corners);
  const auto children = regions_of(finer, {listed, rest}, &bar.mesh);
  int off = 0;
  for (Index e = 0; e < finer.tetrahedra.rows(); ++e) off += children[e] != (element_centre(finer, e).x() < 0.2 ? 0 : 1);
  EXPECT_LT(off, 0.05 * double(finer.tetrahedra.rows()));
  EXPECT_THROW(regions_of(bar.mesh, {low, listed}), Error);             // no mesh to count in
  EXPECT_THROW(regions_of(bar.mesh, {low, listed}, &bar.mesh), Error);  // nobody takes the end
  low.box_max_m = Vec3(-0.5, 1, 1);
  EXPECT_THROW(regions_of(bar.mesh, {rest, low}), Error);  // nothing in it
}

// Two meshes of one body, some 60 000 elements each: as the nearest of all centres says, without asking all of them.
TEST(RegionsOf, ListsOfAnotherMeshAreFollowedQuickly) {
  const Vec3 size_m(0.3, 0.24, 0.14);
  const TetMesh given = block_mesh(29, 25, 14, size_m), other = distorted(block_mesh(30, 24, 14, size_m), 0.001, 5);
  Region listed = part("listed", RegionSelection::elements);
  for (Index e = 0; e < given.tetrahedra.rows(); ++e)
    if (e % 3 == 0) listed.elements.push_back(e);
  const std::clock_t before = std::clock();
  const auto region = regions_of(other, {listed, part("rest", RegionSelection::rest)}, &given);
  EXPECT_LT(static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC, 2);
  Points centres_m(given.tetrahedra.rows(), 3);
  for (Index e = 0; e < given.tetrahedra.rows(); ++e) centres_m.row(e) = element_centre(given, e);
  for (Index e = 0; e < other.tetrahedra.rows(); e += 499) {
    Index nearest = 0;
    (centres_m.rowwise() - element_centre(other, e).transpose()).rowwise().squaredNorm().minCoeff(&nearest);
    EXPECT_EQ(region[static_cast<std::size_t>(e)], nearest % 3 == 0 ? 0 : 1) << e;
  }
}

}  // namespace
}  // namespace palpate::fem::region_stiffness_test
