// label: oracle
// SPDX-License-Identifier: Apache-2.0
// A soft beam (Dubied et al., RA-L 2022: 30 x 30 x 100 mm, Dragon Skin 10, one end clamped) under its weight and a line load
// on the top edge of its tip; static positions of three points computed with COMSOL, E = 263824 Pa, nu = 0.499, Neo-Hooke.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "fem_meshes.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::comsol_beam_test {
namespace {

// Axis along x with the tip at 0 and the body at positive x (the reference's body lies at negative x), z up.
class Beam {
 public:
  explicit Beam(const TetMesh& mesh, Dilatation dilatation) : mesh_(mesh) {
    Boundary b;
    b.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.x() > 0.1 - 1e-9; }));
    b.forces = hstack({edge_load(), body_force(mesh)});
    StaticsOptions options;
    options.dilatation = dilatation;
    statics_ = std::make_unique<Statics>(mesh, "neo_hookean", std::move(b), options);
  }

  // Worst error of any component of any given point, relative to the point's drop.
  double worst_error(double load_n, const std::vector<std::pair<Vec3, Vec3>>& rest_and_deformed_mm) {
    VectorX a(4);
    a << load_n, 0, 0, -1070 * 9.81;
    const Equilibrium e = statics_->solve(263824, 0.499, a, VectorX(), start_.size() ? &start_ : nullptr);
    EXPECT_TRUE(e.converged) << e.reason;
    start_ = e.displacement_m;
    double worst = 0;
    for (const auto& [rest, deformed] : rest_and_deformed_mm) {
      const Index node = nearest_node(mesh_, 1e-3 * rest);
      EXPECT_LT((node_position(mesh_, node) - 1e-3 * rest).norm(), 1e-9) << "the mesh has no node there";
      Vec3 ours = 1e3 * (node_position(mesh_, node) + e.displacement_m.segment<3>(3 * node));
      ours.x() = -ours.x();
      worst = std::max(worst, (ours - deformed).cwiseAbs().maxCoeff() / (rest.z() - deformed.z()));
    }
    return worst;
  }

 private:
  Eigen::SparseMatrix<double> edge_load() const {
    const bool quadratic = mesh_.tetrahedra.cols() == 10;
    auto edge = nodes_where(mesh_, [](const Vec3& x) { return x.x() < 1e-9 && x.z() > 0.03 - 1e-9; });
    std::sort(edge.begin(), edge.end(), [&](Index a, Index b) { return mesh_.nodes_m(a, 1) < mesh_.nodes_m(b, 1); });
    const std::size_t intervals = edge.size() - 1;
    VectorX weight = VectorX::Zero(static_cast<Index>(edge.size()));
    for (std::size_t i = 0; i < intervals; ++i) {
      const bool middle = quadratic && i % 2 == 1;  // consistent weights 1 4 1 of a quadratic edge, 1 1 of a linear one
      weight(static_cast<Index>(i)) += quadratic ? (middle ? 2 : 1) : 1;
      weight(static_cast<Index>(i) + 1) += quadratic ? (middle ? 1 : 2) : 1;
    }
    std::vector<Eigen::Triplet<double>> triplets;
    for (std::size_t i = 0; i < edge.size(); ++i)
      triplets.emplace_back(3 * edge[i] + 2, 0, -weight(static_cast<Index>(i)) / weight.sum());
    Eigen::SparseMatrix<double> column(3 * mesh_.nodes_m.rows(), 1);
    column.setFromTriplets(triplets.begin(), triplets.end());
    return column;
  }

  TetMesh mesh_;
  std::unique_ptr<Statics> statics_;
  VectorX start_;
};

const Vec3 kTop(0, 15, 30), kSide(0, 0, 24), kLow(0, 30, 6);

std::vector<double> errors(const TetMesh& mesh, Dilatation dilatation) {
  Beam beam(mesh, dilatation);
  return {
      beam.worst_error(
          0, {{kTop, {1.0147, 15.001, 23.226}}, {kSide, {0.51624, -0.001, 17.248}}, {kLow, {-0.96361, 30.000, -0.69132}}}),
      beam.worst_error(0.51012, {{kTop, {2.0836, 15.015, 12.669}}, {kSide, {0.46708, -0.10591, 7.1591}}}),
      beam.worst_error(
          1.00062,
          {{kTop, {1.9954, 15.036, 2.4577}}, {kSide, {-0.59825, -0.19764, -2.3518}}, {kLow, {-6.7193, 30.034, -19.022}}})};
}

// The top point lies on the loaded edge, where a line load's displacement grows with the logarithm of refinement: under 102
// g finer meshes drift past one percent there (16 x 5 x 5: 1.2 %) while every other point stays within 0.7 %.
TEST(ComsolBeam, QuadraticElementsWithPressureAreWithinOnePercent) {
  for (double e : errors(to_quadratic(block_mesh(12, 4, 5, {0.1, 0.03, 0.03})), Dilatation::averaged)) EXPECT_LT(e, 0.01);
}

TEST(ComsolBeam, PlainQuadraticElementsNeedFourTimesAsMany) {
  for (double e : errors(to_quadratic(block_mesh(22, 6, 5, {0.1, 0.03, 0.03})), Dilatation::pointwise)) EXPECT_LT(e, 0.01);
}

TEST(ComsolBeam, LinearElementsLock) {
  const std::vector<double> e = errors(block_mesh(20, 10, 10, {0.1, 0.03, 0.03}), Dilatation::pointwise);
  EXPECT_NEAR(e[0], 0.235, 0.01);  // 10 000 of them are 23 % too stiff: kept so that nobody trusts them here
  const std::vector<double> patches = errors(block_mesh(20, 10, 10, {0.1, 0.03, 0.03}), Dilatation::averaged);
  EXPECT_LT(patches[0], 0.055);
}

}  // namespace
}  // namespace palpate::fem::comsol_beam_test
