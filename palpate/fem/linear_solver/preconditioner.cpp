// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/preconditioner.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

#include "palpate/fem/linear_solver/at.hpp"
#include "palpate/fem/linear_solver/large_array.hpp"

namespace palpate::fem {
namespace {

// Rigid motions of an aggregate whose nodes lie on a line, or that has lost unknowns, depend on each other; this share of
// the diagonal keeps the coarse matrix regular in single precision and changes the coarse correction by less than a per
// cent.
constexpr double kCoarseShift = 4e-6;

}  // namespace

RigidMotionPreconditioner::RigidMotionPreconditioner(const BlockMatrix& matrix, const Aggregates& aggregates,
                                                     const UnknownPlacement& placement)
    : matrix_(matrix), aggregates_(aggregates), inverse_diagonal_(at(matrix.block_rows())) {
  if (placement.empty()) return;
  const Index rows = matrix.block_rows(), count = aggregates.count();
  std::vector<std::array<Index, 3>> unknown_of(at(rows), {-1, -1, -1});
  for (std::size_t u = 0; u < matrix.padded().size(); ++u) {
    unknown_of[at(matrix.padded()[u] / 3)][at(matrix.padded()[u] % 3)] = static_cast<Index>(u);
  }
  aggregate_of_.resize(at(rows));
  modes_.assign(at(rows), Modes::Zero());
  for (Index a = 0; a < count; ++a) {
    const Index first = aggregates.begin[at(a)], last = aggregates.begin[at(a + 1)];
    Vec3 centre = Vec3::Zero();
    for (Index row = first; row < last; ++row) centre += placement.point_m.row(unknown_of[at(row)][0]).transpose();
    centre /= last - first;
    double radius = 0;
    for (Index row = first; row < last; ++row) {
      radius = std::max(radius, (placement.point_m.row(unknown_of[at(row)][0]).transpose() - centre).norm());
    }
    for (Index row = first; row < last; ++row) {
      aggregate_of_[at(row)] = a;
      for (int i = 0; i < 3; ++i) {
        const Index u = unknown_of[at(row)][at(i)];
        if (u < 0) continue;
        const Vec3 direction = placement.direction.row(u).transpose();
        const Vec3 arm = (placement.point_m.row(u).transpose() - centre) / (radius > 0 ? radius : 1.0);
        modes_[at(row)].row(i) << direction.cast<float>().transpose(), arm.cross(direction).cast<float>().transpose();
      }
    }
  }

  // Aggregates that share a block of the matrix.
  std::vector<std::vector<Index>> touching(at(count));
  for (Index row = 0; row < rows; ++row) {
    const Index a = aggregate_of_[at(row)];
    for (Index e = matrix.begin()[at(row)]; e < matrix.begin()[at(row + 1)]; ++e) {
      const Index b = aggregate_of_[at(matrix.columns()[at(e)])];
      if (b <= a && (touching[at(b)].empty() || touching[at(b)].back() != a)) touching[at(b)].push_back(a);
    }
  }
  pair_begin_.assign(1, 0);
  std::size_t pairs = 0;
  for (const auto& of_column : touching) pairs += of_column.size();
  std::vector<Eigen::Triplet<double>> pattern;
  make_large_room(pattern, 36 * pairs);
  for (Index b = 0; b < count; ++b) {
    pair_row_.insert(pair_row_.end(), touching[at(b)].begin(), touching[at(b)].end());
    pair_begin_.push_back(static_cast<Index>(pair_row_.size()));
    for (const Index a : touching[at(b)]) {
      for (int j = 0; j < 6; ++j) {
        for (int i = a == b ? j : 0; i < 6; ++i) pattern.emplace_back(6 * a + i, 6 * b + j, 1.0);
      }
    }
  }
  coarse_.resize(6 * count, 6 * count);
  coarse_.setFromTriplets(pattern.begin(), pattern.end());
  coarse_vector_.resize(6 * count);
  coarse_factor_ = std::make_unique<FrontFactor<float>>(std::make_shared<const FrontTree>(build_front_tree(coarse_, 6)), 1);
}

bool RigidMotionPreconditioner::update() {
  const Index rows = matrix_.block_rows();
  for (Index row = 0; row < rows; ++row) {
    const Mat3 block = matrix_.diagonal_block(row);
    if (block.llt().info() != Eigen::Success) return false;
    inverse_diagonal_[at(row)] = block.inverse();
  }
  if (modes_.empty()) return true;

  // Z' A Z, one aggregate of rows after the other; rows are sorted by aggregate, so the columns of a row are too.
  using Coarse = Eigen::Matrix<double, 6, 6>;
  std::vector<Coarse> blocks(pair_row_.size(), Coarse::Zero());
  for (Index row = 0; row < rows; ++row) {
    const Index a = aggregate_of_[at(row)];
    const Eigen::Matrix<double, 6, 3> own = modes_[at(row)].cast<double>().transpose();
    Index e = matrix_.begin()[at(row)];
    const Index last = matrix_.begin()[at(row + 1)];
    while (e < last) {
      const Index b = aggregate_of_[at(matrix_.columns()[at(e)])];
      if (b > a) break;
      Eigen::Matrix<double, 3, 6> product = Eigen::Matrix<double, 3, 6>::Zero();
      for (; e < last && aggregate_of_[at(matrix_.columns()[at(e)])] == b; ++e) {
        product.noalias() += Eigen::Map<const Mat3>(matrix_.block(e)) * modes_[at(matrix_.columns()[at(e)])].cast<double>();
      }
      const auto from = pair_row_.begin() + pair_begin_[at(b)], to = pair_row_.begin() + pair_begin_[at(b + 1)];
      blocks[static_cast<std::size_t>(std::lower_bound(from, to, a) - pair_row_.begin())].noalias() += own * product;
    }
  }
  double* value = coarse_.valuePtr();
  for (Index b = 0; b < aggregates_.count(); ++b) {
    for (int j = 0; j < 6; ++j) {
      for (Index pair = pair_begin_[at(b)]; pair < pair_begin_[at(b + 1)]; ++pair) {
        const bool diagonal = pair_row_[at(pair)] == b;
        for (int i = diagonal ? j : 0; i < 6; ++i) {
          const double entry = blocks[at(pair)](i, j);
          if (diagonal && i == j) {
            const double scale = blocks[at(pair)].diagonal().maxCoeff();
            *value++ = entry > 0 ? entry + kCoarseShift * scale : (scale > 0 ? scale : 1.0);
          } else {
            *value++ = entry;
          }
        }
      }
    }
  }
  return coarse_factor_->factorise(coarse_.valuePtr(), true);
}

void RigidMotionPreconditioner::apply(const double* r, double* z, const ThreadTeam& team) {
  const Share share = share_of(team, aggregates_.count());
  const Index first = aggregates_.begin[at(share.first)], last = aggregates_.begin[at(share.last)];
  if (modes_.empty()) {
    for (Index row = first; row < last; ++row) {
      Eigen::Map<Vec3>(z + 3 * static_cast<std::ptrdiff_t>(row)).noalias() =
          inverse_diagonal_[at(row)] * Eigen::Map<const Vec3>(r + 3 * static_cast<std::ptrdiff_t>(row));
    }
    return;
  }
  for (Index a = share.first; a < share.last; ++a) {
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero();
    for (Index row = aggregates_.begin[at(a)]; row < aggregates_.begin[at(a + 1)]; ++row) {
      const Eigen::Map<const Vec3> residual(r + 3 * static_cast<std::ptrdiff_t>(row));
      sum.noalias() += modes_[at(row)].cast<double>().transpose() * residual;
    }
    coarse_vector_.segment<6>(6 * a) = sum;
  }
  team.meet();
  if (team.id == 0) coarse_factor_->solve(coarse_vector_.data(), 1, coarse_vector_.size());
  team.meet();
  for (Index a = share.first; a < share.last; ++a) {
    const Eigen::Matrix<double, 6, 1> motion = coarse_vector_.segment<6>(6 * a);
    for (Index row = aggregates_.begin[at(a)]; row < aggregates_.begin[at(a + 1)]; ++row) {
      const Eigen::Map<const Vec3> residual(r + 3 * static_cast<std::ptrdiff_t>(row));
      Eigen::Map<Vec3>(z + 3 * static_cast<std::ptrdiff_t>(row)).noalias() =
          inverse_diagonal_[at(row)] * residual + modes_[at(row)].cast<double>() * motion;
    }
  }
}

template <class Scalar>
FactorPreconditioner<Scalar>::FactorPreconditioner(const FrontFactor<Scalar>& factor, const std::vector<Index>& padded)
    : factor_(factor), padded_(padded), vector_(static_cast<Eigen::Index>(padded.size())) {}

template <class Scalar>
void FactorPreconditioner<Scalar>::apply(const double* r, double* z, const ThreadTeam& team) {
  team.meet();  // r is complete
  if (team.id == 0) {
    for (std::size_t u = 0; u < padded_.size(); ++u) vector_[static_cast<Eigen::Index>(u)] = r[padded_[u]];
    factor_.solve(vector_.data(), 1, vector_.size());
    for (std::size_t u = 0; u < padded_.size(); ++u) z[padded_[u]] = vector_[static_cast<Eigen::Index>(u)];
  }
  team.meet();
}

template class FactorPreconditioner<float>;
template class FactorPreconditioner<double>;

}  // namespace palpate::fem
