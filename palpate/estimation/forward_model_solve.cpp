// SPDX-License-Identifier: Apache-2.0
// One step solved: unit responses superposed, derivatives followed, or Newton's method.
#include <algorithm>
#include <cmath>

#include "palpate/estimation/forward_model_parts.hpp"

namespace palpate::estimation {

ForwardModel::Watched ForwardModel::superpose(const Body& body, const Coefficients& c, const VectorX& unknowns,
                                              const fem::UnitResponses& unit, StepPrediction& out) const {
  const double young_pa = std::exp(unknowns(log_young));
  const Index others = static_cast<Index>(c.columns.size()), rows = static_cast<Index>(unit.force.rows());
  const Index seen = rows - static_cast<Index>(body.forces.cols());
  const VectorX loaded = unit.force * (c.force / young_pa);
  const VectorX all = loaded + unit.motion * c.motion;
  MatrixX d(rows, 2 + others);
  d.col(0) = -loaded;
  d.col(1) = unit.force_d_poisson * (c.force / young_pa) + unit.motion_d_poisson * c.motion;
  d.rightCols(others) = unit.force * (c.d_force / young_pa) + unit.motion * c.d_motion;
  Watched watched;
  watched.moved_m = all.head(seen);
  watched.conjugate_m = all.tail(rows - seen);
  watched.d_moved = d.topRows(seen);
  watched.d_conjugate = d.bottomRows(rows - seen);
  watched.reaction_n = unit.reaction_force * c.force + young_pa * (unit.reaction_motion * c.motion);
  watched.d_reaction.resize(c.motion.size(), 2 + others);
  watched.d_reaction.col(0) = young_pa * (unit.reaction_motion * c.motion);
  watched.d_reaction.col(1) =
      unit.reaction_force_d_poisson * c.force + young_pa * (unit.reaction_motion_d_poisson * c.motion);
  watched.d_reaction.rightCols(others) = unit.reaction_force * c.d_force + young_pa * (unit.reaction_motion * c.d_motion);
  // Gradients add up at most; the polynomial knows them at its nodes only, hence the margin.
  const double gradient = c.force.cwiseAbs().dot(unit.largest_gradient_force) / young_pa +
                          c.motion.cwiseAbs().dot(unit.largest_gradient_motion);
  out.converged = true;
  out.inverted_elements = gradient < 0.7 ? 0 : -1;
  return watched;
}

double ForwardModel::reuse_error() const {
  const double furthest = *std::max_element(followed_.begin(), followed_.end());
  return furthest * furthest;
}

VectorX ForwardModel::Memory::change_to(const VectorX& there) const {
  VectorX change(static_cast<Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) change(static_cast<Index>(k)) = there(columns[k]) - unknowns(columns[k]);
  return change;
}

bool ForwardModel::follow(std::size_t s, const VectorX& unknowns, Watched& watched, StepPrediction& out) {
  const Memory& anchor = memory_[s];
  if (!anchor.valid || anchor.columns.empty()) return false;
  const VectorX change = anchor.change_to(unknowns);
  watched = anchor.watched;
  watched.moved_m += watched.d_moved * change;
  watched.reaction_n += watched.d_reaction * change;  // imposed motions do not move with E, but their reactions do
  double share = 0;
  const auto within = [&](const VectorX& now, const VectorX& before) {
    if (now.size() == 0) return true;
    const double moved = (now - before).lpNorm<Eigen::Infinity>(), size = before.lpNorm<Eigen::Infinity>();
    if (moved > reuse_ * size) return false;
    if (moved > 0) share = std::max(share, moved / size);
    return true;
  };
  if (!within(watched.moved_m, anchor.watched.moved_m) || !within(watched.reaction_n, anchor.watched.reaction_n)) return false;
  followed_[s] = share;
  watched.conjugate_m += watched.d_conjugate * change;
  out.converged = true;
  out.inverted_elements = anchor.inverted_elements;
  return true;
}

void ForwardModel::set_ratios(Body& body, const VectorX& unknowns) const {
  if (parameters_ == first_ratio) return;
  VectorX stiffness = VectorX::Ones(1 + parameters_ - first_ratio);
  stiffness.tail(stiffness.size() - 1) = unknowns.segment(first_ratio, parameters_ - first_ratio).array().exp();
  if (body.contact) {
    body.contact->set_region_stiffness(stiffness);
  } else {
    body.statics->set_region_stiffness(stiffness);
  }
}

int ForwardModel::inverted_elements(std::size_t s, const VectorX& unknowns) {
  Body& body = body_of(push(s), worker_of(s));
  if (body.contact) return predict(s, unknowns, false).inverted_elements;
  set_ratios(body, unknowns);
  const Coefficients c = coefficients(s, body, unknowns);
  const auto at = body.statics->solve(std::exp(unknowns(log_young)), unknowns(poisson), c.force, c.motion);
  return at.inverted_elements;
}

bool ForwardModel::solve_step(std::size_t s, Body& body, const Coefficients& c, const VectorX& unknowns, bool derivatives,
                              Watched& watched, StepPrediction& out) {
  const std::size_t worker = worker_of(s);
  followed_[s] = 0;
  if (body.contact) return solve_contact_step(s, body, c, unknowns, derivatives, watched, out);
  // Start from the last solution of this step, or else of the step before, moved along its derivatives.
  Memory& memory = memory_[s];
  const Memory* from = memory.valid ? &memory : nullptr;
  VectorX start;
  if (from != nullptr) {
    start = from->displacement_m;
    start += from->derivative * from->change_to(unknowns);
    // A straight line is no good guess for a far step.
    const double moved_m = (start - from->displacement_m).lpNorm<Eigen::Infinity>();
    if (moved_m > 0.2 * from->displacement_m.lpNorm<Eigen::Infinity>()) start = from->displacement_m;
  } else if (s > first_step_of(worker) && steps_[s - 1].push == steps_[s].push && memory_[s - 1].valid) {
    // Little of the load is left after a retreat: nearer to rest than to the step before.
    const Coefficients before = coefficients(s - 1, body, unknowns);
    if (!(c.force.norm() <= 0.25 * before.force.norm() && c.motion.norm() <= 0.25 * before.motion.norm()))
      start = memory_[s - 1].displacement_m;
  }

  set_ratios(body, unknowns);
  const double young_pa = std::exp(unknowns(log_young));
  const fem::Equilibrium at =
      body.statics->solve(young_pa, unknowns(poisson), c.force, c.motion, start.size() > 0 ? &start : nullptr);
  ++solves_[worker];
  out.converged = at.converged;
  out.reason = at.reason;
  out.inverted_elements = at.inverted_elements;
  if (!at.converged) return false;

  watched.moved_m = object_.surface.restrict(at.displacement_m);
  if (!derivatives) {
    memory = {true, unknowns, at.displacement_m, {}, MatrixX(at.displacement_m.size(), 0), {}, at.inverted_elements, {}};
    return true;
  }
  const fem::SensitivityAlong d = body.statics->sensitivity_along(at, c.d_force, c.d_motion);
  const Index others = static_cast<Index>(c.columns.size());
  const Index ratios = parameters_ - first_ratio;  // of the further regions: the first one's stiffness is E itself
  MatrixX field(at.displacement_m.size(), parameters_ + others);
  field << d.d_log_young, d.d_poisson, d.d_log_stiffness.rightCols(ratios), d.d_along;
  watched.d_moved = object_.surface.restrict(field);
  watched.conjugate_m = body.forces.transpose() * at.displacement_m;
  watched.d_conjugate = body.forces.transpose() * field;
  watched.reaction_n = at.motion_reaction;
  watched.d_reaction.resize(c.motion.size(), parameters_ + others);
  watched.d_reaction << d.reaction_d_log_young, d.reaction_d_poisson, d.reaction_d_log_stiffness.rightCols(ratios),
      d.reaction_d_along;
  memory = {true, unknowns, at.displacement_m, parameter_columns(), std::move(field), watched, at.inverted_elements, {}};
  memory.columns.insert(memory.columns.end(), c.columns.begin(), c.columns.end());
  return true;
}

}  // namespace palpate::estimation
