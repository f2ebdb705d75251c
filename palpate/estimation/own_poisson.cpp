// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/own_poisson.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/estimation/error_budget.hpp"
#include "palpate/estimation/held_poisson.hpp"

namespace palpate::estimation {
namespace {

double below(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }
double density(double z) { return std::exp(-0.5 * z * z) / std::sqrt(2 * EIGEN_PI); }

}  // namespace

Parameter cut_normal(double mean, double std, double lower, double upper, const std::string& region) {
  // Far outside, what is left of it lies at one bound, by less than rounding knows.
  mean = std::clamp(mean, lower - 5 * std, upper + 5 * std);
  const double a = (lower - mean) / std, b = (upper - mean) / std, mass = below(b) - below(a);
  const auto quantile = [&](double share) {
    double low = lower, high = upper;
    for (int halving = 0; halving < 60; ++halving) {
      const double middle = 0.5 * (low + high);
      (below((middle - mean) / std) - below(a) < share * mass ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  const double first = (density(a) - density(b)) / mass, second = (a * density(a) - b * density(b)) / mass;
  Parameter out{"poisson_ratio", region, "1"};
  out.value = quantile(0.5);
  out.lower_95 = quantile(0.025);
  out.upper_95 = quantile(0.975);
  out.std = std * std::sqrt(std::max(1 + second - first * first, 0.0));
  out.determined = out.std < 0.6 * (upper - lower) / std::sqrt(12.0);
  return out;
}

double log_share_in_range(double at, double beyond, double std, double lower, double upper) {
  const double range = (upper - lower) / std, off = beyond / std;
  constexpr double far = 20;  // its tail is an exponential there, and soon less than there are numbers for
  if (off > far) return std::log1p(-std::exp(-off * range)) - std::log(off * std::sqrt(2 * EIGEN_PI));
  if (off > 0) return 0.5 * off * off + std::log(below(-off) - below(-off - range));
  return std::log(below((upper - at) / std) - below((lower - at) / std));
}

double highest_poisson(const Unknowns& unknowns, const VectorX& at) {
  double highest = at(poisson);
  for (int k = unknowns.first_own_poisson(); k < unknowns.parameter_count(); ++k) highest = std::max(highest, at(k));
  return highest;
}

void OwnPoisson::move(const AnswerShift& shift) {
  if (shift.region_poisson.size() == mean.size()) mean += shift.region_poisson;
}

void OwnPoisson::widen(const AnswerShift& shift) {
  if (shift.region_poisson.size() == std.size()) std = (std.array().square() + shift.region_poisson.array().square()).sqrt();
}

std::vector<Parameter> OwnPoisson::parameters(const Unknowns& unknowns, const std::vector<std::string>& names) const {
  std::vector<Parameter> out;
  for (Index r = 0; r < mean.size(); ++r) {
    const Unknown& prior = unknowns[unknowns.first_own_poisson() + static_cast<int>(r)];
    out.push_back(cut_normal(mean(r), std(r), prior.lower, prior.upper, names.at(1 + static_cast<std::size_t>(r))));
  }
  return out;
}

MatrixX OwnPoisson::covariance_with(const MatrixX& others) const {
  if (mean.size() == 0) return others;
  VectorX all(correlation.rows());
  all << others.diagonal().cwiseMax(0).cwiseSqrt(), std;
  MatrixX out = all.asDiagonal() * correlation * all.asDiagonal();
  out.topLeftCorner(others.rows(), others.cols()) = others;
  return out;
}

OwnPoisson own_poisson(const Unknowns& unknowns, const Optimum& optimum, const MatrixX& covariance, const std::vector<int>& moving) {
  OwnPoisson out;
  const Index count = unknowns.own_poisson_count(), young = 1 + unknowns.ratio_count();
  if (count == 0) return out;
  const MatrixX of_young = log_young_of_regions(unknowns, moving);
  MatrixX parts = MatrixX::Zero(1 + young + count, static_cast<Index>(moving.size()));
  parts.row(0) = of_young.row(0);
  parts.middleRows(2, young - 1) = of_young.bottomRows(young - 1);
  for (std::size_t k = 0; k < moving.size(); ++k) {
    if (moving[k] == poisson) parts(1, static_cast<Index>(k)) = 1;
    const Index own = moving[k] - unknowns.first_own_poisson();
    if (own >= 0 && own < count) parts(1 + young + own, static_cast<Index>(k)) = 1;
  }
  const MatrixX all = parts * covariance * parts.transpose();
  const VectorX inverse = all.diagonal().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
  out.correlation = inverse.asDiagonal() * all * inverse.asDiagonal();
  out.mean = optimum.unknowns.segment(unknowns.first_own_poisson(), count);
  const VectorX& gradient = optimum.evaluation.gradient;
  for (Index r = 0; r < count; ++r) {
    const int own = unknowns.first_own_poisson() + static_cast<int>(r);
    if (unknowns[own].fixed || !is_held(unknowns, optimum.unknowns, gradient, own)) continue;
    std::vector<int> let_go{own};
    for (const int k : moving_unknowns(unknowns, optimum.unknowns, gradient)) let_go.push_back(k);
    out.mean(r) += newton_step(optimum.evaluation, let_go).move(0);
  }
  out.std = all.diagonal().tail(count).cwiseMax(1e-12).cwiseSqrt();
  return out;
}

}  // namespace palpate::estimation
