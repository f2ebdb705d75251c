// SPDX-License-Identifier: Apache-2.0
// Newton's method on the pressed cube at 10 N (disc of 25 mm radius), relative residual 1e-8, from rest; and the product of
// the same matrix with a vector, by which machines are aligned. Arguments: cells along an edge (6: 1080 linear tetrahedra,
// 13: 10 985, 27: 98 415, 47: 519 115), threads.
#include <benchmark/benchmark.h>

#include "benchmarks/cube.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/linear_solver/aggregates.hpp"
#include "palpate/fem/linear_solver/block_matrix.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {
namespace {

void newton(benchmark::State& state, const char* material, double poisson) {
  const TetMesh mesh = benchmark_cube::mesh(static_cast<int>(state.range(0)));
  const double edge = benchmark_cube::kEdge;
  Boundary boundary;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i)
    if (mesh.nodes_m(i, 2) < 1e-9) boundary.constraints.push_back({i, Mat3::Identity(), 3});
  boundary.forces = spread_over_patch(mesh, {edge / 2, edge / 2, edge}, benchmark_cube::kDiscRadius);
  StaticsOptions options;
  options.residual_tolerance = 1e-8;
  options.threads = static_cast<int>(state.range(1));
  const Statics statics(mesh, material, boundary, options);
  const Vec3 force(0, 0, -benchmark_cube::kForce);
  Equilibrium e;
  for (auto _ : state) {
    e = statics.solve(benchmark_cube::kYoung, poisson, force, VectorX());
    if (!e.converged) return state.SkipWithError(e.reason.c_str());
  }
  state.counters["steps"] = e.newton_steps;
  state.counters["residual"] = e.residual;
  state.counters["mean_depth_mm"] = -1e3 * (boundary.forces.col(2).transpose() * e.displacement_m).value();
}

void matrix_times_vector(benchmark::State& state) {
  const int cells = static_cast<int>(state.range(0));
  const TetMesh mesh = benchmark_cube::mesh(cells);
  const Eigen::SparseMatrix<double> lower = benchmark_cube::stiffness(mesh, cells, 0.3);
  const QuotientGraph graph = quotient_graph(lower, 3);
  const Aggregates aggregates = aggregate(graph, benchmark_cube::placement(mesh, cells), 64);
  BlockMatrix matrix(lower, graph, aggregates.order);
  matrix.set_values(lower.valuePtr());
  const VectorX x = VectorX::Random(matrix.padded_size());
  VectorX y(matrix.padded_size());
  for (auto _ : state) {
    matrix.multiply(x.data(), y.data(), 0, matrix.block_rows());
    benchmark::DoNotOptimize(y.data());
  }
  state.counters["blocks"] = static_cast<double>(matrix.block_count());
}

void sizes(benchmark::internal::Benchmark* b) {
  for (const int n : {6, 13, 27, 47}) b->Args({n, 1});
  b->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
}
void all_sizes(benchmark::internal::Benchmark* b) {
  for (const int n : {6, 13, 27, 47})
    for (const int threads : {1, 2}) b->Args({n, threads});
  b->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
}

BENCHMARK_CAPTURE(newton, corotational, "corotational", 0.3)->Apply(sizes);
BENCHMARK_CAPTURE(newton, corotational_wall, "corotational", 0.3)->Apply(all_sizes);
BENCHMARK_CAPTURE(newton, neo_hookean, "neo_hookean", 0.3)->Apply(sizes);
BENCHMARK_CAPTURE(newton, neo_hookean_nu_49, "neo_hookean", 0.49)->Apply(sizes);
BENCHMARK(matrix_times_vector)->Apply(sizes);

}  // namespace
}  // namespace palpate::fem
