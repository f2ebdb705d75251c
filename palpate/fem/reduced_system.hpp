// SPDX-License-Identifier: Apache-2.0
// The tangent on the degrees of freedom that may move: clamped nodes are left out, the axes of partly held nodes are
// rotated, rigid motions of a free object are kept out by a border. One symbolic analysis serves every factorisation.
#pragma once

#include <Eigen/SparseCore>
#include <optional>
#include <vector>

#include "palpate/core/math.hpp"
#include "palpate/fem/assembly.hpp"
#include "palpate/fem/linear_solver.hpp"
#include "palpate/fem/sparse_factor.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

class ReducedSystem {
 public:
  /// The pattern may have more block nodes than the mesh (pressures behind the displacements): they are solved for, not
  /// shown.
  /// @param rigid_border  3n x 6 mass-weighted rigid motions of a free object, or 3n x 0
  ReducedSystem(const BlockPattern& pattern, const std::vector<Constraint>& constraints, MatrixX rigid_border,
                const Points& nodes_m, int threads, int loads_expected = 0);

  /// Part of a displacement (3n) along prescribed directions.
  VectorX prescribed_part(const VectorX& u) const;
  /// Removes from a residual (3n) what supports carry: prescribed directions, or rigid-body inertia of a free object.
  VectorX free_part(const VectorX& force) const;

  /// Factorises blocks + shift * diagonal. False when it is not the tangent of a stable body: positive definite, up to
  /// `negative` pivots that belong to pressures.
  bool factorise(const BlockPattern& pattern, const BlockValues& blocks, double shift, int negative);
  /// The same for the tangent of an unstable state (some negative pivots). False when it is singular.
  bool factorise_indefinite(const BlockPattern& pattern, const BlockValues& blocks, double shift = 0);

  /// du (3n x c) with K_ff du_f = rhs_f, du_c = 0 (free object: rigid part of du zero, inertia balances rhs).
  MatrixX solve(const MatrixX& right_hand_sides) const;

  /// True for held bodies without pressures: `set_matrix` and `solve_by_any` then take whatever is cheapest (conjugate
  /// gradients, single or double precision factor; LinearSolver).
  bool takes_any_method() const;
  Index unknowns() const { return static_cast<Index>(lower_.cols()); }
  void set_matrix(const BlockPattern& pattern, const BlockValues& blocks, double shift);
  /// As `solve`, to a relative residual. Not solved: du is not to be used, the outcome says whether the matrix is to blame.
  LinearSolver::Outcome solve_by_any(const MatrixX& right_hand_sides, double tolerance, MatrixX& du);

 private:
  void analyse(const BlockPattern& pattern);
  UnknownPlacement placement() const;
  void fill(const BlockPattern& pattern, const BlockValues& blocks, double shift);
  MatrixX reduce(const MatrixX& full) const;
  MatrixX expand(const MatrixX& reduced) const;
  bool complete_border();
  void solve_reduced(MatrixX& reduced) const;

  Index nodes_ = 0;                // of the mesh
  std::vector<Index> kept_;        // reduced node of a node, or -1
  std::vector<Index> kept_nodes_;  // node of a reduced node
  std::vector<int> special_;       // per node: index into partial_ or -1
  struct Partial {
    Mat3 axes;
    int count;
  };
  std::vector<Partial> partial_;
  std::vector<Constraint> constraints_;
  Eigen::SparseMatrix<double> lower_;
  SparseFactor factor_;
  bool analysed_ = false;            // factor_
  std::optional<LinearSolver> any_;  // made when first needed
  Points nodes_m_;
  std::optional<SparseFactor> indefinite_;  // made when a tangent is first met that is not positive definite
  bool use_indefinite_ = false;
  int threads_ = 1, loads_expected_ = 0;
  // Free object: K = K_s - spring E E' with nine springs at three nodes, and the border B.
  MatrixX border_;
  std::vector<Index> spring_dofs_;
  double spring_ = 0;
  MatrixX border_solution_;                // K_s^-1 [B E]
  Eigen::MatrixXd schur_, schur_inverse_;  // of the border, with the sign turned
};

/// Orthonormal rigid motions about the origin of the nodes' bounding box, 3n x 6: translations along x, y, z, rotations
/// about x, y, z.
MatrixX rigid_motions(const Points& nodes_m);

/// @throws Error that names a rigid motion which the constraints leave free, for every connected part of the mesh.
void check_supported(const TetMesh& mesh, const std::vector<Constraint>& constraints);

}  // namespace palpate::fem
