// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/cholmod_factor.hpp"

#ifdef PALPATE_WITH_CHOLMOD

#include <cholmod.h>

#include <algorithm>
#include <limits>

#include "palpate/core/error.hpp"

namespace palpate::fem {
namespace {

// A view: CHOLMOD reads the matrix where it lies.
cholmod_sparse view_of(const Eigen::SparseMatrix<double>& lower) {
  cholmod_sparse view{};
  view.nrow = static_cast<std::size_t>(lower.rows());
  view.ncol = static_cast<std::size_t>(lower.cols());
  view.nzmax = static_cast<std::size_t>(lower.nonZeros());
  view.p = const_cast<int*>(lower.outerIndexPtr());
  view.i = const_cast<int*>(lower.innerIndexPtr());
  view.x = const_cast<double*>(lower.valuePtr());
  view.stype = -1;  // the lower triangle of a symmetric matrix
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

}  // namespace

struct CholmodFactor::Impl {
  mutable cholmod_common common;
  cholmod_factor* factor = nullptr;

  Impl() {
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.quick_return_if_not_posdef = 1;
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_GIVEN;
  }
  ~Impl() {
    cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }

  // Squares of the diagonal of L against the matrix's own: rounding must not pass for stiffness.
  bool pivots_are_sound(const Eigen::SparseMatrix<double>& lower) const {
    constexpr double digits = 8 * std::numeric_limits<double>::epsilon();
    const auto* super = static_cast<const int*>(factor->super);
    const auto* rows_at = static_cast<const int*>(factor->pi);
    const auto* values_at = static_cast<const int*>(factor->px);
    const auto* order = static_cast<const int*>(factor->Perm);
    const auto* values = static_cast<const double*>(factor->x);
    for (std::size_t s = 0; s < factor->nsuper; ++s) {
      const int height = rows_at[s + 1] - rows_at[s];
      for (int j = super[s]; j < super[s + 1]; ++j) {
        const std::size_t k = static_cast<std::size_t>(j - super[s]);
        const double root = values[static_cast<std::size_t>(values_at[s]) + k * static_cast<std::size_t>(height) + k];
        const double own = lower.valuePtr()[lower.outerIndexPtr()[order[j]]];  // the diagonal comes first
        if (!(root * root > digits * own)) return false;
      }
    }
    return true;
  }
};

CholmodFactor::CholmodFactor(const Eigen::SparseMatrix<double>& lower, const std::vector<Index>& position)
    : impl_(std::make_unique<Impl>()) {
  std::vector<int> order(position.size());
  for (std::size_t i = 0; i < position.size(); ++i) order[static_cast<std::size_t>(position[i])] = static_cast<int>(i);
  cholmod_sparse view = view_of(lower);
  impl_->factor = cholmod_analyze_p(&view, order.data(), nullptr, 0, &impl_->common);
  if (impl_->factor == nullptr) throw Error("CHOLMOD could not analyse the matrix", "SparseFactor::analyse");
}

CholmodFactor::~CholmodFactor() = default;

bool CholmodFactor::factorise(const Eigen::SparseMatrix<double>& lower) {
  cholmod_sparse view = view_of(lower);
  cholmod_factorize(&view, impl_->factor, &impl_->common);
  if (impl_->common.status == CHOLMOD_OUT_OF_MEMORY || impl_->common.status == CHOLMOD_TOO_LARGE)
    throw Error("not enough memory for the factor", "SparseFactor::factorise");
  return impl_->common.status == CHOLMOD_OK && impl_->factor->minor == impl_->factor->n && impl_->pivots_are_sound(lower);
}

void CholmodFactor::solve_in_place(Eigen::Ref<MatrixX> right_hand_sides) const {
  if (right_hand_sides.cols() == 0) return;
  cholmod_dense view{};
  view.nrow = static_cast<std::size_t>(right_hand_sides.rows());
  view.ncol = static_cast<std::size_t>(right_hand_sides.cols());
  view.d = static_cast<std::size_t>(right_hand_sides.outerStride());
  view.nzmax = view.d * view.ncol;
  view.x = right_hand_sides.data();
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* solution = cholmod_solve(CHOLMOD_A, impl_->factor, &view, &impl_->common);
  if (solution == nullptr) throw Error("not enough memory for the solution", "SparseFactor::solve_in_place");
  right_hand_sides =
      Eigen::Map<const MatrixX>(static_cast<const double*>(solution->x), right_hand_sides.rows(), right_hand_sides.cols());
  cholmod_free_dense(&solution, &impl_->common);
}

}  // namespace palpate::fem

#endif
