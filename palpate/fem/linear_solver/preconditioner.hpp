// SPDX-License-Identifier: Apache-2.0
// Approximate inverses for conjugate gradients on a BlockMatrix whose rows lie aggregate after aggregate.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "palpate/fem/linear_solver/aggregates.hpp"
#include "palpate/fem/linear_solver/block_matrix.hpp"
#include "palpate/fem/linear_solver/front_factor.hpp"
#include "palpate/fem/linear_solver/thread_team.hpp"

namespace palpate::fem {

/// Aggregates [first, last) of a member of a team.
struct Share {
  Index first, last;
};
inline Share share_of(const ThreadTeam& team, Index aggregates) {
  return {static_cast<Index>(static_cast<std::int64_t>(aggregates) * team.id / team.count),
          static_cast<Index>(static_cast<std::int64_t>(aggregates) * (team.id + 1) / team.count)};
}

class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  /// z = M^-1 r, both padded. Called by every member of a team; on return a member's own share of z is complete.
  virtual void apply(const double* r, double* z, const ThreadTeam& team) = 0;
};

/// Inverses of the diagonal blocks, plus an exact solve on the rigid motions of every aggregate (two-level additive Schwarz
/// with a coarse space of rigid motions): the number of steps no longer grows with refinement.
class RigidMotionPreconditioner final : public Preconditioner {
 public:
  /// @param placement  empty: diagonal blocks alone
  RigidMotionPreconditioner(const BlockMatrix& matrix, const Aggregates& aggregates, const UnknownPlacement& placement);

  /// Takes the matrix's present values. False: a diagonal block or the coarse matrix is not positive definite.
  bool update();
  void apply(const double* r, double* z, const ThreadTeam& team) override;
  Eigen::Index coarse_size() const { return coarse_.cols(); }

 private:
  using Modes = Eigen::Matrix<float, 3, 6>;

  const BlockMatrix& matrix_;
  const Aggregates& aggregates_;
  std::vector<Index> aggregate_of_;           // a block row
  std::vector<Mat3> inverse_diagonal_;        // of block rows
  std::vector<Modes> modes_;                  // of block rows: displacement by the six motions of its aggregate
  std::vector<Index> pair_begin_, pair_row_;  // aggregates a >= b that touch, by column b
  Eigen::SparseMatrix<double> coarse_;        // lower triangle
  std::unique_ptr<FrontFactor<float>> coarse_factor_;
  VectorX coarse_vector_;
};

/// A factor in single precision: three or four steps to full accuracy, whatever the Poisson ratio. Or one of a matrix nearby.
template <class Scalar>
class FactorPreconditioner final : public Preconditioner {
 public:
  FactorPreconditioner(const FrontFactor<Scalar>& factor, const std::vector<Index>& padded);
  void apply(const double* r, double* z, const ThreadTeam& team) override;

 private:
  const FrontFactor<Scalar>& factor_;
  const std::vector<Index>& padded_;
  VectorX vector_;
};

}  // namespace palpate::fem
