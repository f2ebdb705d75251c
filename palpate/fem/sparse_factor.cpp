// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/sparse_factor.hpp"

#include <Eigen/SparseCholesky>

#include "palpate/core/error.hpp"
#include "palpate/fem/linear_solver/elimination_order.hpp"

namespace palpate::fem {
namespace {
// Below this number of nodes minimum degree gives less fill than nested dissection on volume meshes.
constexpr Index kNestedDissectionFrom = 1200;
}  // namespace

struct SparseFactor::Impl {
  Options options;
  bool analysed = false, factorised = false;
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, Index> to_factor;
  Eigen::SparseMatrix<double> permuted;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<Index>> kernel;
  int negative = 0;
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
  const QuotientGraph graph = quotient_graph(lower, impl_->options.block);
  const std::vector<Index> order =
      graph.group_count() < kNestedDissectionFrom ? minimum_degree_order(graph) : nested_dissection_order(graph);
  impl_->to_factor.resize(lower.rows());
  Index position = 0;
  for (const Index group : order) {
    for (Index unknown = graph.first_unknown[static_cast<std::size_t>(group)];
         unknown < graph.first_unknown[static_cast<std::size_t>(group) + 1]; ++unknown) {
      impl_->to_factor.indices()[unknown] = position++;
    }
  }
  impl_->permuted.resize(lower.rows(), lower.cols());
  impl_->permuted.selfadjointView<Eigen::Lower>() = lower.selfadjointView<Eigen::Lower>().twistedBy(impl_->to_factor);
  impl_->kernel.analyzePattern(impl_->permuted);
  impl_->analysed = true;
  impl_->factorised = false;
}

bool SparseFactor::factorise(const Eigen::SparseMatrix<double>& lower) {
  if (!impl_->analysed || lower.rows() != impl_->permuted.rows()) {
    throw Error("call analyse() with this matrix's pattern first", "SparseFactor::factorise");
  }
  impl_->permuted.selfadjointView<Eigen::Lower>() = lower.selfadjointView<Eigen::Lower>().twistedBy(impl_->to_factor);
  impl_->kernel.factorize(impl_->permuted);
  impl_->factorised = false;
  if (impl_->kernel.info() != Eigen::Success || !impl_->kernel.vectorD().allFinite()) return false;
  impl_->negative = static_cast<int>((impl_->kernel.vectorD().array() < 0).count());
  if (!impl_->options.indefinite && !(impl_->kernel.vectorD().array() > 0).all()) return false;
  impl_->factorised = true;
  return true;
}

void SparseFactor::solve_in_place(Eigen::Ref<MatrixX> right_hand_sides) const {
  if (!impl_->factorised) throw Error("no factorisation to solve with", "SparseFactor::solve_in_place");
  if (right_hand_sides.rows() != impl_->permuted.rows()) {
    throw Error("right-hand sides have " + std::to_string(right_hand_sides.rows()) + " rows, the matrix has " +
                    std::to_string(impl_->permuted.rows()),
                "SparseFactor::solve_in_place");
  }
  const MatrixX permuted = impl_->to_factor * right_hand_sides;
  right_hand_sides = impl_->to_factor.inverse() * impl_->kernel.solve(permuted);
}

int SparseFactor::negative_pivots() const { return impl_->negative; }

}  // namespace palpate::fem
