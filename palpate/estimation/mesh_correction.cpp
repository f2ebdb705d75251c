// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/mesh_correction.hpp"

#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
namespace {

/// Large bodies of plain elements take a third of the time of mixed ones, since any method solves for them; far from nu = 0.5 the two
/// hardly differ there.
fem::StaticsOptions options_for(const FinerModel& mesh, const FitOptions& options, double poisson_ratio) {
  constexpr Index large = 10000;
  return mesh.object.mesh.nodes_m.rows() < large ? statics_options(mesh.recording, mesh.object, options)
                                                 : statics_options(mesh.object, options, poisson_ratio);
}

}  // namespace

bool MeshCorrection::applies_to(const ForwardModel& model) {
  return !model.touches() && !fem::material_law(model.object().material).is_linear();
}

MeshCorrection::MeshCorrection(const FinerModel& mesh, const Inputs& inputs, const FitOptions& options, double poisson_ratio)
    : model_(mesh.recording, mesh.object, unknowns_, options_for(mesh, options, poisson_ratio)),
      objective_(model_, inputs, unknowns_) {}

bool MeshCorrection::correct(Objective& objective, const VectorX& unknowns, const Loss& loss, const OnProgress& progress) {
  if (unknowns_.size() != objective.unknowns().size()) return false;
  ForwardModel& coarse = objective.model();
  ForwardModel::Changes before = coarse.changes(), changes(coarse.step_count());
  const auto refuse = [&] {
    coarse.set_changes(std::move(before));
    return false;
  };
  coarse.set_changes({});
  if (!objective.evaluate(unknowns, loss, progress).usable) return refuse();  // solved, where it may have been extrapolated
  model_.start_from(coarse);
  if (!objective_.evaluate(unknowns, loss, progress).usable) return refuse();
  for (std::size_t s = 0; s < changes.size(); ++s) {
    if (!loss.counts(s) || objective.last_predictions()[s].surface_m.rows() == 0) continue;  // nothing was seen there
    changes[s] = change_between(objective.last_predictions()[s], objective_.last_predictions()[s], unknowns);
    if (!changes[s]) return refuse();
  }
  coarse.set_changes(std::move(changes));
  return true;
}

}  // namespace palpate::estimation
