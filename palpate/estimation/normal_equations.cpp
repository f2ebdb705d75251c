// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/normal_equations.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::estimation {

double tukey_rho(double residual, double cut) {
  const double t = residual / cut;
  if (!(std::abs(t) < 1)) return cut * cut / 6;
  const double keep = 1 - t * t;
  return cut * cut / 6 * (1 - keep * keep * keep);
}

double tukey_weight(double residual, double cut) {
  const double t = residual / cut;
  if (!(std::abs(t) < 1)) return 0;
  const double keep = 1 - t * t;
  return keep * keep;
}

double tukey_slope(double residual, double cut) {
  const double t2 = residual * residual / (cut * cut);
  return t2 < 1 ? (1 - t2) * (1 - 5 * t2) : 0;
}

double tukey_information_factor(double cut) {
  double weight = 0, psi_squared = 0, psi_slope = 0;
  constexpr int steps = 4000;
  for (int i = 0; i < steps; ++i) {
    const double r = cut * (2 * (i + 0.5) / steps - 1);
    const double density = std::exp(-0.5 * r * r) / std::sqrt(2 * EIGEN_PI) * 2 * cut / steps;
    const double w = tukey_weight(r, cut);
    weight += density * w;
    psi_squared += density * w * w * r * r;
    psi_slope += density * tukey_slope(r, cut);
  }
  return psi_slope * psi_slope / (psi_squared * weight);
}

Evaluation Evaluation::nothing(Index unknowns) {
  Evaluation out;
  out.hessian = MatrixX::Zero(unknowns, unknowns);
  out.robust_hessian = MatrixX::Zero(unknowns, unknowns);
  out.curvature = MatrixX::Zero(unknowns, unknowns);
  out.gradient = VectorX::Zero(unknowns);
  return out;
}

namespace {

/// What each square counts before the loss.
double relevance(const TermRows& rows, const Loss& loss) {
  const double of_neighbours = rows.cell.empty() ? 1 : loss.surface_weight;
  return rows.robust ? of_neighbours / (loss.widening * loss.widening) : of_neighbours;
}

}  // namespace

WeighedRows weigh(const TermRows& rows, const Loss& loss) {
  const double each = relevance(rows, loss);
  WeighedRows out;
  out.each = each;
  if (rows.shared_noise) {  // weights that stay: a quadratic form
    out.weight = each * rows.shared_noise->weight();
    for (Index i = 0; i < rows.residual.size(); ++i) {
      const bool there = std::isfinite(rows.residual(i));
      const double r = there ? rows.residual(i) : loss.tukey;  // a ray that passes by, of those that hit
      out.cost += 0.5 * out.weight(i) * r * r;
      if (!there) out.weight(i) = 0;
    }
    return out;
  }
  if (!rows.robust) {
    out.weight = VectorX::Constant(rows.residual.size(), each);
    out.cost = 0.5 * each * rows.residual.squaredNorm();
    return out;
  }
  out.weight.resize(rows.residual.size());
  const double per_cut2 = 1 / (loss.tukey * loss.tukey);
  double saved = 0, slopes = 0, weights = 0;  // of what an outlier costs
  for (Index i = 0; i < rows.residual.size(); ++i) {
    const double r = rows.residual(i), ratio2 = r * r * per_cut2;
    const double t2 = ratio2 < 1 ? ratio2 : 1, keep = 1 - t2;
    saved += keep * keep * keep;
    slopes += keep * (1 - 5 * t2);
    weights += keep * keep;
    out.weight(i) = each * keep * keep;
  }
  out.cost = each * loss.tukey * loss.tukey / 6 * (static_cast<double>(rows.residual.size()) - saved);
  constexpr double least = 0.3;  // where most rows are outliers the loss bends the other way: no step leads there
  if (weights > 0) out.bend = std::max(slopes / weights, least);
  return out;
}

void add_rows(const TermRows& rows, const Loss& loss, const std::vector<int>& places, Evaluation& out) {
  auto [each, weight, cost, bend] = weigh(rows, loss);
  const VectorX finite = (weight.array() == 0).select(0, rows.residual);
  const MatrixX weighted = weight.asDiagonal() * rows.jacobian;
  MatrixX block = rows.jacobian.transpose() * weighted;
  VectorX slope = weighted.transpose() * finite;
  if (rows.shared_noise) {
    const auto modes = rows.shared_noise->modes().transpose();
    const MatrixX of_rows = modes * weighted;
    const VectorX of_residual = modes * weight.cwiseProduct(finite);
    const MatrixX shrunk = rows.shared_noise->shrunk(of_rows) / each;
    block -= of_rows.transpose() * shrunk;
    slope -= shrunk.transpose() * of_residual;
    cost -= 0.5 * of_residual.dot(rows.shared_noise->shrunk(of_residual).col(0)) / each;
  }
  (rows.robust ? out.robust_cost : out.cost) += cost;
  for (std::size_t a = 0; a < places.size(); ++a) {
    out.gradient(places[a]) += slope(static_cast<Index>(a));
    for (std::size_t b = 0; b < places.size(); ++b) {
      const double entry = block(static_cast<Index>(a), static_cast<Index>(b));
      out.hessian(places[a], places[b]) += entry;
      out.curvature(places[a], places[b]) += bend * entry;
      if (rows.robust) out.robust_hessian(places[a], places[b]) += entry;
    }
  }
}

}  // namespace palpate::estimation
