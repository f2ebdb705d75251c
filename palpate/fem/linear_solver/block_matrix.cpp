// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/block_matrix.hpp"

#include <algorithm>

#if defined(__x86_64__) && defined(__GNUC__)
#define PALPATE_AVX2 __attribute__((target("avx2,fma")))
#define PALPATE_X86 1
#endif

namespace palpate::fem {
namespace {

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

void multiply_plain(const Index* begin, const Index* column, const double* values, const double* x, double* y, Index first,
                    Index last) {
  for (Index row = first; row < last; ++row) {
    double sum[3] = {0, 0, 0};
    for (Index e = begin[row]; e < begin[row + 1]; ++e) {
      const double* const a = values + 9 * static_cast<std::ptrdiff_t>(e);
      const double* const v = x + 3 * static_cast<std::ptrdiff_t>(column[e]);
      for (int i = 0; i < 3; ++i) sum[i] += a[i] * v[0] + a[3 + i] * v[1] + a[6 + i] * v[2];
    }
    std::copy_n(sum, 3, y + 3 * static_cast<std::ptrdiff_t>(row));
  }
}

#ifdef PALPATE_X86
/// A column of a block is loaded four wide; the fourth lane is the next column's first number and falls off at the end.
PALPATE_AVX2 void multiply_avx2(const Index* begin, const Index* column, const double* values, const double* x, double* y,
                                Index first, Index last) {
  typedef double Vector __attribute__((vector_size(32)));
  typedef double Unaligned __attribute__((vector_size(32), aligned(8), may_alias));
  for (Index row = first; row < last; ++row) {
    Vector sum0 = {}, sum1 = {}, sum2 = {};
    const double* a = values + 9 * static_cast<std::ptrdiff_t>(begin[row]);
    for (Index e = begin[row]; e < begin[row + 1]; ++e, a += 9) {
      const double* const v = x + 3 * static_cast<std::ptrdiff_t>(column[e]);
      __builtin_prefetch(a + 9 * 16);
      sum0 += *reinterpret_cast<const Unaligned*>(a) * v[0];
      sum1 += *reinterpret_cast<const Unaligned*>(a + 3) * v[1];
      sum2 += *reinterpret_cast<const Unaligned*>(a + 6) * v[2];
    }
    const Vector sum = sum0 + sum1 + sum2;
    double* const to = y + 3 * static_cast<std::ptrdiff_t>(row);
    to[0] = sum[0];
    to[1] = sum[1];
    to[2] = sum[2];
  }
}
#endif

using Multiply = void (*)(const Index*, const Index*, const double*, const double*, double*, Index, Index);

Multiply best_multiply() {
#ifdef PALPATE_X86
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return &multiply_avx2;
#endif
  return &multiply_plain;
}

}  // namespace

BlockMatrix::BlockMatrix(const Eigen::SparseMatrix<double>& lower, const QuotientGraph& graph,
                         const std::vector<Index>& order) {
  const Index rows = graph.group_count();
  std::vector<Index> row_of(at(rows));
  for (Index row = 0; row < rows; ++row) row_of[at(order[at(row)])] = row;
  padded_.resize(static_cast<std::size_t>(lower.cols()));
  begin_.resize(at(rows) + 1, 0);
  diagonal_.resize(at(rows));
  column_.reserve(graph.neighbour.size() + at(rows));
  for (Index row = 0; row < rows; ++row) {
    const Index g = order[at(row)];
    for (Index u = graph.first_unknown[at(g)]; u < graph.first_unknown[at(g + 1)]; ++u) {
      padded_[at(u)] = 3 * row + u - graph.first_unknown[at(g)];
    }
    column_.push_back(row);
    for (Index e = graph.begin[at(g)]; e < graph.begin[at(g + 1)]; ++e)
      column_.push_back(row_of[at(graph.neighbour[at(e)])]);
    const auto first = column_.begin() + begin_[at(row)];
    std::sort(first, column_.end());
    diagonal_[at(row)] = static_cast<Index>(std::lower_bound(first, column_.end(), row) - column_.begin());
    begin_[at(row + 1)] = static_cast<Index>(column_.size());
  }
  values_.assign(9 * column_.size() + 3, 0.0);

  // Unknowns of one node follow each other, so a block is looked up once for up to three entries.
  const auto offset = [&](Index entry, Index row, Index column) {
    return 9 * static_cast<std::uint32_t>(entry) + static_cast<std::uint32_t>(3 * (column % 3) + row % 3);
  };
  const auto find = [&](Index row, Index column) {
    const auto first = column_.begin() + begin_[at(row)], last = column_.begin() + begin_[at(row + 1)];
    return static_cast<Index>(std::lower_bound(first, last, column) - column_.begin());
  };
  targets_.resize(static_cast<std::size_t>(lower.nonZeros()));
  for (Index column = 0; column < lower.cols(); ++column) {
    const Index c = padded_[at(column)];
    Index known = -1, direct = 0, mirrored = 0;
    for (Index e = lower.outerIndexPtr()[column]; e < lower.outerIndexPtr()[column + 1]; ++e) {
      const Index r = padded_[at(lower.innerIndexPtr()[e])];
      if (r / 3 != known) {
        known = r / 3;
        direct = find(known, c / 3);
        mirrored = find(c / 3, known);
      }
      targets_[at(e)] = {offset(direct, r, c), offset(mirrored, c, r)};
    }
  }
  for (Index row = 0; row < rows; ++row) {
    const Index g = order[at(row)];
    for (Index i = graph.first_unknown[at(g + 1)] - graph.first_unknown[at(g)]; i < 3; ++i) {
      values_[9 * at(diagonal_[at(row)]) + 4 * at(i)] = 1.0;
    }
  }
}

void BlockMatrix::set_values(const double* values) {
  for (std::size_t e = 0; e < targets_.size(); ++e) {
    values_[targets_[e].direct] = values[e];
    values_[targets_[e].mirrored] = values[e];
  }
}

void BlockMatrix::multiply(const double* x, double* y, Index first, Index last) const {
  static const Multiply best = best_multiply();
  best(begin_.data(), column_.data(), values_.data(), x, y, first, last);
}

Mat3 BlockMatrix::diagonal_block(Index row) const {
  return Eigen::Map<const Mat3>(values_.data() + 9 * at(diagonal_[at(row)]));
}

}  // namespace palpate::fem
