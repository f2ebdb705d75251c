// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/embedding.hpp"

#include <gtest/gtest.h>

#include <random>

#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"

namespace palpate::geometry::embedding_test {
namespace {

/// Box of n^3 cells with six tetrahedra each, corners shaken.
TetMesh shaken_grid(int n) {
  TetMesh m;
  const int k = n + 1;
  m.nodes_m.resize(k * k * k, 3);
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> u(-0.15 / n, 0.15 / n);
  const auto id = [k](int x, int y, int z) { return (z * k + y) * k + x; };
  for (int z = 0; z < k; ++z)
    for (int y = 0; y < k; ++y)
      for (int x = 0; x < k; ++x)
        m.nodes_m.row(id(x, y, z)) << double(x) / n + u(rng), double(y) / n + u(rng), double(z) / n + u(rng);
  const int kuhn[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  m.tetrahedra.resize(6 * n * n * n, 4);
  Eigen::Index row = 0;
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x)
        for (const auto& t : kuhn) {
          for (int c = 0; c < 4; ++c) m.tetrahedra(row, c) = id(x + (t[c] & 1), y + ((t[c] >> 1) & 1), z + (t[c] >> 2));
          ++row;
        }
  return m;
}

TEST(Embedding, weights_sum_to_one_and_carry_affine_motions_exactly) {
  const TetMesh volume = shaken_grid(4);
  const Points p = shapes::sphere(0.55, 3, Vec3(0.5, 0.5, 0.5)).vertices_m;  // partly outside
  const auto e = embed(p, volume);
  EXPECT_LT((e.weights.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-15);
  EXPECT_LT((embedded_points(e, volume, volume.nodes_m) - p).cwiseAbs().maxCoeff(), 1e-14);
  Mat3 a;
  a << 1.3, -0.2, 0.7, 0.1, 0.4, -2, 0.5, 0.9, 1.1;
  const Eigen::RowVector3d b(3, -2, 0.5);
  Points moved = volume.nodes_m * a.transpose();
  moved.rowwise() += b;
  Points expected = p * a.transpose();
  expected.rowwise() += b;
  EXPECT_LT((embedded_points(e, volume, moved) - expected).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(Embedding, takes_the_element_that_contains_the_point) {
  const TetMesh volume = shaken_grid(5);
  std::mt19937 rng(8);
  std::uniform_real_distribution<double> u(0.1, 0.9), w(0.01, 1);
  Points p(300, 3);
  std::uniform_int_distribution<Index> pick(0, static_cast<Index>(volume.tetrahedra.rows()) - 1);
  std::vector<Index> truth;
  for (Eigen::Index i = 0; i < p.rows(); ++i) {
    truth.push_back(pick(rng));
    Eigen::Vector4d b(w(rng), w(rng), w(rng), w(rng));
    b /= b.sum();
    p.row(i).setZero();
    for (int k = 0; k < 4; ++k) p.row(i) += b[k] * volume.nodes_m.row(volume.tetrahedra(truth.back(), k));
  }
  const auto e = embed(p, volume);
  for (Eigen::Index i = 0; i < p.rows(); ++i) EXPECT_EQ(e.element[i], truth[i]);
  EXPECT_GT(e.weights.minCoeff(), 0);
}

TEST(Embedding, outside_the_nearest_element_is_taken) {
  const TetMesh volume = shaken_grid(3);
  Points p(1, 3);
  p << 0.5, 0.5, 1.3;
  const auto e = embed(p, volume);
  double nearest = 1e9;
  for (int k = 0; k < 4; ++k)
    nearest = std::min(nearest, (volume.nodes_m.row(volume.tetrahedra(e.element[0], k)) - p.row(0)).norm());
  for (Eigen::Index n = 0; n < volume.nodes_m.rows(); ++n)
    EXPECT_GT((volume.nodes_m.row(n) - p.row(0)).norm(), nearest - 0.34) << "within a cell of the nearest node";
  EXPECT_LT(e.weights.row(0).minCoeff(), 0);
}

TEST(Embedding, passes_over_elements_without_volume_and_refuses_when_there_is_no_other) {
  TetMesh volume = shaken_grid(2);
  const auto n = volume.tetrahedra.rows();
  volume.tetrahedra.conservativeResize(n + 1, 4);
  volume.tetrahedra.row(n) << 0, 1, 2, 2;
  Points p(1, 3);
  p << 0, 0, 0;
  EXPECT_LT(embed(p, volume).element[0], n);
  volume.tetrahedra = Tetrahedra(volume.tetrahedra.bottomRows(1));
  EXPECT_THROW(embed(p, volume), Error);
  p(0, 0) = NAN;
  EXPECT_THROW(embed(p, shaken_grid(1)), Error);
}

}  // namespace
}  // namespace palpate::geometry::embedding_test
