// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/prediction_change.hpp"

#include <algorithm>

#include "palpate/estimation/forward_model.hpp"

namespace palpate::estimation {

std::optional<PredictionChange> change_between(const StepPrediction& from, const StepPrediction& to, const VectorX& unknowns) {
  if (!from.converged || !to.converged || from.columns != to.columns || from.surface_m.rows() != to.surface_m.rows() ||
      from.travel_m.size() != to.travel_m.size())
    return std::nullopt;
  PredictionChange out{unknowns,
                       from.columns,
                       to.surface_m - from.surface_m,
                       to.d_surface - from.d_surface,
                       to.travel_m - from.travel_m,
                       to.d_travel - from.d_travel,
                       {},
                       {}};
  for (std::size_t l = 0; l < from.force_n.size(); ++l) {
    out.force_n.push_back(to.force_n[l] - from.force_n[l]);
    out.d_force.push_back(to.d_force[l] - from.d_force[l]);
  }
  return out;
}

void PredictionChange::add_to(StepPrediction& predicted, const VectorX& unknowns, bool derivatives) const {
  const Index count = static_cast<Index>(columns.size());
  VectorX moved(count);
  for (Index k = 0; k < count; ++k) moved(k) = unknowns(columns[std::size_t(k)]) - at(columns[std::size_t(k)]);
  const VectorX further_m = d_surface * moved;
  const Points change_m = surface_m + Eigen::Map<const Points>(further_m.data(), surface_m.rows(), 3);
  predicted.surface_m += change_m;
  if (predicted.field != nullptr) predicted.material_m += change_m;
  predicted.travel_m += travel_m + d_travel * moved;
  for (std::size_t l = 0; l < force_n.size(); ++l) predicted.force_n[l] += force_n[l] + d_force[l] * moved;
  if (!derivatives) return;
  for (Index k = 0; k < count; ++k) {
    const auto found = std::find(predicted.columns.begin(), predicted.columns.end(), columns[std::size_t(k)]);
    if (found == predicted.columns.end()) continue;
    const Index column = static_cast<Index>(found - predicted.columns.begin());
    predicted.d_surface.col(column) += d_surface.col(k);
    if (predicted.d_material.size() > 0) predicted.d_material.col(column) += d_surface.col(k);
    predicted.d_travel.col(column) += d_travel.col(k);
    for (std::size_t l = 0; l < d_force.size(); ++l) predicted.d_force[l].col(column) += d_force[l].col(k);
  }
}

PredictionChange PredictionChange::renumbered(const std::vector<int>& place, Index count) const {
  PredictionChange out = *this;
  out.at = VectorX::Zero(count);
  for (std::size_t k = 0; k < place.size(); ++k) out.at(place[k]) = at(static_cast<Index>(k));
  for (int& column : out.columns) column = place[static_cast<std::size_t>(column)];
  return out;
}

}  // namespace palpate::estimation
