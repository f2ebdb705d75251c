// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/shape_error.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::estimation {
namespace {

constexpr double deviations = 2;     // that an alternative lies away
constexpr Index rays_a_frame = 1500;  // the same few for every shape: only how the answers differ counts

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

/// log E of the first region, nu, log E of the others over the first.
std::optional<VectorX> answer_of(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, const Objective& objective, const Optimum& optimum,
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
  return found.unknowns.head(unknowns.parameter_count());
}

}  // namespace

std::optional<ShapeEffect> shape_effect(const ShapeDoubt& doubt, const Recording& recording, const Inputs& inputs, const Objective& objective, const Optimum& optimum,
                                        const Loss& loss, const FitOptions& options, const OptimiseOptions& optimiser,
                                        const OnProgress& progress) {
  double share = 1;
  const Inputs few = thinned(inputs, share);
  Loss weighed = loss;  // fewer neighbours, less that they share
  weighed.rays.clear();
  weighed.surface_weight = std::min(1.0, loss.surface_weight / share);
  const auto fitted = answer_of(recording, objective.model().object(), few, objective, optimum, weighed, options, optimiser, progress);
  if (!fitted) return std::nullopt;
  const VectorX here = *fitted;
  std::optional<ShapeEffect> out;
  double softest = here(log_young), stiffest = softest;
  VectorX most = VectorX::Zero(here.size());
  for (std::size_t s = 0; s < doubt.shapes.size(); ++s) {
    if (progress && !progress("unseen side", static_cast<double>(s) / static_cast<double>(doubt.shapes.size()))) return std::nullopt;
    std::optional<VectorX> there;
    try {
      there = answer_of(doubt.shapes[s].recording, doubt.shapes[s].object, few, objective, optimum, weighed, options, optimiser, {});
    } catch (const Error&) {  // it is not held, or a tool does not reach it: no such shape was pushed
    }
    if (!there) continue;
    const VectorX moved = *there - here;
    softest = std::min(softest, (*there)(log_young)), stiffest = std::max(stiffest, (*there)(log_young));
    if (!out || std::abs(moved(log_young)) > std::abs(most(log_young))) most = moved;
    out.emplace();
  }
  if (!out) return out;
  most /= deviations;
  out->shift.log_young = most(log_young);
  out->shift.poisson = most(poisson);
  out->shift.region_log_young = most.tail(most.size() - first_ratio).array() + most(log_young);
  out->softest_pa = std::exp(softest);
  out->stiffest_pa = std::exp(stiffest);
  return out;
}

}  // namespace palpate::estimation
