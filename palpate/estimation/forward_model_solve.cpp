// SPDX-License-Identifier: Apache-2.0
// One step solved: unit responses superposed, derivatives followed, or Newton's method.
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/estimation/forward_model_parts.hpp"

namespace palpate::estimation {

VectorX ForwardModel::region_stiffness(const VectorX& unknowns) const {
  if (parameters_ == first_ratio) return {};
  VectorX stiffness = VectorX::Ones(1 + first_own_poisson_ - first_ratio);
  stiffness.tail(stiffness.size() - 1) = unknowns.segment(first_ratio, first_own_poisson_ - first_ratio).array().exp();
  return stiffness;
}

/// Of the first region it is the nu that is asked for.
VectorX ForwardModel::region_poisson(const VectorX& unknowns) const {
  if (parameters_ == first_own_poisson_) return {};
  VectorX own(1 + parameters_ - first_own_poisson_);
  own << std::numeric_limits<double>::quiet_NaN(), unknowns.segment(first_own_poisson_, parameters_ - first_own_poisson_);
  return own;
}

fem::ResponseQuery ForwardModel::query(const Coefficients& c, const VectorX& unknowns, bool derivatives) const {
  fem::ResponseQuery q;
  q.young_modulus_pa = std::exp(unknowns(log_young));
  q.poisson_ratio = unknowns(poisson);
  q.force = c.force;
  q.motion = c.motion;
  q.derivatives = derivatives;
  q.along = fem::LoadDirections{c.d_force, c.d_motion};
  q.stiffness = region_stiffness(unknowns);
  q.region_poisson = region_poisson(unknowns);
  return q;
}

double ForwardModel::reuse_error() const {
  const double furthest = *std::max_element(followed_.begin(), followed_.end());
  return furthest * furthest;
}

VectorX ForwardModel::SolvedAt::change_to(const VectorX& there) const {
  VectorX change(static_cast<Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) change(static_cast<Index>(k)) = there(columns[k]) - unknowns(columns[k]);
  return change;
}

VectorX ForwardModel::SolvedAt::displacement_at(const VectorX& there) const {
  const VectorX& here_m = state.solution->displacement_m;
  if (!differentiated()) return here_m;
  const VectorX moved_m = state.solution->derivative * change_to(there);
  if (moved_m.lpNorm<Eigen::Infinity>() > 0.2 * here_m.lpNorm<Eigen::Infinity>()) return here_m;
  return here_m + moved_m;
}

bool ForwardModel::follow(std::size_t s, const VectorX& unknowns, fem::ResponseState& seen) {
  const SolvedAtPtr& anchor = memory_[s].seen;
  if (!anchor || anchor->columns.empty()) return false;
  const VectorX change = anchor->change_to(unknowns);
  const fem::ResponseState& before = anchor->state;
  seen = before;
  seen.watched_m += before.d_watched * change;
  seen.reaction_n += before.d_reaction * change;  // imposed motions do not move with E, but their reactions do
  if (before.d_driven_force.size() > 0) seen.driven_force_n += before.d_driven_force * change;
  double share = 0;
  const auto within = [&](const VectorX& now, const VectorX& was) {
    if (now.size() == 0) return true;
    const double moved = (now - was).lpNorm<Eigen::Infinity>(), size = was.lpNorm<Eigen::Infinity>();
    if (moved > reuse_ * size) return false;
    if (moved > 0) share = std::max(share, moved / size);
    return true;
  };
  if (!within(seen.watched_m, before.watched_m) || !within(seen.reaction_n, before.reaction_n)) return false;
  followed_[s] = share;
  seen.conjugate_m += before.d_conjugate * change;
  return true;
}

int ForwardModel::inverted_elements(std::size_t s, const VectorX& unknowns) {
  Body& body = body_of(push(s), worker_of(s));
  if (contact_) return predict(s, unknowns, false).inverted_elements;
  return body.response->inverted_elements(query(coefficients(s, body, unknowns), unknowns, false));
}

std::optional<fem::Certificate> ForwardModel::certify(const VectorX& unknowns) {
  if (contact_) return std::nullopt;
  const std::size_t s = static_cast<std::size_t>(std::max_element(effort_.begin(), effort_.end()) - effort_.begin());
  const Body& body = body_of(push(s), worker_of(s));
  const fem::ResponseQuery here = query(coefficients(s, body, unknowns), unknowns, false);
  const SolvedAtPtr& known = memory_[s].seen;
  if (known && known->unknowns.size() == unknowns.size() && known->unknowns == unknowns)
    return body.response->certify(known->state, here);
  fem::ResponseStart start;
  if (known) start.displacement_m = &known->state.solution->displacement_m;
  return body.response->certify(linear_ ? body.response->at(here) : body.response->solve(here, start), here);
}

bool ForwardModel::solve_step(std::size_t s, Body& body, const Coefficients& c, const VectorX& unknowns, bool derivatives,
                              fem::ResponseState& seen) {
  const std::size_t worker = worker_of(s);
  followed_[s] = 0;
  if (contact_) return solve_contact_step(s, body, c, unknowns, derivatives, seen);
  // Start from the last solution of this step, or else of the step before, moved along its derivatives.
  VectorX guess_m;
  if (memory_[s].seen) {
    guess_m = memory_[s].seen->is_lent() ? lent_start(s) : memory_[s].seen->displacement_at(unknowns);
  } else if (s > first_step_of(worker) && steps_[s - 1].push == steps_[s].push && memory_[s - 1].seen) {
    // Little of the load is left after a retreat: nearer to rest than to the step before.
    const Coefficients before = coefficients(s - 1, body, unknowns);
    if (!(c.force.norm() <= 0.25 * before.force.norm() && c.motion.norm() <= 0.25 * before.motion.norm()))
      guess_m = memory_[s - 1].seen->state.solution->displacement_m;
  }
  fem::ResponseStart start;
  if (guess_m.size() > 0) start.displacement_m = &guess_m;
  seen = body.response->solve(query(c, unknowns, derivatives), start);
  ++solves_[worker];
  if (!seen.converged) return false;
  auto solved = std::make_shared<SolvedAt>(SolvedAt{unknowns, {}, seen});
  if (derivatives) {
    solved->columns = parameter_columns();
    solved->columns.insert(solved->columns.end(), c.columns.begin(), c.columns.end());
  }
  memory_[s].seen = std::move(solved);
  return true;
}

}  // namespace palpate::estimation
