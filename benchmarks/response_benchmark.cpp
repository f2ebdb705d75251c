// SPDX-License-Identifier: Apache-2.0
// What one contact costs: making a Response of the pressed cube and asking it. Arguments: cells along an edge (5: 625 linear
// tetrahedra, 6: 1080, 13: 10 985, 27: 98 415), threads.
#include <benchmark/benchmark.h>

#include "benchmarks/cube.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/response_nuisances.hpp"

namespace palpate::fem {
namespace {

/// The top face of the pressed cube and the mean motion under the contact are watched; six columns: force, shift, radius.
struct Contact {
  explicit Contact(const benchmark::State& state, bool quadratic = false)
      : mesh(benchmark_cube::mesh(static_cast<int>(state.range(0)))) {
    if (quadratic) mesh = to_quadratic(mesh);
    options.statics.threads = static_cast<int>(state.range(1));
    const double edge = benchmark_cube::kEdge;
    boundary.forces = contact_columns(mesh, {edge / 2, edge / 2, edge}, benchmark_cube::kDiscRadius, -Vec3::UnitZ()).forces;
    std::vector<Eigen::Triplet<double>> rows;
    int row = 0;
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
      if (mesh.nodes_m(i, 2) < 1e-9) boundary.constraints.push_back({i, Mat3::Identity(), 3});
      if (mesh.nodes_m(i, 2) < edge - 1e-9) continue;
      for (int c = 0; c < 3; ++c) rows.emplace_back(row++, 3 * i + c, 1.0);
    }
    watched.resize(row, 3 * mesh.nodes_m.rows());
    watched.setFromTriplets(rows.begin(), rows.end());
    load = -benchmark_cube::kForce * VectorX::Unit(6, 2);
    options.poisson_lower = 0.05;
    options.poisson_upper = 0.49;
    options.branch_force_over_young = 0.5 * load / benchmark_cube::kYoung;
  }
  TetMesh mesh;
  Boundary boundary;
  Eigen::SparseMatrix<double> watched;
  VectorX load;
  Response::Options options;
};

void set_up(benchmark::State& state, const char* material, bool quadratic) {
  const Contact contact(state, quadratic);
  int solves = 0;
  double error = 0;
  for (auto _ : state) {
    const Response response(contact.mesh, material, contact.boundary, contact.watched, contact.options);
    const ResponseState first = response.at({benchmark_cube::kYoung, 0.3, 0.4 * contact.load, VectorX(0)});
    if (!first.converged) return state.SkipWithError(first.reason.c_str());
    solves = response.solves();
    error = first.error;
  }
  state.counters["solves"] = solves;
  state.counters["error"] = error;
}

void evaluate(benchmark::State& state, const char* material, bool quadratic) {
  const Contact contact(state, quadratic);
  const Response response(contact.mesh, material, contact.boundary, contact.watched, contact.options);
  double nu = 0.1;
  response.at({benchmark_cube::kYoung, nu, 0.4 * contact.load, VectorX(0)});  // makes the polynomial
  for (auto _ : state) {
    nu = nu > 0.4 ? 0.1 : nu + 1e-4;  // never the same twice
    benchmark::DoNotOptimize(response.at({benchmark_cube::kYoung, nu, 0.4 * contact.load, VectorX(0)}));
  }
  state.counters["rows"] = static_cast<double>(contact.watched.rows());
}

void sizes(benchmark::internal::Benchmark* b) {
  for (const int n : {5, 6, 13, 27}) b->Args({n, 1})->Args({n, 2});
  b->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
}
void small_sizes(benchmark::internal::Benchmark* b) {
  for (const int n : {5, 6}) b->Args({n, 1});
  b->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
}
void evaluations(benchmark::internal::Benchmark* b) {
  for (const int n : {5, 6, 13, 27}) b->Args({n, 1});
  b->Unit(benchmark::kMicrosecond);
}
void small_evaluations(benchmark::internal::Benchmark* b) {
  for (const int n : {5, 6}) b->Args({n, 1});
  b->Unit(benchmark::kMicrosecond);
}

BENCHMARK_CAPTURE(set_up, linear, "linear", false)->Apply(sizes);
BENCHMARK_CAPTURE(set_up, linear_tet10, "linear", true)->Apply(small_sizes);
BENCHMARK_CAPTURE(set_up, neo_hookean, "neo_hookean", false)->Apply(small_sizes);
BENCHMARK_CAPTURE(evaluate, linear, "linear", false)->Apply(evaluations);
BENCHMARK_CAPTURE(evaluate, neo_hookean, "neo_hookean", false)->Apply(small_evaluations);

}  // namespace
}  // namespace palpate::fem
