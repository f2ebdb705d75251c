// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/load_drift.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/estimation/doubts.hpp"
#include "palpate/estimation/held_out.hpp"

namespace palpate::estimation {
namespace {

/// Of the object at rest, along a direction.
double extent_m(const Points& vertices_m, const Vec3& direction) {
  if (vertices_m.rows() == 0) return 0;
  const VectorX along = vertices_m * direction;
  return along.maxCoeff() - along.minCoeff();
}

YoungAtLoad at_farthest(const PartialYoung& young, const ForwardModel& model, const std::vector<StepFit>& steps) {
  YoungAtLoad out;
  out.young = parameter_of(young);
  const auto raise = [](double& to, double value) {
    if (std::isfinite(value) && !(to >= value)) to = value;
  };
  for (std::size_t s = 0; s < std::min(young.steps.size(), steps.size()); ++s) {
    if (young.steps[s] == 0 || load_of(model.step(s)) == 0) continue;
    const Load& load = model.step(s).loads.front();
    const double travel_m = load.travel_m ? *load.travel_m : steps[s].travel_predicted_m;
    raise(out.force_n, load.force_n ? load.force_n->norm() : std::abs(steps[s].force_predicted_n));
    raise(out.travel_m, travel_m);
    raise(out.strain, travel_m / extent_m(model.object().surface.rest().vertices_m, load.direction.normalized()));
    if (steps[s].tool_radius_m > 0) raise(out.indentation, travel_m / steps[s].tool_radius_m);
  }
  return out;
}

}  // namespace

bool drifts_with_load(const CrossChecks& checks) {
  return checks.low_loads.usable && checks.high_loads.usable && checks.chance_of_loads < rare;
}

std::vector<YoungAtLoad> young_by_load(const CrossChecks& checks, const ForwardModel& model, const std::vector<StepFit>& steps) {
  if (!checks.low_loads.usable || !checks.high_loads.usable) return {};
  return {at_farthest(checks.low_loads, model, steps), at_farthest(checks.high_loads, model, steps)};
}

}  // namespace palpate::estimation
