// SPDX-License-Identifier: Apache-2.0
// The paper's measure of time: one more sample of force and displacement (one force, 10 000 points of the deformed surface) turned
// into E and nu, everything included: correspondence, solves, posterior. The object has the paper's 815 linear tetrahedra (a ball
// of 163 cells), or what `identify` makes of a ball's surface at its automatic settings.
//   set-up    from the mesh to answers at any nu: assembly, ordering, factorisations
//   sample    the k-th sample added to the k - 1 before it, to the new E, nu and their intervals
// CPU time of one thread.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>

#include "palpate/estimation/growing_fit.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/lab/implicit_surface.hpp"

namespace palpate {
namespace {

constexpr double radius_m = 0.06, young_pa = 2e4, poisson = 0.3, sigma_m = 2e-3;
constexpr int samples = 6, points = 10000;

/// The 163 cells of a lattice that are nearest to a ball's centre, five tetrahedra each; the lowest layer stands on z = 0.
TetMesh ball_of_cells() {
  constexpr int n = 9, wanted = 163;
  const double edge_m = 2 * radius_m / 7;
  std::vector<std::pair<double, std::array<int, 3>>> cells;
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x)
        cells.push_back({Vec3(x - n / 2, y - n / 2, z - n / 2).squaredNorm() + 1e-6 * (x + 3 * y + 7 * z), {x, y, z}});
  std::sort(cells.begin(), cells.end());
  cells.resize(wanted);
  constexpr int pattern[5][4] = {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}};
  std::map<std::array<int, 3>, Index> number;
  std::vector<Vec3> nodes;
  TetMesh mesh;
  mesh.tetrahedra.resize(5 * wanted, 4);
  Index row = 0;
  for (const auto& [distance, cell] : cells) {
    const int mirror = (cell[0] + cell[1] + cell[2]) % 2;
    for (const auto& tet : pattern) {
      for (int k = 0; k < 4; ++k) {
        const int bits = tet[k] ^ mirror;
        const std::array<int, 3> at{cell[0] + (bits & 1), cell[1] + (bits >> 1 & 1), cell[2] + (bits >> 2 & 1)};
        const auto [known, fresh] = number.emplace(at, static_cast<Index>(nodes.size()));
        if (fresh) nodes.push_back(edge_m * Vec3(at[0], at[1], at[2]));
        mesh.tetrahedra(row, k) = known->second;
      }
      const Vec3 a = nodes[std::size_t(mesh.tetrahedra(row, 0))], b = nodes[std::size_t(mesh.tetrahedra(row, 1))],
                 c = nodes[std::size_t(mesh.tetrahedra(row, 2))], d = nodes[std::size_t(mesh.tetrahedra(row, 3))];
      if ((b - a).cross(c - a).dot(d - a) < 0) std::swap(mesh.tetrahedra(row, 2), mesh.tetrahedra(row, 3));
      ++row;
    }
  }
  mesh.nodes_m.resize(static_cast<Index>(nodes.size()), 3);
  for (std::size_t i = 0; i < nodes.size(); ++i) mesh.nodes_m.row(static_cast<Index>(i)) = nodes[i];
  mesh.nodes_m.col(2).array() -= mesh.nodes_m.col(2).minCoeff();
  return mesh;
}

struct Bench {
  Recording recording;
  estimation::SimulatedObject object;
  estimation::Inputs inputs;

  /// @param automatic  the mesh that `identify` makes of a surface
  explicit Bench(bool automatic) {
    Support table;
    table.name = "table";
    table.kind = SupportKind::plane;
    table.select = NodeSelection::plane;
    table.tolerance_m = 1e-4;
    recording.supports = {table};
    Tool pad;
    pad.name = "pad";
    pad.shape = ToolShape::disc;
    pad.radius_m = 0.015;
    recording.tools = {pad};
    recording.model.material = "linear";
    if (automatic) {
      const Vec3 centre(0, 0, 0.85 * radius_m);
      recording.rest.surface = lab::implicit_surface([&](const Vec3& p) { return (p - centre).norm() - radius_m; },
                                                     {Vec3(-0.07, -0.07, 0), Vec3(0.07, 0.07, 0.12), 0.004});
    } else {
      recording.rest.volume = ball_of_cells();
      recording.model.element = "tet4";
      recording.model.refine = "none";
    }
    const Points& rest = automatic ? recording.rest.surface->vertices_m : recording.rest.volume->nodes_m;
    const Vec3 low = rest.colwise().minCoeff(), high = rest.colwise().maxCoeff(), middle = 0.5 * (low + high);
    Push push;
    push.name = "push";
    for (int k = 1; k <= samples; ++k) {
      Step step;
      step.time_s = k;
      Load load;
      load.tool = "pad";
      load.contact_m = Vec3(middle.x(), middle.y(), high.z());
      load.force_n = Vec3(0, 0, -0.5 * k);
      step.loads = {load};
      push.steps.push_back(step);
    }
    recording.pushes = {push};
    object = build_simulated_object(recording);

    estimation::Unknowns unknowns;
    estimation::ForwardModel model(recording, object, unknowns);
    VectorX truth = unknowns.prior_mean();
    truth(estimation::log_young) = std::log(young_pa);
    truth(estimation::poisson) = poisson;
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int k = 0; k < samples; ++k) {
      const geometry::TriangleTree tree({model.predict(std::size_t(k), truth, false).surface_m, object.surface.rest().triangles});
      const Vec3 eye(0.3, -0.35, 0.5);
      const Vec3 along = (middle - eye).normalized(), right = along.cross(Vec3::UnitZ()).normalized(), down = along.cross(right);
      estimation::RayObservation seen;
      seen.pose_std_m = 1e-3;
      seen.pose_std_rad = 3e-3;
      RayCloud& rays = seen.rays;
      rays.origins_m = eye.transpose().replicate(points, 1);
      rays.directions.resize(points, 3);
      rays.range_m.resize(points);
      rays.sigma_m = VectorX::Constant(points, sigma_m);
      rays.pixel.resize(points, 2);
      for (int i = 0; i < points;) {
        const double x = 0.12 * uniform(random), y = 0.12 * uniform(random);
        const Vec3 direction = (along + x * right + y * down).normalized();
        const auto hit = tree.cast(eye, direction);
        if (!hit) continue;
        rays.directions.row(i) = direction;
        rays.range_m(i) = hit->range_m + sigma_m * normal(random);
        rays.pixel.row(i) << static_cast<Index>(300 + 600 * x), static_cast<Index>(300 + 600 * y);
        ++i;
      }
      inputs.push_back({seen});
    }
  }

  /// The recording after so many samples.
  Recording first(std::size_t count) const {
    Recording part = recording;
    part.pushes[0].steps.resize(count);
    return part;
  }
  estimation::Inputs seen(std::size_t count) const { return {inputs.begin(), inputs.begin() + static_cast<std::ptrdiff_t>(count)}; }
};

const Bench& bench(bool automatic) {
  static const Bench small(false), large(true);
  return automatic ? large : small;
}

void set_up(benchmark::State& state) {
  const Bench& scene = bench(state.range(0) != 0);
  for (auto _ : state) {
    estimation::Unknowns unknowns;
    estimation::ForwardModel model(scene.recording, scene.object, unknowns, statics_options(scene.recording, scene.object, {}));
    VectorX at = unknowns.prior_mean();
    at(estimation::log_young) = std::log(young_pa);
    at(estimation::poisson) = poisson;
    benchmark::DoNotOptimize(model.predict(0, at).surface_m.sum());
  }
  state.counters["tetrahedra"] = double(scene.object.mesh.tetrahedra.rows());
}

void sample(benchmark::State& state) {
  const Bench& scene = bench(state.range(0) != 0);
  const std::size_t count = static_cast<std::size_t>(state.range(1));
  estimation::FitOptions options;
  options.cross_checks = options.stresses = false;
  estimation::GrowingFit before(options);
  for (std::size_t k = 1; k < count; ++k) before.update(scene.first(k), scene.object, scene.seen(k));
  double error = 0, evaluated = 0;
  for (auto _ : state) {
    state.PauseTiming();
    estimation::GrowingFit now = before;
    const Recording recording = scene.first(count);
    const estimation::Inputs inputs = scene.seen(count);
    state.ResumeTiming();
    const Identification answer = now.update(recording, scene.object, inputs);
    error = std::log(answer.parameters[0].value / young_pa);
    evaluated = now.steps_evaluated();
    before.memory() = now.memory();
  }
  state.counters["E_error_percent"] = 100 * error;
  state.counters["steps_evaluated"] = evaluated;
}

BENCHMARK(set_up)->ArgName("automatic")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(sample)->ArgNames({"automatic", "k"})->ArgsProduct({{0, 1}, {2, 4, 6}})->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace palpate
