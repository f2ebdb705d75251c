// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/held_poisson.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::estimation {

bool is_poisson(const Unknowns& unknowns, int k) {
  return k == poisson || (k >= unknowns.first_own_poisson() && k < unknowns.parameter_count());
}

bool is_held(const Unknowns& unknowns, const VectorX& at, const VectorX& gradient, int k) {
  if (!is_poisson(unknowns, k)) return false;
  return (at(k) <= unknowns[k].lower && gradient(k) > 0) || (at(k) >= unknowns[k].upper && gradient(k) < 0);
}

std::vector<int> moving_unknowns(const Unknowns& unknowns, const VectorX& at, const VectorX& gradient) {
  std::vector<int> moving = free_unknowns(unknowns);
  std::erase_if(moving, [&](int k) { return is_held(unknowns, at, gradient, k); });
  return moving;
}

bool leaves_range(const Unknowns& unknowns, const VectorX& at, const std::vector<int>& moving, const VectorX& move) {
  for (std::size_t j = 0; j < moving.size(); ++j) {
    const int k = moving[j];
    if (!is_poisson(unknowns, k)) continue;
    const double there = at(k) + move(static_cast<Index>(j));
    if (there < unknowns[k].lower || there > unknowns[k].upper) return true;
  }
  return false;
}

namespace {

/// Over the ratios alone, all else following: one after the other, until none wants to go on within its range.
/// @param lower, upper  of the step, an infinity for what has no range
VectorX least_between(const MatrixX& bends, const VectorX& slope, const VectorX& lower, const VectorX& upper) {
  std::vector<Index> ratios, rest;
  for (Index j = 0; j < slope.size(); ++j) {
    if (std::isfinite(lower(j))) ratios.push_back(j);
    else rest.push_back(j);
  }
  const MatrixX cross = bends(rest, ratios), of_rest = bends(rest, rest), of_ratios = bends(ratios, ratios);
  const VectorX slope_of_rest = slope(rest), slope_of_ratios = slope(ratios), from = lower(ratios), to = upper(ratios);
  const Eigen::LDLT<MatrixX> follows(of_rest);
  const MatrixX left = of_ratios - cross.transpose() * follows.solve(cross);
  const VectorX pushes = slope_of_ratios - cross.transpose() * follows.solve(slope_of_rest);
  VectorX going = VectorX::Zero(pushes.size());
  constexpr int most_rounds = 1000;
  double change = 1;
  for (int round = 0; round < most_rounds && change > 1e-13; ++round) {
    change = 0;
    for (Index r = 0; r < going.size(); ++r) {
      const double before = going(r);
      going(r) = std::clamp(before - (pushes(r) + left.row(r).dot(going)) / left(r, r), from(r), to(r));
      change = std::max(change, std::abs(going(r) - before));
    }
  }
  const VectorX along = -follows.solve(slope_of_rest + cross * going);
  VectorX out(slope.size());
  for (Index r = 0; r < going.size(); ++r) out(ratios[static_cast<std::size_t>(r)]) = going(r);
  for (Index r = 0; r < along.size(); ++r) out(rest[static_cast<std::size_t>(r)]) = along(r);
  return out;
}

}  // namespace

NewtonStep step_in_range(const Unknowns& unknowns, const VectorX& at, const MatrixX& curvature, const VectorX& gradient,
                         const std::vector<int>& moving) {
  const MatrixX bends = curvature(moving, moving);
  const VectorX slope = gradient(moving);
  NewtonStep out;
  out.move = bends.ldlt().solve(-slope);
  out.gain = -0.5 * slope.dot(out.move);
  if (!out.move.allFinite() || !leaves_range(unknowns, at, moving, out.move)) return out;
  VectorX lower = VectorX::Constant(slope.size(), -std::numeric_limits<double>::infinity()), upper = -lower;
  for (Index j = 0; j < slope.size(); ++j) {
    const int k = moving[static_cast<std::size_t>(j)];
    if (is_poisson(unknowns, k)) lower(j) = unknowns[k].lower - at(k), upper(j) = unknowns[k].upper - at(k);
  }
  out.move = least_between(bends, slope, lower, upper);
  out.gain = -slope.dot(out.move) - 0.5 * out.move.dot(bends * out.move);
  return out;
}

void note_held(const Unknowns& unknowns, Optimum& optimum) {
  const bool held = is_held(unknowns, optimum.unknowns, optimum.evaluation.gradient, poisson);
  optimum.poisson_at_lower = held && optimum.evaluation.gradient(poisson) > 0;
  optimum.poisson_at_upper = held && !optimum.poisson_at_lower;
}

}  // namespace palpate::estimation
