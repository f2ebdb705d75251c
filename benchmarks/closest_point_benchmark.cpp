// SPDX-License-Identifier: Apache-2.0
// Closest-point queries a second on a bumpy closed surface of 7 k and 70 k triangles.
//   near:      surface samples + N(0, 0.003 diagonal) per axis, what a depth camera sees
//   displaced: the same after 2 degrees and 0.024 diagonals of misalignment, what ICP starts from
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>

#include "palpate/geometry/triangle_tree.hpp"

namespace {
using namespace palpate;

/// Latitude-longitude sphere with bumps, 2 rows (cols - 1) triangles.
TriMesh bumpy(int rows) {
  const int cols = 2 * rows;
  TriMesh m;
  m.vertices_m.resize(Eigen::Index(rows + 1) * cols, 3);
  m.triangles.resize(2 * Eigen::Index(rows) * cols, 3);
  for (int i = 0; i <= rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const double a = M_PI * i / rows, b = 2 * M_PI * j / cols;
      const double r = 0.1 * (1 + 0.2 * std::sin(5 * a) * std::sin(4 * b) + 0.05 * std::sin(13 * a) * std::cos(11 * b));
      m.vertices_m.row(Eigen::Index(i) * cols + j) << r * std::sin(a) * std::cos(b), r * std::sin(a) * std::sin(b),
          r * std::cos(a);
    }
  Eigen::Index t = 0;
  for (Index i = 0; i < rows; ++i)
    for (Index j = 0; j < cols; ++j) {
      const Index k = (j + 1) % cols;
      m.triangles.row(t++) << i * cols + j, (i + 1) * cols + j, (i + 1) * cols + k;
      m.triangles.row(t++) << i * cols + j, (i + 1) * cols + k, i * cols + k;
    }
  return m;
}

Points samples(const TriMesh& m, int count, bool displaced) {
  const double diagonal = (m.vertices_m.colwise().maxCoeff() - m.vertices_m.colwise().minCoeff()).norm();
  std::mt19937 rng(1);
  std::uniform_int_distribution<Eigen::Index> pick(0, m.triangles.rows() - 1);
  std::uniform_real_distribution<double> u;
  std::normal_distribution<double> noise(0, 0.003 * diagonal);
  const Pose T = Pose(Eigen::Translation3d(0.024 * diagonal / std::sqrt(3) * Vec3::Ones()) *
                      Eigen::AngleAxisd(2 * M_PI / 180, Vec3(1, 2, 3).normalized()));
  Points p(count, 3);
  for (int i = 0; i < count; ++i) {
    const auto t = pick(rng);
    double a = u(rng), b = u(rng);
    if (a + b > 1) a = 1 - a, b = 1 - b;
    Vec3 q = (1 - a - b) * m.vertices_m.row(m.triangles(t, 0)) + a * m.vertices_m.row(m.triangles(t, 1)) +
             b * m.vertices_m.row(m.triangles(t, 2));
    q += Vec3(noise(rng), noise(rng), noise(rng));
    p.row(i) = (displaced ? T * q : q).transpose();
  }
  return p;
}

void closest(benchmark::State& state, bool displaced, bool hint) {
  const geometry::TriangleTree tree(bumpy(static_cast<int>(state.range(0))));
  const Points p = samples(tree.mesh(), 100000, displaced);
  std::vector<Index> last(p.rows(), -1);
  double sum = 0;
  for (auto _ : state)
    for (Eigen::Index i = 0; i < p.rows(); ++i) {
      const auto c = tree.closest(p.row(i).transpose(), hint ? last[i] : -1);
      last[i] = c.triangle;
      sum += c.squared_distance_m2;
    }
  benchmark::DoNotOptimize(sum);
  state.SetItemsProcessed(state.iterations() * p.rows());
  state.counters["triangles"] = static_cast<double>(tree.mesh().triangles.rows());
}

void build(benchmark::State& state) {
  const TriMesh m = bumpy(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(geometry::TriangleTree(m));
}

void refit(benchmark::State& state) {
  geometry::TriangleTree tree(bumpy(static_cast<int>(state.range(0))));
  const Points p = tree.mesh().vertices_m * 1.01;
  for (auto _ : state) tree.refit(p);
}

BENCHMARK_CAPTURE(closest, near, false, false)->Arg(42)->Arg(132)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(closest, near_with_hint, false, true)->Arg(42)->Arg(132)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(closest, displaced, true, false)->Arg(42)->Arg(132)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(closest, displaced_with_hint, true, true)->Arg(42)->Arg(132)->Unit(benchmark::kMillisecond);
BENCHMARK(build)->Arg(42)->Arg(132)->Unit(benchmark::kMillisecond);
BENCHMARK(refit)->Arg(42)->Arg(132)->Unit(benchmark::kMillisecond);

}  // namespace
