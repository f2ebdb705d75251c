// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/response_span.hpp"

#include <Eigen/Eigenvalues>

#include "palpate/fem/chebyshev.hpp"

namespace palpate::fem {

ResponseSpan::Terms ResponseSpan::terms_at(double poisson_ratio) const {
  Terms at;
  at.value.resize(static_cast<Index>(share[0].cols()));
  const double z = poisson_to_z(poisson_ratio);
  chebyshev((z - middle) / half, at.value, at.d_poisson);
  at.d_poisson /= half * poisson_d_z(z);
  return at;
}

ResponseSpan span_of(const std::vector<MatrixX>& coefficients, Index rows, double middle, double half) {
  constexpr double negligible = 3e-8;
  const Index terms = static_cast<Index>(coefficients.size()), loads = static_cast<Index>(coefficients[0].cols());
  ResponseSpan out;
  out.middle = middle;
  out.half = half;
  out.first = {0};
  std::vector<MatrixX> fields;
  for (Index load = 0; load < loads; ++load) {
    MatrixX of_load(rows, terms);
    for (Index i = 0; i < terms; ++i) of_load.col(i) = coefficients[static_cast<std::size_t>(i)].col(load).head(rows);
    // Principal directions of the coefficients. Squares know them to half the digits; what is left out is right all the same.
    const Eigen::SelfAdjointEigenSolver<MatrixX> principal(of_load.transpose() * of_load);
    const VectorX& size2 = principal.eigenvalues();  // ascending
    Index kept = 0;
    while (kept < terms && size2(terms - 1 - kept) > negligible * negligible * size2(terms - 1)) ++kept;
    const MatrixX directions = principal.eigenvectors().rightCols(kept);
    fields.push_back(of_load * directions);
    out.share.push_back(directions.transpose());
    out.first.push_back(out.first.back() + kept);
  }
  out.fields.resize(rows, out.first.back());
  for (Index load = 0; load < loads; ++load)
    out.fields.middleCols(out.first[static_cast<std::size_t>(load)], out.count_of(load)) = fields[static_cast<std::size_t>(load)];
  out.reach_m = VectorX::Zero(out.fields.cols());
  for (Index field = 0; field < out.fields.cols(); ++field)
    for (Index row = 0; row + 3 <= rows; row += 3)
      out.reach_m(field) = std::max(out.reach_m(field), out.fields.col(field).segment<3>(row).norm());
  return out;
}

}  // namespace palpate::fem
