// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "palpate/fem/statics/static_system.hpp"

namespace palpate::fem {
namespace {

constexpr double kStaleContraction = 0.2;  // of the residual, per step with an old factor

}  // namespace

bool StaticSystem::factorise_tangent(const StaticProblem& p, const VectorX& u, int& factorisations, bool* shifted) {
  assembly.tangent(law, p.m, u, blocks);
  factored_u.resize(0);
  // The exact tangent first; a shifted one only where it is not positive definite (clamping every element would destroy
  // quadratic convergence). Under a limit load the shift keeps descent towards a stable equilibrium.
  for (double shift = 0; shift < 1e3; shift = shift == 0 ? 1e-3 : shift * 4) {
    ++factorisations;
    if (system.factorise(assembly.pattern(), blocks, shift, assembly.expected_negative_pivots())) {
      if (shifted) *shifted = shift > 0;
      if (shift == 0) {
        factored_u = u;
        factored_moduli = p.m;
      }
      return true;
    }
  }
  return false;
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
    const bool factorised = factorise_tangent(p, s.u, out.factorisations, &shifted);
    // Past a point of instability the energy falls slowly towards another state; that is progress all the same.
    effort += shifted ? 0.15 : 1;
    if (!factorised) return "the tangent could not be factorised";
    VectorX rhs = -(s.internal - p.external);
    if (!at_target) rhs -= assembly.multiply(blocks, jump);
    const VectorX d_free = system.solve(rhs);
    if (!d_free.allFinite()) return "the Newton step is not finite";
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
