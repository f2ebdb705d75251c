// SPDX-License-Identifier: Apache-2.0
// Implicit function theorem with the tangent's factor at an equilibrium.
#include "palpate/core/error.hpp"
#include "palpate/fem/statics/static_system.hpp"

namespace palpate::fem {

MatrixX StaticSystem::solve_tangent_system(const MatrixX& right_hand_sides) {
  if (!is_large()) return system.solve(right_hand_sides);
  MatrixX du;
  if (system.solve_by_any(right_hand_sides, kLargeTolerance, du).solved) return du;
  if (!system.factorise_indefinite(assembly.pattern(), blocks))
    throw Error("the tangent is singular at this state: it has no derivatives", "sensitivity.at");
  return system.solve(right_hand_sides);
}

double StaticSystem::prepare_tangent(const StaticProblem& p, const VectorX& u) {
  if (law.is_linear()) {
    factorise_linear(p.m.poisson, nullptr);
    return p.m.young_pa;
  }
  if (is_large()) {
    assembly.tangent(law, p.m, u, blocks);
    system.set_matrix(assembly.pattern(), blocks, 0);
    return 1;
  }
  const bool same = factored_u.size() == u.size() && factored_u == u && factored_moduli.young_pa == p.m.young_pa &&
                    factored_moduli.poisson == p.m.poisson && factored_moduli.extra == p.m.extra;
  if (same) return 1;
  factored_u.resize(0);
  assembly.tangent(law, p.m, u, blocks);
  if (system.factorise(assembly.pattern(), blocks, 0, assembly.expected_negative_pivots())) {
    factored_u = u;
    factored_moduli = p.m;
  } else if (!system.factorise_indefinite(assembly.pattern(), blocks)) {
    throw Error("the tangent is singular at this state: it has no derivatives", "sensitivity.at");
  }
  return 1;
}

SensitivityAlong StaticSystem::sensitivity(const Equilibrium& at, const MatrixX& along_force, const MatrixX& along_motion) {
  const StaticProblem p =
      problem(at.young_modulus_pa, at.poisson_ratio, at.force_coefficients, at.motion_coefficients, at.extra);
  const VectorX& u = at.displacement_m;
  if (u.size() != 3 * assembly.node_count()) throw Error("is not a state of this mesh", "sensitivity.at");
  const Index m = static_cast<Index>(motions.cols()), x = static_cast<Index>(p.m.extra.size());
  const Index along = static_cast<Index>(along_force.cols()), regions = assembly.region_count();
  const Index own = assembly.has_own_poisson() ? regions : 0, first_own = 2 + x + regions, first_along = first_own + own;
  if (along_force.rows() != boundary.forces.cols() || along_motion.rows() != m || along_motion.cols() != along)
    throw Error("needs one row a coefficient, and as many columns for forces as for motions", "sensitivity_along");
  // K du = -df/dtheta (material), F a' - K M b' (a direction a', b')
  MatrixX rhs(3 * assembly.node_count(), first_along + along);
  VectorX internal;
  assembly.energy_and_forces(law, p.m, u, internal);
  rhs.col(0) = -internal;
  rhs.col(1) = -assembly.forces_d_poisson(law, p.m, u);
  for (Index i = 0; i < x; ++i) rhs.col(2 + i) = -assembly.forces_d_extra(law, p.m, u, static_cast<int>(i));
  for (int r = 0; r < regions; ++r) rhs.col(2 + x + r) = -assembly.forces_d_log_stiffness(law, p.m, u, r);
  for (int r = 0; r < own; ++r) rhs.col(first_own + r) = -assembly.forces_d_region_poisson(law, p.m, u, r);
  rhs.rightCols(along) = boundary.forces * along_force;
  const MatrixX imposed = motions * along_motion;
  MatrixX du = MatrixX::Zero(rhs.rows(), rhs.cols()), reaction = MatrixX::Zero(m, rhs.cols());
  if (!rhs.isZero(0) || !imposed.isZero(0)) {  // nothing depends on anything at rest, and no factor is needed to know that
    const double scale = prepare_tangent(p, u);
    for (Index j = 0; j < along; ++j)
      if (!imposed.col(j).isZero(0)) rhs.col(first_along + j) -= scale * assembly.multiply(blocks, imposed.col(j));
    du = law.is_linear() ? solve_linear_system(rhs) : solve_tangent_system(rhs);
    du /= scale;
    // Reactions: M' (K du - rhs), with K du of the whole displacement.
    for (Index j = 0; m > 0 && j < du.cols(); ++j)
      reaction.col(j) = motions.transpose() * (scale * assembly.multiply(blocks, du.col(j)) - rhs.col(j));
    du.rightCols(along) += imposed;
  }
  SensitivityAlong out;
  out.d_log_young = du.col(0);
  out.d_poisson = du.col(1);
  out.d_extra = du.middleCols(2, x);
  out.d_log_stiffness = du.middleCols(2 + x, regions);
  out.d_region_poisson = du.middleCols(first_own, own);
  out.d_along = du.rightCols(along);
  out.reaction_d_log_young = reaction.col(0);
  out.reaction_d_poisson = reaction.col(1);
  out.reaction_d_extra = reaction.middleCols(2, x);
  out.reaction_d_log_stiffness = reaction.middleCols(2 + x, regions);
  out.reaction_d_region_poisson = reaction.middleCols(first_own, own);
  out.reaction_d_along = reaction.rightCols(along);
  return out;
}

}  // namespace palpate::fem
