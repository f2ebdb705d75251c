// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_trial.hpp"

#include <chrono>
#include <cmath>
#include <limits>

#include "palpate/estimation/finer_model.hpp"
#include "palpate/estimation/paper_method.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"

namespace palpate::cli {
namespace {

using Clock = std::chrono::steady_clock;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

MethodAnswer summary(const Identification& answer, double seconds) {
  MethodAnswer out;
  if (answer.parameters.size() < 2) {  // stopped before there was an answer
    out.young_modulus_pa = out.poisson_ratio = out.lower_95_pa = out.upper_95_pa = nan;
    return out;
  }
  const Parameter &young = answer.parameters[0], &poisson = answer.parameters[1];
  out.young_modulus_pa = young.value;
  out.poisson_ratio = poisson.value;
  out.lower_95_pa = young.lower_95;
  out.upper_95_pa = young.upper_95;
  out.solves = answer.fit.solves;
  out.iterations = answer.fit.iterations;
  out.seconds = seconds;
  out.converged = answer.termination == Termination::converged;
  out.path = answer.trace;
  for (const Verdict& verdict : answer.verdicts) out.verdicts.push_back(verdict.code);
  return out;
}

/// What both methods are given: a recording with its object built and its points ready.
struct Prepared {
  Recording recording;
  estimation::SimulatedObject object;
  estimation::Inputs inputs;
};

/// Both methods are given every n-th pixel: about as many points a sample as the paper's time-of-flight camera has (3200).
constexpr Index most_points = 2000;
/// Squared distances have no defence against what is not the object (flying pixels, the table's edge), and the paper's points
/// were cut to the object: so are those of both methods here.
constexpr double near_object_m = 0.025;

RayCloud thinned(const RayCloud& all, const geometry::TriangleTree& rest) {
  std::vector<Index> near;
  for (Index i = 0; i < static_cast<Index>(all.range_m.size()); ++i) {
    const Vec3 point_m = Vec3(all.origins_m.row(i)) + all.range_m(i) * Vec3(all.directions.row(i));
    if (rest.closest(point_m).squared_distance_m2 < near_object_m * near_object_m) near.push_back(i);
  }
  const std::size_t stride = std::max<std::size_t>(1, (near.size() + most_points - 1) / most_points);
  std::vector<Index> rows;
  for (std::size_t i = 0; i < near.size(); i += stride) rows.push_back(near[i]);
  RayCloud out{all.origins_m(rows, Eigen::all), all.directions(rows, Eigen::all), all.range_m(rows), all.sigma_m(rows), {}};
  if (all.pixel.rows() == all.range_m.size()) out.pixel = all.pixel(rows, Eigen::all);
  return out;
}

Prepared prepare(Recording recording, const OnProgress& progress) {
  Prepared out;
  out.inputs = observe(recording);
  out.object = build_simulated_object(recording, progress);
  const geometry::TriangleTree rest(out.object.surface.rest());
  for (auto& step : out.inputs)
    for (auto& input : step)
      if (auto* seen = std::get_if<estimation::RayObservation>(&input)) seen->rays = thinned(seen->rays, rest);
  out.recording = std::move(recording);
  return out;
}

/// Some steps of it: keep(push, step) says which.
template <class Keep>
Prepared part_of(const Prepared& all, Keep&& keep) {
  Prepared out{all.recording, all.object, {}};
  out.recording.pushes.clear();
  std::size_t flat = 0;
  for (std::size_t p = 0; p < all.recording.pushes.size(); ++p) {
    Push push = all.recording.pushes[p];
    push.steps.clear();
    for (std::size_t s = 0; s < all.recording.pushes[p].steps.size(); ++s, ++flat) {
      if (!keep(p, s)) continue;
      push.steps.push_back(all.recording.pushes[p].steps[s]);
      out.inputs.push_back(all.inputs[flat]);
    }
    if (!push.steps.empty()) out.recording.pushes.push_back(std::move(push));
  }
  return out;
}

bool loaded(const Step& step) { return !step.loads.empty() && step.loads[0].force_n && step.loads[0].force_n->norm() > 0; }

MethodAnswer by_paper(const Prepared& given, const estimation::FitOptions& options, const OnProgress& progress) {
  const auto start = Clock::now();
  const Identification answer = estimation::fit_as_in_paper(given.recording, given.object, given.inputs, options, progress);
  return summary(answer, std::chrono::duration<double>(Clock::now() - start).count());
}

MethodAnswer by_palpate(const Prepared& given, const estimation::FitOptions& options, const OnProgress& progress,
                        const estimation::FinerModel* finer = nullptr) {
  const auto start = Clock::now();
  const Identification answer = estimation::fit(given.recording, given.object, given.inputs, options, progress, finer);
  return summary(answer, std::chrono::duration<double>(Clock::now() - start).count());
}

ErrorSurface error_surface(const Prepared& given, const MethodAnswer& found, double true_young_pa, int side,
                           const estimation::FitOptions& options, const OnProgress& progress) {
  estimation::PaperError error(given.recording, given.object, given.inputs, options);
  ErrorSurface out;
  // Wide enough for the truth and for where the method ended.
  const double low = std::log(std::min(true_young_pa, found.young_modulus_pa) / 1.8),
               high = std::log(std::max(true_young_pa, found.young_modulus_pa) * 1.8);
  out.young_modulus_pa = VectorX::LinSpaced(side, low, high).array().exp();
  out.poisson_ratio = VectorX::LinSpaced(side, 0.02, 0.49);
  out.error_m2.resize(side, side);
  for (int i = 0; i < side; ++i) {
    for (int k = 0; k < side; ++k) out.error_m2(i, k) = error(out.young_modulus_pa(i), out.poisson_ratio(k));
    if (progress && !progress("error surface", (i + 1.0) / side)) break;
  }
  out.at_found_m2 = error(found.young_modulus_pa, found.poisson_ratio);
  return out;
}

void answer_samples(const Prepared& given, int every, const estimation::FitOptions& options, TrialAnswer& out, const OnProgress& progress) {
  estimation::FitOptions alone = options;
  alone.cross_checks = alone.stresses = false;
  std::size_t count = 0, done = 0;
  for (const Push& push : given.recording.pushes) count += push.steps.size();
  for (std::size_t p = 0; p < given.recording.pushes.size(); ++p) {
    const Push& push = given.recording.pushes[p];
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      if (progress && !progress("samples alone", static_cast<double>(done++) / static_cast<double>(count))) return;
      if (!loaded(push.steps[s]) || s % static_cast<std::size_t>(every) != 0) continue;
      const Load& load = push.steps[s].loads[0];
      SampleAnswer sample;
      sample.push = push.name;
      sample.force_n = load.force_n->dot(load.direction.normalized());
      sample.travel_m = nan;
      for (const auto& observation : push.steps[s].observations)
        if (const auto* travel = std::get_if<ToolTravel>(&observation)) sample.travel_m = travel->travel_m;
      // Ours may use the unloaded frame of the push as well; the paper's method has no use for it.
      sample.paper = by_paper(part_of(given, [&](std::size_t q, std::size_t t) { return q == p && t == s; }), alone, {});
      sample.palpate = by_palpate(
          part_of(given, [&](std::size_t q, std::size_t t) { return q == p && (t == s || !loaded(push.steps[t])); }), alone, {});
      out.samples.push_back(std::move(sample));
    }
  }
}

/// The last push, predicted by what the others taught: rms distance of its points to the simulated surface.
void hold_out(const Prepared& given, const estimation::FitOptions& options, TrialAnswer& out, const OnProgress& progress) {
  out.held_out_paper_m = out.held_out_palpate_m = out.held_out_still_m = nan;
  const std::size_t last = given.recording.pushes.size() - 1;
  if (last == 0) return;
  estimation::FitOptions alone = options;
  alone.cross_checks = alone.stresses = false;
  const Prepared others = part_of(given, [&](std::size_t p, std::size_t) { return p != last; });
  const Prepared held = part_of(given, [&](std::size_t p, std::size_t s) { return p == last && loaded(given.recording.pushes[p].steps[s]); });
  if (held.inputs.empty()) return;
  estimation::PaperError distance(held.recording, held.object, held.inputs, options);
  const auto rms = [&](double young_pa, double nu) { return std::sqrt(distance(young_pa, nu)); };
  const MethodAnswer paper = by_paper(others, alone, progress), palpate = by_palpate(others, alone, progress);
  if (!std::isfinite(paper.young_modulus_pa) || !std::isfinite(palpate.young_modulus_pa)) return;  // stopped
  out.held_out_paper_m = rms(paper.young_modulus_pa, paper.poisson_ratio);
  out.held_out_palpate_m = rms(palpate.young_modulus_pa, palpate.poisson_ratio);
  out.held_out_still_m = rms(1e12, 0.3);
}

}  // namespace

TrialAnswer run_trial(const lab::PaperScene& scene, std::uint64_t seed, const TrialOptions& options, const OnProgress& progress) {
  lab::PaperTrial trial = scene.make(seed, progress);
  TrialAnswer out;
  out.seed = seed;
  out.young_modulus_pa = trial.young_modulus_pa;
  out.poisson_ratio = trial.poisson_ratio;
  estimation::FitOptions fit;
  fit.threads = options.threads;

  Recording coarse = trial.recording;
  const Prepared given = prepare(std::move(trial.recording), progress);
  out.tetrahedra = static_cast<Index>(given.object.mesh.tetrahedra.rows());
  const auto finer = estimation::finer_model(given.recording, given.object);
  out.paper = by_paper(given, fit, progress);
  out.palpate = by_palpate(given, fit, progress, finer ? &*finer : nullptr);

  coarse.model.element = "tet4";
  coarse.model.refine = "none";
  out.paper_coarse = by_paper(prepare(std::move(coarse), progress), fit, progress);

  hold_out(given, fit, out, progress);
  if (options.every_sample > 0) answer_samples(given, options.every_sample, fit, out, progress);
  if (options.surface_points > 1 && std::isfinite(out.paper.young_modulus_pa))
    out.surface = error_surface(given, out.paper, out.young_modulus_pa, options.surface_points, fit, progress);
  return out;
}

}  // namespace palpate::cli
