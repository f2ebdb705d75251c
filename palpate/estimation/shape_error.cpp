// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/shape_error.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::estimation {
namespace {

constexpr double deviations = 1.5;     // that the farthest alternative lies away: errors of 18 labs were 0.6 of its change, rms
constexpr Index rays_a_frame = 1500;   // the same few for every shape: only how the answers differ counts
constexpr double strange_pull = 3;     // of what a push's instruments are off by
constexpr double clearly_better = 10;  // in half of chi-square

Inputs thinned(const Inputs& all, double& share) {
  Inputs few = all;
  double kept = 0, count = 0;
  for (auto& step : few) {
    for (auto& input : step) {
      auto* frame = std::get_if<RayObservation>(&input);
      if (frame == nullptr) continue;
      const RayCloud rays = frame->rays;
      const Index stride = std::max<Index>(1, static_cast<Index>(rays.range_m.size()) / rays_a_frame);
      std::vector<Index> rows;
      for (Index i = 0; i < rays.range_m.size(); i += stride) rows.push_back(i);
      frame->rays = {rays.origins_m(rows, Eigen::all), rays.directions(rows, Eigen::all), rays.range_m(rows), rays.sigma_m(rows), {}};
      if (rays.pixel.rows() == rays.range_m.size()) frame->rays.pixel = rays.pixel(rows, Eigen::all);
      kept += static_cast<double>(rows.size()), count += static_cast<double>(rays.range_m.size());
    }
  }
  share = count > 0 ? kept / count : 1;
  return few;
}

struct Answer {
  VectorX parameters;  ///< log E of the first region, nu, log E of the others over the first
  double cost = 0;
  bool strange = false;  ///< wants an instrument to be off by more than it is
};

bool about_instruments(const std::string& name) {
  return name.starts_with("travel_zero") || name.starts_with("travel_offset") || name.starts_with("force_tare") || name.starts_with("force_scale");
}

std::optional<Answer> answer_of(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, const Objective& objective, const Optimum& optimum,
                                 const Loss& loss, const FitOptions& options, const OptimiseOptions& optimiser,
                                 const OnProgress& progress) {
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns, statics_options(recording, object, options));
  Objective other(model, inputs, unknowns);
  const Unknowns& known = objective.unknowns();
  for (int k : {log_young, poisson}) unknowns[k] = known[k];
  // the rest surface's error has modes of its own on each shape
  std::map<std::string, int> place;
  for (int k = 0; k < known.size(); ++k)
    if (known[k].name.rfind("rest_surface[", 0) != 0) place[known[k].name] = k;
  VectorX start = unknowns.prior_mean();
  for (int k = 0; k < unknowns.size(); ++k)
    if (const auto it = place.find(unknowns[k].name); it != place.end()) start(k) = optimum.unknowns(it->second);
  OptimiseOptions quiet = optimiser;
  quiet.on_accepted = {};
  const Optimum found = optimise(other, start, loss, quiet, progress);
  if (found.termination != Termination::converged || !found.evaluation.usable) return std::nullopt;
  Answer answer{found.unknowns.head(unknowns.parameter_count()), found.evaluation.cost};
  for (int k = 0; k < unknowns.size(); ++k)
    answer.strange = answer.strange || (about_instruments(unknowns[k].name) &&
                                        std::abs(found.unknowns(k) - unknowns[k].prior_mean) > strange_pull * unknowns[k].prior_std);
  return answer;
}

}  // namespace

std::optional<ShapeEffect> shape_effect(const ShapeDoubt& doubt, const Recording& recording, const Inputs& inputs, const Objective& objective, const Optimum& optimum,
                                        const Loss& loss, const FitOptions& options, const OptimiseOptions& optimiser,
                                        const OnProgress& progress) {
  double share = 1;
  const Inputs few = thinned(inputs, share);
  Loss weighed = loss;  // fewer neighbours, less that they share
  weighed.rays.clear();
  weighed.surface_weight = std::min(1.0, loss.surface_weight / share / (loss.noise ? loss.noise->of_wide : 1));
  weighed.noise = nullptr;
  const auto fitted = answer_of(recording, objective.model().object(), few, objective, optimum, weighed, options, optimiser, progress);
  if (!fitted) return std::nullopt;
  std::vector<std::optional<Answer>> alternatives(doubt.shapes.size());
  for (std::size_t s = 0; s < doubt.shapes.size(); ++s) {
    if (progress && !progress("unseen side", static_cast<double>(s) / static_cast<double>(doubt.shapes.size()))) return std::nullopt;
    try {
      alternatives[s] = answer_of(doubt.shapes[s].recording, doubt.shapes[s].object, few, objective, optimum, weighed, options, optimiser, {});
    } catch (const Error&) {  // it is not held, or a tool does not reach it: no such shape was pushed
    }
  }
  Answer best = *fitted;
  std::optional<std::size_t> better;
  for (std::size_t s = 0; s < alternatives.size(); ++s) {
    if (!doubt.shapes[s].as_likely || !alternatives[s] || alternatives[s]->strange) continue;
    if (alternatives[s]->cost < best.cost - clearly_better) best = *alternatives[s], better = s;
  }
  const VectorX here = best.parameters;
  std::optional<ShapeEffect> out;
  double softest = here(log_young), stiffest = softest;
  VectorX most = VectorX::Zero(here.size());
  if (better) alternatives.push_back(fitted);
  for (const auto& there : alternatives) {
    if (!there) continue;
    if (!out) out.emplace();
    if (there->strange && !best.strange) continue;
    const VectorX moved = there->parameters - here;
    softest = std::min(softest, there->parameters(log_young)), stiffest = std::max(stiffest, there->parameters(log_young));
    if (std::abs(moved(log_young)) > std::abs(most(log_young))) most = moved;
  }
  if (!out) return out;
  out->better = better;
  most /= deviations;
  out->shift.log_young = most(log_young);
  out->shift.poisson = most(poisson);
  out->shift.region_log_young = most.tail(most.size() - first_ratio).array() + most(log_young);
  out->softest_pa = std::exp(softest);
  out->stiffest_pa = std::exp(stiffest);
  return out;
}

}  // namespace palpate::estimation
