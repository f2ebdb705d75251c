// SPDX-License-Identifier: Apache-2.0
// The same object in two models: one starts where the other was solved.
#include <optional>

#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/geometry/embedding.hpp"

namespace palpate::estimation {

void ForwardModel::start_from(const ForwardModel& other) {
  std::optional<SimulatedSurface> between;  // this mesh's nodes in the other mesh
  const bool same =
      object_.mesh.nodes_m.rows() == other.object_.mesh.nodes_m.rows() && object_.mesh.nodes_m == other.object_.mesh.nodes_m;
  if (!same)
    between = SimulatedSurface::embedded(other.object_.mesh, {object_.mesh.nodes_m, Triangles(0, 3)},
                                         geometry::embed(object_.mesh.nodes_m, other.object_.mesh));
  for (std::size_t s = 0; s < memory_.size(); ++s) {
    memory_[s] = Memory{};
    const SolvedAtPtr& from = other.memory_[s].seen;
    if (!from) continue;
    const VectorX& there_m = from->state.solution->displacement_m;
    auto solution = std::make_shared<fem::ResponseSolution>();
    solution->displacement_m = between ? VectorX(between->restrict(there_m)) : there_m;
    solution->derivative.resize(solution->displacement_m.size(), 0);
    auto here = std::make_shared<SolvedAt>();
    here->state.solution = std::move(solution);
    memory_[s].seen = std::move(here);
  }
}

}  // namespace palpate::estimation
