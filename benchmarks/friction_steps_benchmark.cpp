// SPDX-License-Identifier: Apache-2.0
// Five steps of a cube that is pressed on a rough table (10 N on the 25 mm disc, slightly aside), as a fit asks for them:
// from rest, and again at other parameters with the steps' last solutions as guesses. Counters: Newton steps and
// factorisations a sweep.
#include <benchmark/benchmark.h>

#include <vector>

#include "cube.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/contact_statics.hpp"

namespace {

using namespace palpate;
using namespace palpate::fem;

ContactStatics rough_cube(int cells) {
  const TetMesh mesh = to_quadratic(benchmark_cube::mesh(cells));
  Boundary boundary;
  boundary.forces = spread_over_patch(mesh, Vec3(0.075, 0.075, 0.15), 0.025);
  RigidContact table;
  table.shape = plane_shape();
  table.law = Touch::friction;
  table.friction_coefficient = 0.6;
  table.T_base_tool = tool_pose(Vec3(0.075, 0.075, 0), Vec3::UnitZ());
  ContactOptions options;
  options.statics.dilatation = Dilatation::averaged;
  options.statics.residual_tolerance = 1e-8;
  return ContactStatics(mesh, "neo_hookean", boundary, {table}, options);
}

std::vector<ContactEquilibrium> sweep(const ContactStatics& body, double young_pa, double poisson,
                                      const std::vector<ContactEquilibrium>* guesses) {
  std::vector<ContactEquilibrium> steps;
  for (int s = 0; s < 5; ++s) {
    ContactLoads loads = body.no_loads();
    loads.force_coefficients = Vec3(0.02 * s, -0.01 * s, -2.0 * (s + 1));
    const ContactEquilibrium* from = steps.empty() ? nullptr : &steps.back();
    steps.push_back(body.solve(young_pa, poisson, loads, from, {}, guesses ? &(*guesses)[steps.size()] : nullptr));
  }
  return steps;
}

void count(benchmark::State& state, const std::vector<ContactEquilibrium>& steps) {
  double newton = 0, factorisations = 0;
  for (const ContactEquilibrium& e : steps) {
    if (!e.converged) state.SkipWithError(e.reason.c_str());
    newton += e.newton_steps;
    factorisations += e.factorisations;
  }
  state.counters["newton"] = newton;
  state.counters["factorisations"] = factorisations;
}

void from_rest(benchmark::State& state) {
  ContactStatics body = rough_cube(static_cast<int>(state.range(0)));
  std::vector<ContactEquilibrium> steps;
  for (auto _ : state) {
    body.forget();
    steps = sweep(body, 14e3, 0.28, nullptr);
  }
  count(state, steps);
}
BENCHMARK(from_rest)->Arg(5)->Arg(8)->Unit(benchmark::kMillisecond);

void guessed(benchmark::State& state) {
  ContactStatics body = rough_cube(static_cast<int>(state.range(0)));
  const auto before = sweep(body, 13e3, 0.3, nullptr);
  std::vector<ContactEquilibrium> steps;
  for (auto _ : state) steps = sweep(body, 14e3, 0.28, &before);
  count(state, steps);
}
BENCHMARK(guessed)->Arg(5)->Arg(8)->Unit(benchmark::kMillisecond);

}  // namespace
