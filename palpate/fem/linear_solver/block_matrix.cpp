// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/block_matrix.hpp"

#include <algorithm>

#include "palpate/fem/linear_solver/at.hpp"

#if defined(__x86_64__) && defined(__GNUC__)
#define PALPATE_AVX2 __attribute__((target("avx2,fma")))
#define PALPATE_X86 1
#endif

namespace palpate::fem {
namespace {

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
  padded_.resize(static_cast<std::size_t>(lower.cols()));
  begin_.resize(at(rows) + 1, 0);
  for (Index row = 0; row < rows; ++row) {
    const Index g = order[at(row)];
    row_of[at(g)] = row;
    begin_[at(row + 1)] = begin_[at(row)] + 1 + graph.begin[at(g + 1)] - graph.begin[at(g)];
    for (Index u = graph.first_unknown[at(g)]; u < graph.first_unknown[at(g + 1)]; ++u) {
      padded_[at(u)] = 3 * row + u - graph.first_unknown[at(g)];
    }
  }
  // Columns come in ascending order to every row, so rows are sorted without sorting. `entry` says where the block in row
  // `neighbour[e]` and column g lies, for every edge e of g.
  diagonal_.resize(at(rows));
  column_.resize(at(begin_.back()));
  std::vector<Index> next(begin_.begin(), begin_.end() - 1), entry(graph.neighbour.size());
  for (Index column = 0; column < rows; ++column) {
    const Index g = order[at(column)];
    diagonal_[at(column)] = next[at(column)];
    column_[at(next[at(column)]++)] = column;
    for (Index e = graph.begin[at(g)]; e < graph.begin[at(g + 1)]; ++e) {
      Index& slot = next[at(row_of[at(graph.neighbour[at(e)])])];
      entry[at(e)] = slot;
      column_[at(slot++)] = column;
    }
  }
  values_.assign(9 * column_.size() + 3, 0.0);

  // Entries below the diagonal of group g belong to its later neighbours, in the order of the graph; seen from such a
  // neighbour, its earlier ones come up in the order of the graph as well.
  const auto offset = [](Index block, Index row, Index column) {
    return 9 * static_cast<std::uint32_t>(block) + static_cast<std::uint32_t>(3 * (column % 3) + row % 3);
  };
  std::vector<Index> earlier(graph.begin.begin(), graph.begin.end() - 1);  // next edge to an earlier neighbour
  std::vector<Index> edge_of(at(rows), 0);                                 // edge from the present group to a later one
  targets_.resize(static_cast<std::size_t>(lower.nonZeros()));
  std::vector<Index> mirrored(at(rows), 0);
  std::vector<Index> group_of(static_cast<std::size_t>(lower.cols()));
  for (Index g = 0; g < rows; ++g) {
    for (Index u = graph.first_unknown[at(g)]; u < graph.first_unknown[at(g + 1)]; ++u) group_of[at(u)] = g;
  }
  for (Index g = 0; g < rows; ++g) {
    for (Index e = graph.begin[at(g)]; e < graph.begin[at(g + 1)]; ++e) {
      const Index other = graph.neighbour[at(e)];
      if (other < g) continue;
      edge_of[at(other)] = entry[at(e)];
      mirrored[at(other)] = entry[at(earlier[at(other)]++)];
    }
    edge_of[at(g)] = mirrored[at(g)] = diagonal_[at(row_of[at(g)])];
    for (Index column = graph.first_unknown[at(g)]; column < graph.first_unknown[at(g + 1)]; ++column) {
      for (Index e = lower.outerIndexPtr()[column]; e < lower.outerIndexPtr()[column + 1]; ++e) {
        const Index unknown = lower.innerIndexPtr()[e], other = group_of[at(unknown)];
        const Index r = padded_[at(unknown)], c = padded_[at(column)];
        targets_[at(e)] = {offset(edge_of[at(other)], r, c), offset(mirrored[at(other)], c, r)};
      }
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
