// SPDX-License-Identifier: Apache-2.0
// What an equilibrium may be although its residual is small: inside out, unstable, one of several.
#include <cmath>
#include <limits>

#include "palpate/fem/statics/static_system.hpp"

namespace palpate::fem {

bool StaticSystem::is_stable(const Equilibrium& at) {
  const StaticProblem p =
      problem(at.young_modulus_pa, at.poisson_ratio, at.force_coefficients, at.motion_coefficients, at.extra);
  factored_u.resize(0);
  linear_poisson = std::numeric_limits<double>::quiet_NaN();
  assembly.tangent(law, p.m, at.displacement_m, blocks);
  return system.factorise(assembly.pattern(), blocks, 0, assembly.expected_negative_pivots());
}

void StaticSystem::say_what_is_odd(const StaticProblem& p, const StaticState& s, Equilibrium& out) {
  if (s.inverted > 0)
    out.reason =
        std::to_string(s.inverted) + " elements are inside out: the equilibrium of the equations is not one of a body";
  if (!last_step_shifted) return;
  // The last step belongs to the state before: look at this one.
  assembly.tangent(law, p.m, s.u, blocks);
  factored_u.resize(0);
  ++out.factorisations;
  out.unstable = !system.factorise(assembly.pattern(), blocks, 0, assembly.expected_negative_pivots());
  if (!out.unstable) return;
  if (!out.reason.empty()) out.reason += "; ";
  out.reason += "the equilibrium is unstable: another one of less energy exists";
}

std::vector<Equilibrium> StaticSystem::other_equilibria(const Equilibrium& at) {
  std::vector<Equilibrium> found;
  if (law.is_linear() || is_stable(at)) return found;
  const StaticProblem p =
      problem(at.young_modulus_pa, at.poisson_ratio, at.force_coefficients, at.motion_coefficients, at.extra);
  int factorisations = 0;
  if (!factorise_tangent(p, at.displacement_m, factorisations)) return found;
  factored_u.resize(0);
  // The shifted tangent amplifies the direction of least curvature most (inverse iteration from a fixed start).
  VectorX mode(at.displacement_m.size());
  for (Index i = 0; i < mode.size(); ++i) mode(i) = std::sin(1.0 + 0.7 * i) + 0.3 * std::cos(0.013 * i);
  for (int i = 0; i < 30; ++i) mode = system.solve(mode / mode.lpNorm<Eigen::Infinity>()).col(0);
  mode /= mode.lpNorm<Eigen::Infinity>();
  for (const double side : {1.0, -1.0}) {
    const VectorX start = at.displacement_m + side * 0.02 * diameter_m * mode;
    // Newton's method alone: loads stepped up from rest would only come back to `at`.
    StaticState s;
    s.u = start;
    Equilibrium other =
        blank(at.young_modulus_pa, at.poisson_ratio, at.force_coefficients, at.motion_coefficients, p.m.extra);
    if (!evaluate(p, s)) continue;
    other.reason = newton(p, s, other, 2 * options.max_newton_steps, false);
    other.converged = other.reason.empty();
    if (other.converged) say_what_is_odd(p, s, other);
    finish(p, s, other);
    const double size = std::max(other.displacement_m.cwiseAbs().maxCoeff(), at.displacement_m.cwiseAbs().maxCoeff());
    const auto differs = [&](const Equilibrium& from) {
      return (other.displacement_m - from.displacement_m).cwiseAbs().maxCoeff() > 1e-3 * size;
    };
    if (other.converged && differs(at) && (found.empty() || differs(found.front()))) found.push_back(std::move(other));
  }
  return found;
}

}  // namespace palpate::fem
