// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/load_drift.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/estimation/doubts.hpp"
#include "palpate/estimation/held_out.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
namespace {

/// Of the object at rest, along a direction.
double extent_m(const Points& vertices_m, const Vec3& direction) {
  if (vertices_m.rows() == 0) return 0;
  const VectorX along = vertices_m * direction;
  return along.maxCoeff() - along.minCoeff();
}

double travel_of(const Load& load, const StepFit& step) { return load.travel_m ? *load.travel_m : step.travel_predicted_m; }

double strain_of(const ForwardModel& model, std::size_t s, const StepFit& step) {
  const Load& load = model.step(s).loads.front();
  return travel_of(load, step) / extent_m(model.object().surface.rest().vertices_m, load.direction.normalized());
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
    const double travel_m = travel_of(load, steps[s]);
    raise(out.force_n, load.force_n ? load.force_n->norm() : std::abs(steps[s].force_predicted_n));
    raise(out.travel_m, travel_m);
    raise(out.strain, strain_of(model, s, steps[s]));
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
  std::vector<YoungAtLoad> out{at_farthest(checks.low_loads, model, steps), at_farthest(checks.high_loads, model, steps)};
  for (const PartialYoung& quarter : checks.quarters) out.push_back(at_farthest(quarter, model, steps));
  return out;
}

std::vector<TangentModulus> tangent_moduli(const CrossChecks& checks, const ForwardModel& model, const std::vector<StepFit>& steps) {
  std::vector<TangentModulus> out;
  if (!fem::material_law(model.object().material).is_linear()) return out;
  double last_strain = 0, last_stress_pa = 0;
  for (const PartialYoung& quarter : checks.quarters) {
    double squares = 0, cubes = 0;
    for (std::size_t s = 0; s < std::min(quarter.steps.size(), steps.size()); ++s) {
      if (quarter.steps[s] == 0 || load_of(model.step(s)) == 0) continue;
      const double strain = strain_of(model, s, steps[s]);
      if (!(strain > 0)) continue;
      squares += strain * strain;
      cubes += strain * strain * strain;
    }
    const double strain = cubes / squares, stress_pa = std::exp(quarter.log_young) * strain;
    if (!(strain > last_strain)) continue;
    out.push_back({strain, (stress_pa - last_stress_pa) / (strain - last_strain)});
    last_strain = strain;
    last_stress_pa = stress_pa;
  }
  return out;
}

}  // namespace palpate::estimation
