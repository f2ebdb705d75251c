// SPDX-License-Identifier: Apache-2.0
// The paper's measure of time: one more sample of force and displacement (one force, 10 000 points of the deformed surface) turned
// into E and nu, everything included: correspondence, solves, posterior. The object is a ball of about the paper's
// 815 linear tetrahedra (tetrahedra:815), or of a hundred thousand, or what `identify` makes of a ball's surface at its automatic
// settings (tetrahedra:0).
//   set-up    from the mesh to answers at any nu: assembly, ordering, factorisations
//   sample    the k-th sample added to the k - 1 before it, to the new E, nu and their intervals
// CPU time of one thread.
#include <benchmark/benchmark.h>

#include <cmath>
#include <map>
#include <random>

#include "palpate/estimation/growing_fit.hpp"
#include "palpate/geometry/tetrahedralise.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/lab/implicit_surface.hpp"

namespace palpate {
namespace {

constexpr double radius_m = 0.06, young_pa = 2e4, poisson = 0.3, sigma_m = 2e-3;
constexpr int samples = 6;

/// A ball that stands on z = 0.
TriMesh ball() {
  const Vec3 centre(0, 0, 0.85 * radius_m);
  return lab::implicit_surface([&](const Vec3& p) { return (p - centre).norm() - radius_m; },
                               {Vec3(-0.07, -0.07, 0), Vec3(0.07, 0.07, 0.12), 0.004});
}

struct Bench {
  Recording recording;
  estimation::SimulatedObject object;
  estimation::Inputs inputs;

  /// @param tetrahedra  asked of the mesher; 0: the mesh that `identify` makes of a surface
  /// @param points      depths a sample
  Bench(int tetrahedra, int points) {
    const bool automatic = tetrahedra == 0;
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
      recording.rest.surface = ball();
    } else {
      geometry::TetrahedraliseOptions options;
      options.tetrahedra = tetrahedra;
      recording.rest.volume = geometry::tetrahedralise(ball(), options).mesh;
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

const Bench& bench(std::int64_t tetrahedra, std::int64_t points) {
  static std::map<std::pair<std::int64_t, std::int64_t>, Bench> all;
  return all.try_emplace({tetrahedra, points}, int(tetrahedra), int(points)).first->second;
}

void set_up(benchmark::State& state) {
  const Bench& scene = bench(state.range(0), 10000);
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
  const Bench& scene = bench(state.range(0), state.range(1));
  const std::size_t count = static_cast<std::size_t>(state.range(2));
  estimation::FitOptions options;
  options.cross_checks = options.stresses = false;
  estimation::GrowingFit before(options);
  for (std::size_t k = 1; k < count; ++k) before.update(scene.first(k), scene.object, scene.seen(k));
  double error = 0, evaluated = 0, iterations = 0;
  double nudge_m = 0;  // so that no answer of an earlier round is asked for again
  for (auto _ : state) {
    state.PauseTiming();
    estimation::GrowingFit now = before;
    const Recording recording = scene.first(count);
    estimation::Inputs inputs = scene.seen(count);
    nudge_m += 1e-7;
    std::get<estimation::RayObservation>(inputs.back()[0]).rays.range_m.array() += nudge_m;
    state.ResumeTiming();
    const Identification answer = now.update(recording, scene.object, inputs);
    error = std::log(answer.parameters[0].value / young_pa);
    evaluated = now.steps_evaluated();
    iterations = answer.fit.iterations;
    before.memory() = now.memory();
  }
  state.counters["E_error_percent"] = 100 * error;
  state.counters["facets"] = double(scene.object.surface.rest().triangles.rows());
  state.counters["steps_evaluated"] = evaluated;
  state.counters["iterations"] = iterations;
}

BENCHMARK(set_up)->ArgName("tetrahedra")->Arg(815)->Arg(0)->Arg(100000)->Unit(benchmark::kMillisecond);
BENCHMARK(sample)
    ->ArgNames({"tetrahedra", "points", "k"})
    ->ArgsProduct({{815, 0}, {10000, 30000}, {2, 4, 6}})
    ->Args({100000, 10000, 6})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace palpate
