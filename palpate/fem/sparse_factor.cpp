// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/sparse_factor.hpp"

#include "palpate/core/error.hpp"
#ifdef PALPATE_WITH_CHOLMOD
#include "palpate/fem/linear_solver/cholmod_factor.hpp"
#endif
#include "palpate/fem/linear_solver/front_factor.hpp"

namespace palpate::fem {

struct SparseFactor::Impl {
  Options options;
  std::unique_ptr<FrontFactor<double>> factor;
  bool factorised = false;
#ifdef PALPATE_WITH_CHOLMOD
  std::unique_ptr<CholmodFactor> cholesky;  // of definite matrices; the tree gives its order
#endif
};

SparseFactor::SparseFactor() : SparseFactor(Options{}) {}
SparseFactor::SparseFactor(Options options) : impl_(std::make_unique<Impl>()) { impl_->options = options; }
SparseFactor::~SparseFactor() = default;
SparseFactor::SparseFactor(SparseFactor&&) noexcept = default;
SparseFactor& SparseFactor::operator=(SparseFactor&&) noexcept = default;

void SparseFactor::analyse(const Eigen::SparseMatrix<double>& lower) {
  if (lower.rows() != lower.cols() || !lower.isCompressed()) {
    throw Error("the matrix must be square and compressed", "SparseFactor::analyse");
  }
  impl_->factorised = false;
  auto tree = std::make_shared<const FrontTree>(build_front_tree(lower, impl_->options.block));
#ifdef PALPATE_WITH_CHOLMOD
  if (!impl_->options.indefinite) impl_->cholesky = std::make_unique<CholmodFactor>(lower, tree->position);
#endif
  impl_->factor = std::make_unique<FrontFactor<double>>(std::move(tree), impl_->options.threads);
}

bool SparseFactor::factorise(const Eigen::SparseMatrix<double>& lower) {
  if (impl_->factor == nullptr || lower.cols() != impl_->factor->tree().size ||
      lower.nonZeros() != impl_->factor->tree().entries_of_matrix) {
    throw Error("call analyse() with this matrix's pattern first", "SparseFactor::factorise");
  }
#ifdef PALPATE_WITH_CHOLMOD
  if (impl_->cholesky != nullptr) return impl_->factorised = impl_->cholesky->factorise(lower);
#endif
  impl_->factorised = impl_->factor->factorise(lower.valuePtr(), !impl_->options.indefinite);
  return impl_->factorised;
}

void SparseFactor::solve_in_place(Eigen::Ref<MatrixX> right_hand_sides) const {
  if (!impl_->factorised) throw Error("no factorisation to solve with", "SparseFactor::solve_in_place");
  const Index size = impl_->factor->tree().size;
  if (right_hand_sides.rows() != size) {
    throw Error(
        "right-hand sides have " + std::to_string(right_hand_sides.rows()) + " rows, the matrix has " + std::to_string(size),
        "SparseFactor::solve_in_place");
  }
#ifdef PALPATE_WITH_CHOLMOD
  if (impl_->cholesky != nullptr) return impl_->cholesky->solve_in_place(right_hand_sides);
#endif
  impl_->factor->solve(right_hand_sides.data(), right_hand_sides.cols(), right_hand_sides.outerStride());
}

int SparseFactor::negative_pivots() const {
  return impl_->factorised && impl_->options.indefinite ? impl_->factor->negative_pivots() : 0;
}

}  // namespace palpate::fem
