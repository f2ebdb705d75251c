// SPDX-License-Identifier: Apache-2.0
// A linear material: one factor a Poisson ratio, at E = 1, serves every load.
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/statics/static_system.hpp"

namespace palpate::fem {

void StaticSystem::factorise_linear(double poisson, int* factorisations) {
  if (linear_poisson == poisson) return;
  const Moduli unit = moduli(1.0, poisson);
  if (assembly.is_mixed() || assembly.has_own_poisson()) {
    assembly.tangent(law, unit, VectorX::Zero(3 * assembly.node_count()), blocks);
  } else {
    blocks.resize(blocks_mu.size());
    for (std::size_t i = 0; i < blocks.size(); ++i) blocks[i] = unit.lambda * blocks_lambda[i] + unit.mu * blocks_mu[i];
  }
  linear_poisson = std::numeric_limits<double>::quiet_NaN();
  if (is_large())
    system.set_matrix(assembly.pattern(), blocks, 0);
  else if (!system.factorise(assembly.pattern(), blocks, 0, assembly.expected_negative_pivots()))
    throw Error("the stiffness matrix is not positive definite: is the mesh degenerate?", "mesh");
  if (factorisations) ++*factorisations;
  linear_poisson = poisson;
}

MatrixX StaticSystem::solve_linear_system(const MatrixX& right_hand_sides) {
  if (!is_large()) return system.solve(right_hand_sides);
  MatrixX du;
  const LinearSolver::Outcome outcome = system.solve_by_any(right_hand_sides, kLargeTolerance, du);
  if (outcome.solved) return du;
  linear_poisson = std::numeric_limits<double>::quiet_NaN();
  throw Error("the stiffness matrix could not be solved with (" + outcome.reason + "): is the mesh degenerate?", "mesh");
}

std::vector<Equilibrium> StaticSystem::solve_linear(double young, double poisson, const MatrixX& a, const MatrixX& b) {
  std::vector<Equilibrium> all;
  std::vector<StaticProblem> problems;
  int factorisations = 0;
  for (Index c = 0; c < a.cols(); ++c) {
    problems.push_back(problem(young, poisson, a.col(c), b.col(c), {}));
    all.push_back(blank(young, poisson, a.col(c), b.col(c), {}));
  }
  if (all.empty()) return all;
  factorise_linear(poisson, &factorisations);
  MatrixX rhs(3 * assembly.node_count(), a.cols());
  for (Index c = 0; c < a.cols(); ++c) {
    rhs.col(c) = problems[c].external / young;
    if (motions.cols() > 0) rhs.col(c) -= assembly.multiply(blocks, problems[c].prescribed);
  }
  const MatrixX u = solve_linear_system(rhs);
  for (Index c = 0; c < a.cols(); ++c) {
    StaticState s;
    s.u = u.col(c) + problems[c].prescribed;
    evaluate(problems[c], s);
    all[c].converged = true;
    all[c].newton_steps = 1;
    all[c].factorisations = c == 0 ? factorisations : 0;
    finish(problems[c], s, all[c]);
  }
  return all;
}

UnitResponses StaticSystem::unit_responses(double poisson, const Eigen::SparseMatrix<double>& watched) {
  const Index n = 3 * assembly.node_count();
  if (watched.cols() != n) throw Error("needs " + std::to_string(n) + " columns", "watched");
  const Index k = static_cast<Index>(boundary.forces.cols()), m = static_cast<Index>(motions.cols());
  const Moduli unit = moduli(1.0, poisson);
  factorise_linear(poisson, nullptr);
  MatrixX values(watched.rows(), k + m), slopes(watched.rows(), k + m), reactions(m, k + m), reaction_slopes(m, k + m);
  VectorX gradients(k + m);
  UnitResponses out;
  out.poisson_ratio = poisson;
  constexpr Index bundle = 32;  // fills the factor's bundles; more would only take memory
  for (Index first = 0; first < k + m; first += bundle) {
    const Index count = std::min(bundle, k + m - first);
    MatrixX rhs(n, count), imposed = MatrixX::Zero(n, count), external = MatrixX::Zero(n, count);
    for (Index c = 0; c < count; ++c) {
      const Index column = first + c;
      if (column < k) {
        external.col(c) = boundary.forces.col(column);
        rhs.col(c) = external.col(c);
      } else {
        imposed.col(c) = motions.col(column - k);
        rhs.col(c) = -assembly.multiply(blocks, imposed.col(c));
      }
    }
    const MatrixX u = solve_linear_system(rhs) + imposed;
    values.middleCols(first, count) = watched * u;
    for (Index c = 0; c < count; ++c) {
      // K' u at E = 1; K u - F a is what supports carry, the rest of it what the solve left over.
      const VectorX internal = assembly.multiply(blocks, u.col(c));
      const VectorX left_over = system.free_part(internal - external.col(c));
      const double scale = std::max(internal.norm(), external.col(c).norm());
      if (scale > 0) out.residual = std::max(out.residual, left_over.norm() / scale);
      gradients(first + c) = assembly.largest_gradient(u.col(c));
      rhs.col(c) = -assembly.forces_d_poisson(law, unit, u.col(c));
      reactions.col(first + c) = motions.transpose() * (internal - external.col(c));
    }
    const MatrixX du = solve_linear_system(rhs);
    slopes.middleCols(first, count) = watched * du;
    for (Index c = 0; m > 0 && c < count; ++c)
      reaction_slopes.col(first + c) = motions.transpose() * (assembly.multiply(blocks, du.col(c)) - rhs.col(c));
  }
  out.force = values.leftCols(k);
  out.motion = values.rightCols(m);
  out.force_d_poisson = slopes.leftCols(k);
  out.motion_d_poisson = slopes.rightCols(m);
  out.reaction_force = reactions.leftCols(k);
  out.reaction_motion = reactions.rightCols(m);
  out.reaction_force_d_poisson = reaction_slopes.leftCols(k);
  out.reaction_motion_d_poisson = reaction_slopes.rightCols(m);
  out.largest_gradient_force = gradients.head(k);
  out.largest_gradient_motion = gradients.tail(m);
  return out;
}

}  // namespace palpate::fem
