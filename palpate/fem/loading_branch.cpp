// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/loading_branch.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/chebyshev.hpp"

namespace palpate::fem {
namespace {

constexpr double kAcross = 0.1;  // of the load along a0: beyond it first order says too little

}  // namespace

LoadingBranch::LoadingBranch(const Statics& statics, const Eigen::SparseMatrix<double>& watched,
                             const VectorX& force_over_young, Options options)
    : statics_(statics), watched_(watched), direction_(force_over_young), options_(options) {
  if (!(options_.poisson_upper > options_.poisson_lower))
    throw Error("needs a range of Poisson ratios", "LoadingBranch::Options::poisson_upper");
  if (!(direction_.norm() > 0)) throw Error("must not be zero", "LoadingBranch force_over_young");
  int poissons = 4, loads = 5;
  for (;;) {
    if (!fill(poissons, loads)) {
      end_ *= 0.7;  // the material gave way on the grid: a shorter branch, as coarse as the first
      if (end_ < 0.02 || solves_ > options_.max_solves) {
        end_ = 0;
        return;
      }
      poissons = 4;
      loads = 5;
      continue;
    }
    // The last coefficients of each direction say which needs more points.
    const auto size_of = [&](int i, int j) {
      return coefficients_[static_cast<std::size_t>(i * loads_ + j)].col(0).cwiseAbs().maxCoeff();
    };
    double tail_z = 0, tail_t = 0, size = 0;
    for (int i = 0; i < poissons_; ++i)
      for (int j = 0; j < loads_; ++j) {
        size = std::max(size, size_of(i, j));
        if (i >= poissons_ - 1) tail_z = std::max(tail_z, size_of(i, j));
        if (j >= loads_ - 1) tail_t = std::max(tail_t, size_of(i, j));
      }
    error_ = size > 0 ? std::max(tail_z, tail_t) / size : 0;
    if (error_ <= options_.tolerance) return;
    if (tail_z > 0.5 * options_.tolerance * size) poissons += 2;
    if (tail_t > 0.5 * options_.tolerance * size) loads += 3;
    if (solves_ + poissons * loads > options_.max_solves) return;  // the error says how far it is
  }
}

bool LoadingBranch::fill(int poissons, int loads) {
  const double low = poisson_to_z(options_.poisson_lower), high = poisson_to_z(options_.poisson_upper);
  const VectorX x = chebyshev_points(poissons), y = chebyshev_points(loads);
  const Index k = static_cast<Index>(direction_.size());
  std::vector<MatrixX> values(static_cast<std::size_t>(poissons * loads));
  const VectorX no_motion(0);
  for (int i = 0; i < poissons; ++i) {
    const double nu = z_to_poisson(0.5 * (low + high) + 0.5 * (high - low) * x(i));
    VectorX start;
    double t_before = 0;
    for (int j = 0; j < loads; ++j) {
      const double t = 0.5 * end_ * (1 + y(j));
      // E = 1: the energy is proportional to it. The state before, moved along its derivative, starts the next.
      if (start.size() > 0) start *= t / t_before;
      const Equilibrium e = statics_.solve(1.0, nu, t * direction_, no_motion, start.size() > 0 ? &start : nullptr);
      ++solves_;
      if (!e.converged || e.inverted_elements > 0) return false;
      const SensitivityAlong s = statics_.sensitivity_along(e, MatrixX::Identity(k, k), MatrixX::Zero(0, k));
      MatrixX& value = values[static_cast<std::size_t>(i * loads + j)];
      value.resize(watched_.rows(), 1 + k);
      value.col(0) = watched_ * e.displacement_m / t;
      value.rightCols(k) = watched_ * s.d_along;
      start = e.displacement_m;
      t_before = t;
    }
  }
  const MatrixX to_z = chebyshev_coefficients(poissons), to_t = chebyshev_coefficients(loads);
  coefficients_.assign(values.size(), MatrixX::Zero(watched_.rows(), 1 + k));
  for (int i = 0; i < poissons; ++i)
    for (int j = 0; j < loads; ++j)
      for (int a = 0; a < poissons; ++a)
        for (int b = 0; b < loads; ++b)
          coefficients_[static_cast<std::size_t>(i * loads + j)] +=
              to_z(i, a) * to_t(j, b) * values[static_cast<std::size_t>(a * loads + b)];
  poissons_ = poissons;
  loads_ = loads;
  return true;
}

double LoadingBranch::along(const VectorX& force_over_young) const {
  return force_over_young.dot(direction_) / direction_.squaredNorm();
}

bool LoadingBranch::covers(double poisson_ratio, const VectorX& force_over_young) const {
  if (end_ <= 0 || error_ > options_.tolerance) return false;
  if (poisson_ratio < options_.poisson_lower || poisson_ratio > options_.poisson_upper) return false;
  const double t = along(force_over_young);
  if (!(t > 0 && t <= end_)) return false;
  return (force_over_young - t * direction_).norm() <= kAcross * t * direction_.norm();
}

LoadingBranch::Point LoadingBranch::at(double poisson_ratio, const VectorX& force_over_young) const {
  const double low = poisson_to_z(options_.poisson_lower), high = poisson_to_z(options_.poisson_upper);
  const double z = poisson_to_z(poisson_ratio), t = along(force_over_young);
  VectorX tz(poissons_), dz, tt(loads_), dt;
  chebyshev((2 * z - low - high) / (high - low), tz, dz);
  chebyshev(2 * t / end_ - 1, tt, dt);
  const double chain = 2 / ((high - low) * poisson_d_z(z));
  MatrixX value = MatrixX::Zero(coefficients_[0].rows(), coefficients_[0].cols());
  MatrixX d_nu = value, d_t = value;
  for (int i = 0; i < poissons_; ++i)
    for (int j = 0; j < loads_; ++j) {
      const MatrixX& c = coefficients_[static_cast<std::size_t>(i * loads_ + j)];
      value += tz(i) * tt(j) * c;
      if (i > 0) d_nu += chain * dz(i) * tt(j) * c;
      if (j > 0) d_t += 2 / end_ * tz(i) * dt(j) * c;
    }
  // u(t, across) = t v(t) + G(t) across; derivatives are those of this answer, so that a fit descends on what it evaluates.
  const Index k = static_cast<Index>(direction_.size());
  const VectorX across = force_over_young - t * direction_;
  const VectorX side = value.rightCols(k) * across;
  const VectorX along_a0 = value.col(0) + t * d_t.col(0) + d_t.rightCols(k) * across - value.rightCols(k) * direction_;
  Point out;
  out.watched_m = t * value.col(0) + side;
  out.d_poisson = t * d_nu.col(0) + d_nu.rightCols(k) * across;
  out.d_force_over_young = value.rightCols(k) + along_a0 * (direction_.transpose() / direction_.squaredNorm());
  const double size = (t * value.col(0)).cwiseAbs().maxCoeff();
  out.across = size > 0 ? std::pow(side.cwiseAbs().maxCoeff() / size, 2) : 0;
  return out;
}

}  // namespace palpate::fem
