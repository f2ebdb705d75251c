// SPDX-License-Identifier: Apache-2.0
// Factorisations, solves and conjugate gradients on the pressed cube. Arguments: cells along an edge (6: 1080 linear
// tetrahedra, 13: 10 985, 27: 98 415), Poisson ratio in thousandths, threads.
#include <benchmark/benchmark.h>

#include <memory>

#include "benchmarks/cube.hpp"
#include "palpate/fem/linear_solver.hpp"
#include "palpate/fem/linear_solver/front_factor.hpp"

namespace palpate::fem {
namespace {

struct Problem {
  explicit Problem(const benchmark::State& state) : n(static_cast<int>(state.range(0))) {
    const TetMesh mesh = benchmark_cube::mesh(n);
    lower = benchmark_cube::stiffness(mesh, n, 1e-3 * static_cast<double>(state.range(1)));
    load = benchmark_cube::disc_load(mesh, n);
    placement = benchmark_cube::placement(mesh, n);
  }
  int n;
  Eigen::SparseMatrix<double> lower;
  MatrixX load;
  UnknownPlacement placement;
};

void order_and_analyse(benchmark::State& state) {
  const Problem problem(state);
  for (auto _ : state) benchmark::DoNotOptimize(build_front_tree(problem.lower, 3));
}

template <class T>
void factorise(benchmark::State& state) {
  const Problem problem(state);
  const auto tree = std::make_shared<const FrontTree>(build_front_tree(problem.lower, 3));
  FrontFactor<T> factor(tree, static_cast<int>(state.range(2)));
  for (auto _ : state) benchmark::DoNotOptimize(factor.factorise(problem.lower.valuePtr(), true));
  state.counters["flop/s"] = benchmark::Counter(tree->flops, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["megabytes"] = 1e-6 * static_cast<double>(factor.bytes());
}

template <class T>
void solve(benchmark::State& state) {
  const Problem problem(state);
  FrontFactor<T> factor(std::make_shared<const FrontTree>(build_front_tree(problem.lower, 3)), 1);
  if (!factor.factorise(problem.lower.valuePtr(), true)) return state.SkipWithError("not positive definite");
  MatrixX x = problem.load.replicate(1, state.range(2));
  for (auto _ : state) factor.solve(x.data(), x.cols(), x.outerStride());
}

void solver(benchmark::State& state, LinearMethod method) {
  const Problem problem(state);
  LinearSolver linear({.method = method, .threads = static_cast<int>(state.range(2)), .tolerance = 1e-8});
  linear.analyse(problem.lower, problem.placement);
  LinearSolver::Outcome outcome;
  for (auto _ : state) {
    linear.set_matrix(problem.lower);
    MatrixX x = problem.load;
    outcome = linear.solve_in_place(x);
  }
  if (!outcome.solved) return state.SkipWithError(outcome.reason.c_str());
  state.SetLabel(name_of(outcome.used));
  state.counters["steps"] = outcome.iterations;
}

void sizes(benchmark::internal::Benchmark* b) {
  for (const int n : {6, 13, 27}) b->Args({n, 300, 1});
  b->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
}
void sizes_and_threads(benchmark::internal::Benchmark* b) {
  for (const int n : {6, 13, 27}) b->Args({n, 300, 1})->Args({n, 300, 2});
  b->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
}
void sizes_and_columns(benchmark::internal::Benchmark* b) {
  for (const int n : {6, 13, 27}) b->Args({n, 300, 1})->Args({n, 300, 16});
  b->Unit(benchmark::kMillisecond);
}
void sizes_and_ratios(benchmark::internal::Benchmark* b) {
  for (const int n : {6, 13, 27}) b->Args({n, 300, 1})->Args({n, 490, 1});
  b->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
}

BENCHMARK(order_and_analyse)->Apply(sizes);
BENCHMARK(factorise<double>)->Apply(sizes_and_threads);
BENCHMARK(factorise<float>)->Apply(sizes_and_threads);
BENCHMARK(solve<double>)->Apply(sizes_and_columns);
BENCHMARK(solve<float>)->Apply(sizes_and_columns);
BENCHMARK_CAPTURE(solver, direct, LinearMethod::direct)->Apply(sizes_and_ratios);
BENCHMARK_CAPTURE(solver, mixed, LinearMethod::mixed)->Apply(sizes_and_ratios);
BENCHMARK_CAPTURE(solver, iterative, LinearMethod::iterative)->Apply(sizes_and_ratios);
BENCHMARK_CAPTURE(solver, automatic, LinearMethod::automatic)->Apply(sizes_and_ratios);

}  // namespace
}  // namespace palpate::fem
