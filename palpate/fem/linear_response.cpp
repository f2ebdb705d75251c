// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_response.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>

#include "palpate/core/error.hpp"
#include "palpate/fem/chebyshev.hpp"

namespace palpate::fem {
namespace {

struct Range {
  double middle, half;
  double to_unit(double z) const { return (z - middle) / half; }
};

// Semi-axes of the largest Bernstein ellipse without a pole: the error of degree d falls like this to the power -d.
double convergence_rate(const Range& range) {
  const auto rho = [&](std::complex<double> pole) {
    const std::complex<double> x = (pole - range.middle) / range.half;
    const std::complex<double> root = std::sqrt(x * x - 1.0);
    return std::max(std::abs(x + root), std::abs(x - root));
  };
  return std::min(rho({range.middle, EIGEN_PI}), rho({poisson_to_z(-1), 0}));
}

MatrixX stacked(const UnitResponses& r, bool slopes) {
  const Index k = static_cast<Index>(r.force.cols()), m = static_cast<Index>(r.motion.cols()),
              rows = static_cast<Index>(r.force.rows());
  MatrixX all(rows + m + 1, k + m);
  all.topLeftCorner(rows, k) = slopes ? r.force_d_poisson : r.force;
  all.topRightCorner(rows, m) = slopes ? r.motion_d_poisson : r.motion;
  all.block(rows, 0, m, k) = slopes ? r.reaction_force_d_poisson : r.reaction_force;
  all.block(rows, k, m, m) = slopes ? r.reaction_motion_d_poisson : r.reaction_motion;
  all.bottomRows<1>().setZero();
  return all;
}

// The largest of the last two coefficients over the largest value at the nodes (the first half of `data`): of a column's
// watched rows, and of reactions to forces and to motions, each kind on its own.
double last_coefficients(const std::vector<MatrixX>& data, const std::vector<MatrixX>& coefficients, Index rows) {
  const Index m = static_cast<Index>(data[0].rows()) - rows - 1, k = static_cast<Index>(data[0].cols()) - m;
  double error = 0;
  const auto compare = [&](Index row, Index column, Index height, Index width) {
    if (height == 0 || width == 0) return;
    double size = 0, tail = 0;
    for (std::size_t j = 0; j < data.size() / 2; ++j)
      size = std::max(size, data[j].block(row, column, height, width).cwiseAbs().maxCoeff());
    for (std::size_t i = coefficients.size() - 2; i < coefficients.size(); ++i)
      tail = std::max(tail, coefficients[i].block(row, column, height, width).cwiseAbs().maxCoeff());
    if (size > 0) error = std::max(error, tail / size);
  };
  for (Index c = 0; c < k + m; ++c) compare(0, c, rows, 1);
  compare(rows, 0, m, k);
  compare(rows, k, m, m);
  return error;
}

/// What is asked of every node, too, below what is watched.
Eigen::SparseMatrix<double> over_field(const Eigen::SparseMatrix<double>& watched) {
  Eigen::SparseMatrix<double, Eigen::RowMajor> all = watched;
  all.conservativeResize(watched.rows() + watched.cols(), watched.cols());
  for (Eigen::Index i = 0; i < watched.cols(); ++i) all.insert(watched.rows() + i, i) = 1;
  return all;
}

/// Takes the rows below the first ones off an answer. @returns them: values, slopes to nu
std::pair<MatrixX, MatrixX> cut_below(UnitResponses& r, Index rows) {
  const Index k = static_cast<Index>(r.force.cols()), m = static_cast<Index>(r.motion.cols()),
              below = static_cast<Index>(r.force.rows()) - rows;
  MatrixX values(below, k + m), slopes(below, k + m);
  values << r.force.bottomRows(below), r.motion.bottomRows(below);
  slopes << r.force_d_poisson.bottomRows(below), r.motion_d_poisson.bottomRows(below);
  for (MatrixX* all : {&r.force, &r.motion, &r.force_d_poisson, &r.motion_d_poisson}) all->conservativeResize(rows, Eigen::NoChange);
  return {std::move(values), std::move(slopes)};
}

/// Coefficients of the polynomial through values (first half of `data`) and slopes at the nodes.
std::vector<MatrixX> coefficients_of(const std::vector<MatrixX>& data, const MatrixX& inverse) {
  std::vector<MatrixX> out(data.size());
  for (std::size_t i = 0; i < data.size(); ++i) {
    out[i] = inverse(static_cast<Index>(i), 0) * data[0];
    for (std::size_t j = 1; j < data.size(); ++j) out[i] += inverse(static_cast<Index>(i), static_cast<Index>(j)) * data[j];
  }
  return out;
}

}  // namespace

LinearResponse::LinearResponse(const Statics& statics, Eigen::SparseMatrix<double> watched, Options options)
    : statics_(statics), watched_(std::move(watched)), options_(options) {
  if (!statics.is_linear()) throw Error("superposes loads only for a linear material", "LinearResponse");
  if (!(options_.tolerance > 0)) throw Error("must be positive", "LinearResponse::Options::tolerance");
}

double LinearResponse::interpolation_error() const {
  const std::lock_guard lock(mutex_);
  return std::max(error_, residual_);
}

int LinearResponse::factorisations() const {
  const std::lock_guard lock(mutex_);
  return factorisations_;
}

int LinearResponse::load_cases() const {
  const std::lock_guard lock(mutex_);
  return load_cases_;
}

UnitResponses LinearResponse::solve(double poisson_ratio, const Eigen::SparseMatrix<double>& watched) const {
  UnitResponses solved = statics_.unit_responses(poisson_ratio, watched);
  ++factorisations_;
  load_cases_ += 2 * static_cast<int>(solved.force.cols() + solved.motion.cols());  // values and slopes
  return solved;
}

std::shared_ptr<const UnitResponses> LinearResponse::at(double poisson_ratio) const {
  const std::lock_guard lock(mutex_);
  for (auto known = recent_.begin(); known != recent_.end(); ++known) {
    if ((*known)->poisson_ratio != poisson_ratio) continue;
    std::rotate(known, known + 1, recent_.end());
    return recent_.back();
  }
  const bool inside = poisson_ratio >= options_.poisson_lower && poisson_ratio <= options_.poisson_upper;
  if (inside && usable_ && coefficients_.empty() && options_.poisson_upper > options_.poisson_lower) make_polynomial();
  std::shared_ptr<const UnitResponses> answer;
  if (inside && !coefficients_.empty()) {
    answer = std::make_shared<UnitResponses>(interpolate(poisson_ratio, 0));
  } else {
    answer = std::make_shared<UnitResponses>(solve(poisson_ratio, watched_));
  }
  // A search that is refused a step comes back to where it was, and one over nu to the same places as data come in.
  constexpr double kept_bytes = 5e7;
  const std::size_t kept = std::clamp<std::size_t>(static_cast<std::size_t>(kept_bytes / (16.0 * static_cast<double>(answer->force.size() + 1))), 4, 24);
  recent_.push_back(answer);
  if (recent_.size() > kept) recent_.erase(recent_.begin());
  return answer;
}

void LinearResponse::make_polynomial() const {
  const double low = poisson_to_z(options_.poisson_lower), high = poisson_to_z(options_.poisson_upper);
  const Range range{0.5 * (low + high), 0.5 * (high - low)};
  const double rate = convergence_rate(range);
  // The last coefficients say whether it is enough; of the bodies that were looked at they began at a fiftieth of the first one.
  constexpr double begin = 0.3;
  double wanted = std::log(begin / options_.tolerance) / (2 * std::log(rate));
  usable_ = false;
  const Eigen::Index columns = statics_.boundary().forces.cols() + statics_.boundary().motions.cols();
  Eigen::SparseMatrix<double> all_rows;  // made where a field is kept
  while (wanted <= options_.max_factorisations) {
    const int nodes = std::max(3, static_cast<int>(std::ceil(wanted)));
    const Index terms = 2 * nodes;
    std::vector<MatrixX> data(static_cast<std::size_t>(terms)), field_data;
    const double field_bytes = 8.0 * terms * static_cast<double>(watched_.cols()) * static_cast<double>(columns);
    if (field_bytes > 0 && field_bytes <= options_.field_limit_bytes) {
      field_data.resize(data.size());
      if (all_rows.rows() == 0) all_rows = over_field(watched_);
    }
    const Eigen::SparseMatrix<double>& wanted_rows = field_data.empty() ? watched_ : all_rows;
    MatrixX system(terms, terms);
    VectorX value(terms), slope(terms);
    VectorX gradients;
    double residual = 0;
    for (int j = 0; j < nodes; ++j) {
      const double x = std::cos(EIGEN_PI * (2 * j + 1) / (2 * nodes));
      const double z = range.middle + range.half * x;
      UnitResponses solved = solve(z_to_poisson(z), wanted_rows);
      residual = std::max(residual, solved.residual);
      const auto at = static_cast<std::size_t>(j);
      const double to_slope = poisson_d_z(z) * range.half;
      if (!field_data.empty()) {
        auto [field, field_slope] = cut_below(solved, static_cast<Index>(watched_.rows()));
        field_data[at] = std::move(field);
        field_data[at + static_cast<std::size_t>(nodes)] = to_slope * field_slope;
      }
      data[at] = stacked(solved, false);
      if (16.0 * static_cast<double>(data[at].size()) * nodes > options_.memory_limit_bytes) return;
      VectorX largest(data[at].cols());
      largest << solved.largest_gradient_force, solved.largest_gradient_motion;
      gradients = j == 0 ? largest : VectorX(gradients.cwiseMax(largest));
      data[at + static_cast<std::size_t>(nodes)] = to_slope * stacked(solved, true);
      chebyshev(x, value, slope);
      system.row(j) = value.transpose();
      system.row(nodes + j) = slope.transpose();
    }
    const MatrixX inverse = system.partialPivLu().inverse();
    std::vector<MatrixX> coefficients = coefficients_of(data, inverse);
    const double error = last_coefficients(data, coefficients, static_cast<Index>(watched_.rows()));
    if (error <= options_.tolerance) {
      coefficients_ = std::move(coefficients);
      coefficients_[0].bottomRows<1>() = gradients.transpose();
      field_ = coefficients_of(field_data, inverse);
      error_ = error;
      residual_ = residual;
      usable_ = true;
      return;
    }
    wanted = nodes + 4;
  }
}

std::shared_ptr<const ResponseSpan> LinearResponse::span(Index rows, double poisson_ratio) const {
  const std::lock_guard lock(mutex_);
  if (coefficients_.empty() || coefficients_[0].cols() == 0 || poisson_ratio < options_.poisson_lower || poisson_ratio > options_.poisson_upper) return nullptr;
  if (!span_) {
    const double low = poisson_to_z(options_.poisson_lower), high = poisson_to_z(options_.poisson_upper);
    span_ = std::make_shared<const ResponseSpan>(span_of(coefficients_, rows, 0.5 * (low + high), 0.5 * (high - low)));
  }
  return span_;
}

std::optional<VectorX> LinearResponse::displacement_m(double poisson_ratio, const VectorX& force_over_young,
                                                      const VectorX& motion) const {
  const std::lock_guard lock(mutex_);
  if (field_.empty() || poisson_ratio < options_.poisson_lower || poisson_ratio > options_.poisson_upper) return std::nullopt;
  const double low = poisson_to_z(options_.poisson_lower), high = poisson_to_z(options_.poisson_upper);
  VectorX value(static_cast<Index>(field_.size())), slope;
  chebyshev(Range{0.5 * (low + high), 0.5 * (high - low)}.to_unit(poisson_to_z(poisson_ratio)), value, slope);
  VectorX coefficients(force_over_young.size() + motion.size());
  coefficients << force_over_young, motion;
  VectorX out = field_[0] * coefficients;
  for (std::size_t i = 1; i < field_.size(); ++i) out += field_[i] * (value(static_cast<Index>(i)) * coefficients);
  return out;
}

UnitResponses LinearResponse::interpolate(double poisson_ratio, Index first_row) const {
  const double low = poisson_to_z(options_.poisson_lower), high = poisson_to_z(options_.poisson_upper);
  const Range range{0.5 * (low + high), 0.5 * (high - low)};
  const double z = poisson_to_z(poisson_ratio);
  VectorX value(static_cast<Index>(coefficients_.size())), slope;
  chebyshev(range.to_unit(z), value, slope);
  const double chain = 1 / (range.half * poisson_d_z(z));
  MatrixX y(coefficients_[0].rows() - first_row, coefficients_[0].cols()), dy(y.rows(), y.cols());
  constexpr Index piece = 512;  // sums stay in the first cache while every coefficient is read once
  for (Index column = 0; column < y.cols(); ++column) {
    for (Index from = 0; from < y.rows(); from += piece) {
      const Index size = std::min<Index>(piece, static_cast<Index>(y.rows()) - from);
      auto sum = y.col(column).segment(from, size), sum_of_slopes = dy.col(column).segment(from, size);
      sum = coefficients_[0].col(column).segment(first_row + from, size);
      sum_of_slopes.setZero();
      for (std::size_t i = 1; i < coefficients_.size(); ++i) {
        const auto coefficient = coefficients_[i].col(column).segment(first_row + from, size);
        sum += value(static_cast<Index>(i)) * coefficient;
        sum_of_slopes += chain * slope(static_cast<Index>(i)) * coefficient;
      }
    }
  }
  const Index rows = static_cast<Index>(watched_.rows()) - first_row, m = static_cast<Index>(y.rows()) - rows - 1;
  const Index k = static_cast<Index>(y.cols()) - m;
  UnitResponses out;
  out.poisson_ratio = poisson_ratio;
  out.force = y.topLeftCorner(rows, k);
  out.motion = y.topRightCorner(rows, m);
  out.force_d_poisson = dy.topLeftCorner(rows, k);
  out.motion_d_poisson = dy.topRightCorner(rows, m);
  out.reaction_force = y.block(rows, 0, m, k);
  out.reaction_motion = y.block(rows, k, m, m);
  out.reaction_force_d_poisson = dy.block(rows, 0, m, k);
  out.reaction_motion_d_poisson = dy.block(rows, k, m, m);
  out.largest_gradient_force = y.bottomRows<1>().head(k).transpose();
  out.largest_gradient_motion = y.bottomRows<1>().tail(m).transpose();
  out.residual = std::max(residual_, error_);
  return out;
}

}  // namespace palpate::fem
