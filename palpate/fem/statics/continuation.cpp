// SPDX-License-Identifier: Apache-2.0
// What is done where Newton's method fails from the start: loads in steps, and near-incompressible bodies by way of
// compressible ones.
#include <cmath>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/fem/statics/static_system.hpp"

namespace palpate::fem {
namespace {

constexpr double kCompressible = 0.45;  // Poisson ratio by way of which hard cases are solved
// Where so many steps in a row, failed ones too, gain less than this share of the load, it is the most that the body bears.
constexpr int kPatience = 12;
constexpr double kLeastGain = 0.005;

}  // namespace

std::string StaticSystem::continuation(const StaticProblem& p, StaticState& s, Equilibrium& out) {
  StaticProblem part = p;
  const StaticProblem target = p;
  s.u.setZero(3 * assembly.node_count());
  part.external.setZero();
  part.prescribed.setZero();
  if (!evaluate(part, s)) return "the law does not exist at rest";
  StaticState last = s;
  VectorX before_last = s.u;
  double t = 0, last_t = 0, dt = 0.25;
  std::string reason;
  std::vector<double> reached;
  for (int step = 0; step < options.max_load_steps; ++step) {
    reached.push_back(t);
    if (step >= kPatience && t - reached[static_cast<std::size_t>(step - kPatience)] < kLeastGain) break;
    const double next = std::min(1.0, t + dt);
    part.external = next * target.external;
    part.prescribed = next * target.prescribed;
    // Secant predictor, dropped where it leaves the law's domain.
    const double stretch = t > last_t ? (next - t) / (t - last_t) : 0;
    s.u = last.u + stretch * (last.u - before_last);
    bool usable = evaluate(part, s);
    if (!usable) {
      s.u = last.u;
      usable = evaluate(part, s);
    }
    const int before = out.newton_steps;
    reason = usable ? newton(part, s, out, std::min(40, options.max_newton_steps), false)
                    : "the law does not exist at the last state";
    if (reason.empty()) {
      before_last = last.u;
      last_t = t;
      last = s;
      t = next;
      if (t >= 1) return {};
      if (out.newton_steps - before < 8) dt *= 1.7;
    } else {
      dt *= 0.4;
      if (dt < 1e-5) break;
    }
  }
  s = last;
  return "no equilibrium was found beyond " + std::to_string(100 * t) + " % of the load (" + reason + ")";
}

// Near nu = 0.5 a large rotation costs hundreds of short steps, since every straight step of a turning element changes its
// volume. The shape hardly depends on nu, so it is found where volume is cheap, and corrected.
std::string StaticSystem::by_way_of_compressible(const StaticProblem& p, const VectorX* start, StaticState& s,
                                                 Equilibrium& out) {
  StaticProblem soft = p;
  soft.m = moduli(p.m.young_pa, kCompressible, p.m.extra);
  std::string reason = "no start";
  if (start) {
    s.u = *start;
    if (evaluate(soft, s)) reason = newton(soft, s, out, options.max_newton_steps, true);
  }
  if (!reason.empty()) reason = continuation(soft, s, out);
  // The pressure is that of the bulk modulus: at the same shape it grows as 1 - 2 nu falls, so the last part goes in
  // steps.
  StaticState last = s;
  double gap = 1 - 2 * kCompressible, factor = 4;
  while (reason.empty() && gap > 1 - 2 * p.m.poisson) {
    const double next = std::max(1 - 2 * p.m.poisson, gap / factor);
    soft.m = next > 1 - 2 * p.m.poisson ? moduli(p.m.young_pa, 0.5 * (1 - next), p.m.extra) : p.m;
    std::string failed = evaluate(soft, s) ? newton(soft, s, out, 12, false) : "the law does not exist at the last state";
    if (failed.empty()) {
      last = s;
      gap = next;
      factor = std::min(4.0, factor * factor);
    } else {
      s = last;
      factor = std::sqrt(factor);
      if (factor < 1.05) reason = failed;
    }
  }
  return reason;
}

Equilibrium StaticSystem::solve_stepwise(double young, double poisson, const VectorX& a, const VectorX& b,
                                         const VectorX& extra) {
  const StaticProblem p = problem(young, poisson, a, b, extra);
  Equilibrium out = blank(young, poisson, a, b, p.m.extra);
  StaticState s;
  out.reason = continuation(p, s, out);
  out.converged = out.reason.empty();
  if (out.converged) say_what_is_odd(p, s, out);
  finish(p, s, out);
  return out;
}

Equilibrium StaticSystem::solve(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX* start,
                                const VectorX& extra) {
  const StaticProblem p = problem(young, poisson, a, b, extra);
  Equilibrium out = blank(young, poisson, a, b, p.m.extra);
  StaticState s;
  s.u = VectorX::Zero(3 * assembly.node_count());
  if (start) {
    if (start->size() != s.u.size()) throw Error("needs " + std::to_string(s.u.size()) + " values", "start");
    s.u = *start;
  }
  bool usable = evaluate(p, s);
  std::string reason =
      usable ? newton(p, s, out, options.max_newton_steps, start != nullptr) : "the start has inverted elements";
  if (!reason.empty() && poisson > kCompressible) reason = by_way_of_compressible(p, start, s, out);
  if (!reason.empty() && options.max_load_steps > 0) reason = continuation(p, s, out);
  out.converged = reason.empty();
  out.reason = reason;
  if (out.converged) say_what_is_odd(p, s, out);
  finish(p, s, out);
  return out;
}

}  // namespace palpate::fem
