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
    const Memory& from = other.memory_[s];
    memory_[s] = Memory{};
    memory_[s].valid = from.valid;
    if (!from.valid) continue;
    memory_[s].displacement_m = between ? VectorX(between->restrict(from.displacement_m)) : from.displacement_m;
    memory_[s].derivative.resize(memory_[s].displacement_m.size(), 0);
  }
}

}  // namespace palpate::estimation
