// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "palpate/fem/statics/static_system.hpp"

namespace palpate::fem {
namespace {

constexpr double kStaleContraction = 0.2;  // of the residual, per step with an old factor
// Shifts are shares of the diagonal. A slender body needs tiny ones, a body that collapses under a tool large ones; each
// step starts a little below the last one's.
constexpr double kFirstShift = 1e-3, kSmallestShift = 1e-7, kLargestShift = 1e3;

// Eisenstat & Walker 1996, choice 2: a linear solve no more exact than Newton's model is, near the end as exact as needed.
double forcing_term(double residual, double last_residual, double last_forcing, double tolerance) {
  constexpr double first = 0.05, gamma = 0.9;
  if (!(last_residual > 0)) return first;
  double eta = gamma * std::pow(residual / last_residual, 2);
  const double safeguard = gamma * last_forcing * last_forcing;
  if (safeguard > 0.1) eta = std::max(eta, safeguard);
  return std::clamp(eta, std::max(1e-10, 0.3 * tolerance / residual), first);
}

}  // namespace

bool StaticSystem::factorise_tangent(const StaticProblem& p, const VectorX& u, int& factorisations, bool* shifted) {
  assembly.tangent(law, p.m, u, blocks);
  factored_u.resize(0);
  // The exact tangent first; a shifted one only where it is not positive definite (clamping every element would destroy
  // quadratic convergence). Under a limit load the shift keeps descent towards a stable equilibrium.
  for (double shift = 0; shift < kLargestShift; shift = shift == 0 ? first_shift : shift * 4) {
    ++factorisations;
    if (system.factorise(assembly.pattern(), blocks, shift, assembly.expected_negative_pivots())) {
      if (shifted) *shifted = shift > 0;
      if (shift > 0) first_shift = std::max(kSmallestShift, shift / 8);
      if (shift == 0) {
        factored_u = u;
        factored_moduli = p.m;
      }
      return true;
    }
  }
  return false;
}

std::string StaticSystem::newton_step(const StaticProblem& p, const StaticState& s, const VectorX& jump, bool at_target,
                                      double forcing, VectorX& d, bool& shifted, Equilibrium& out) {
  const auto right_hand_side = [&] {
    VectorX rhs = p.external - s.internal;
    if (!at_target) rhs -= assembly.multiply(blocks, jump);
    return rhs;
  };
  if (!steps_by_any()) {
    if (!factorise_tangent(p, s.u, out.factorisations, &shifted)) return "the tangent could not be factorised";
    d = system.solve(right_hand_side());
    return d.allFinite() ? "" : "the Newton step is not finite";
  }
  assembly.tangent(law, p.m, s.u, blocks);
  factored_u.resize(0);
  const VectorX rhs = right_hand_side();
  for (double shift = 0; shift < kLargestShift; shift = shift == 0 ? first_shift : shift * 4) {
    system.set_matrix(assembly.pattern(), blocks, shift);
    MatrixX step;
    const LinearSolver::Outcome outcome = system.solve_by_any(rhs, forcing, step);
    ++out.factorisations;
    if (outcome.solved) {
      d = step.col(0);
      shifted = shift > 0;
      if (shifted) first_shift = std::max(kSmallestShift, shift / 8);
      return d.allFinite() ? "" : "the Newton step is not finite";
    }
    if (!outcome.not_positive_definite) return outcome.reason;
  }
  return "the tangent could not be factorised";
}

// A step with the last factor instead of the tangent at s (modified Newton). Taken only where it brings the residual down
// by a good factor: it costs a tenth of a factorisation, and near a known solution it contracts nearly as well.
bool StaticSystem::stale_step(const StaticProblem& p, const VectorX& jump, bool at_target, StaticState& s,
                              StaticState& trial) const {
  const double scale = p.m.young_pa / factored_moduli.young_pa;  // every energy of the table is proportional to E
  VectorX rhs = p.external - s.internal;
  if (!at_target) rhs -= scale * assembly.multiply(blocks, jump);
  trial.u = s.u + system.solve(rhs) / scale;
  if (!at_target) trial.u += jump;
  if (!trial.u.allFinite() || !evaluate(p, trial)) return false;
  if (trial.residual > kStaleContraction * s.residual) return false;
  std::swap(s, trial);
  return true;
}

std::string StaticSystem::newton(const StaticProblem& p, StaticState& s, Equilibrium& out, int max_steps, bool near) {
  StaticState trial;
  last_step_shifted = false;
  first_shift = kFirstShift;
  double last_residual = 0, forcing = 0;
  for (double effort = 0;;) {
    const VectorX jump = p.prescribed - system.prescribed_part(s.u);
    const bool at_target = jump.lpNorm<Eigen::Infinity>() <= 1e-14 * diameter_m;
    if (at_target && s.residual <= options.residual_tolerance) return {};
    if (near && factored_u.size() > 0 && factored_moduli.extra == p.m.extra) {
      near = stale_step(p, jump, at_target, s, trial);
      if (near) continue;
    }
    if (effort >= max_steps) return "Newton's method did not converge in " + std::to_string(max_steps) + " steps";
    bool shifted = false;
    VectorX d_free;
    forcing = forcing_term(s.residual, at_target ? last_residual : 0, forcing, options.residual_tolerance);
    last_residual = s.residual;
    const std::string failed = newton_step(p, s, jump, at_target, forcing, d_free, shifted, out);
    // Past a point of instability the energy falls slowly towards another state; that is progress all the same.
    effort += shifted ? 0.15 : 1;
    if (!failed.empty()) return failed;
    last_step_shifted = shifted;
    ++out.newton_steps;
    const double slope = s.unbalanced.dot(d_free);  // negative for a descent direction
    bool accepted = false;
    for (double alpha = 1; alpha > 1e-6; alpha *= 0.5) {
      trial.u = s.u + alpha * d_free;
      if (!at_target) trial.u += alpha * jump;
      if (!evaluate(p, trial)) continue;
      const bool falls = trial.energy <= s.energy + 1e-4 * alpha * slope;
      const bool smaller = trial.residual <= (1 - 0.1 * alpha) * s.residual && !shifted;
      if (!at_target || falls || smaller) {
        accepted = true;
        near = at_target && !shifted && alpha == 1 && trial.residual < kStaleContraction * s.residual;
        break;
      }
      // Rounding: the energy can no longer tell, and the step is far below any length that matters.
      if (s.residual < 1e-6 && alpha * d_free.lpNorm<Eigen::Infinity>() < 1e-11 * diameter_m) return {};
    }
    if (!accepted) return "the line search found no admissible step";
    std::swap(s, trial);
  }
}

}  // namespace palpate::fem
