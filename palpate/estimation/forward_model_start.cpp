// SPDX-License-Identifier: Apache-2.0
// The same object in two models: one starts where the other was solved.
#include <algorithm>
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
    if (between) memory_[s].lent_m = solution->displacement_m;
    auto here = std::make_shared<SolvedAt>();
    here->state.solution = std::move(solution);
    memory_[s].seen = std::move(here);
  }
}

VectorX ForwardModel::lent_start(std::size_t s) const {
  VectorX start_m = memory_[s].seen->state.solution->displacement_m;
  if (s == first_step_of(worker_of(s)) || steps_[s - 1].push != steps_[s].push) return start_m;
  const Memory& before = memory_[s - 1];
  const double size_m = before.lent_m.norm();
  if (!(size_m > 0) || before.seen->is_lent()) return start_m;
  // What the mesh does to a displacement grows with it.
  constexpr double furthest = 2;
  const double share = std::min(start_m.norm() / size_m, furthest);
  start_m += share * (before.seen->state.solution->displacement_m - before.lent_m);
  return start_m;
}

}  // namespace palpate::estimation
