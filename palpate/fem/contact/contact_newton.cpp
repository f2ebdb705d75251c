// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/fem/contact/contact_problem.hpp"

namespace palpate::fem {

std::string ContactSystem::newton(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s,
                                  ContactEquilibrium& out, double tolerance) {
  constexpr int few = 15;
  const bool rough = tolerance > 0;
  std::string reason = iterate(p, memory, s, out, rough ? tolerance : options.statics.residual_tolerance,
                               rough ? few : options.statics.max_newton_steps);
  if (reason.empty() || rough || !floating) return reason;
  Vec3 left = Vec3::Zero();
  for (Index i = 0; i < assembly.node_count(); ++i) left += s.unbalanced.segment<3>(3 * i);
  // A sum over nodes as large as their norm: they pull together.
  if (left.norm() > s.unbalanced.norm())
    reason += "; nothing carries a force of (" + std::to_string(-left.x()) + ", " + std::to_string(-left.y()) + ", " +
              std::to_string(-left.z()) + ") N";
  return reason;
}

void ContactSystem::soften_start(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s,
                                 ContactEquilibrium& out) {
  if (is_settled(s, 0.3)) return;
  const ContactState before = s;
  softest = 3;
  if (evaluate(p, memory, s)) iterate(p, memory, s, out, 0.03, 8);
  softest = 0;
  if (!evaluate(p, memory, s)) s = before;
}

std::string ContactSystem::iterate(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s,
                                   ContactEquilibrium& out, double tolerance, int max_steps) {
  ContactTangent t;
  ContactState trial;
  double proximal = floating ? 1e-4 : 0;
  double last_residual = std::numeric_limits<double>::infinity();
  for (int step = 0;; ++step) {
    const VectorX jump = p.prescribed - system.prescribed_part(s.u);
    const bool at_target = jump.lpNorm<Eigen::Infinity>() <= 1e-14 * diameter_m;
    if (at_target && is_settled(s, tolerance)) return {};
    // Near the floor, and a whole Newton step no longer halves what is left: this is the floor.
    if (at_target && is_settled(s, tolerance, 10) && s.residual > 0.5 * last_residual) return {};
    last_residual = s.residual;
    if (step == max_steps) return "Newton's method did not converge in " + std::to_string(step) + " steps";
    tangent(p, memory, s, s.residual > 1e-3, t);
    bool factored = false;
    double shift = 0;
    for (; shift < 1e3 && !factored; shift = shift == 0 ? 1e-3 : shift * 4) {
      ++out.factorisations;
      factored = factorise(t, shift, proximal);
      if (factored) break;
    }
    if (!factored) return "the tangent could not be factorised";
    MatrixX rhs = -(s.internal + s.touching - p.external), du, dz;
    if (!at_target) rhs.col(0) -= assembly.multiply(t.blocks, jump);
    MatrixX tool_rhs = -s.unbalanced_tool;
    if (!at_target) tool_rhs.col(0) -= t.coupling.transpose() * jump;
    solve(t, rhs, tool_rhs, true, du, dz);
    if (!du.allFinite() || !dz.allFinite()) return "the Newton step is not finite";
    ++out.newton_steps;
    const double slope = s.unbalanced.dot(du.col(0)) + s.unbalanced_tool.dot(dz.col(0));
    bool accepted = false;
    double alpha = 1;
    for (; alpha > 1e-7; alpha *= 0.5) {
      trial.u = s.u + alpha * du.col(0);
      if (!at_target) trial.u += alpha * jump;
      trial.poses = s.poses;
      trial.travelled = s.travelled;
      move(trial, alpha * dz.col(0));
      if (!evaluate(p, memory, trial)) continue;
      const bool falls = trial.energy <= s.energy + 1e-4 * alpha * slope;
      const bool smaller = trial.residual <= (1 - 0.1 * alpha) * s.residual && shift == 0 && s.residual < 1e-3;
      // Under tiny strains energies differ by less than their rounding; forces still know the way down: the approximate Wolfe
      // condition (Hager & Zhang, SIAM J. Optim. 16, 2005, eq. 4.1).
      const bool level = trial.energy <= s.energy + s.rounding_j &&
                         trial.unbalanced.dot(du.col(0)) + trial.unbalanced_tool.dot(dz.col(0)) <= 0.9998 * -slope;
      if (!at_target || falls || level || smaller) {
        accepted = true;
        break;
      }
      const double length =
          alpha * std::max(du.lpNorm<Eigen::Infinity>(), dz.size() > 0 ? dz.lpNorm<Eigen::Infinity>() : 0.0);
      if (s.residual < 1e-6 && length < 1e-11 * diameter_m) return {};
    }
    if (!accepted) return "the line search found no admissible step";
    // The proximal term only keeps the step in bounds; it fades as steps are taken whole.
    if (floating) proximal = alpha == 1 ? std::max(0.05 * proximal, 1e-9) : std::min(1e-2, 4 * proximal);
    std::swap(s, trial);
  }
}

}  // namespace palpate::fem
