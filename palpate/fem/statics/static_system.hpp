// SPDX-License-Identifier: Apache-2.0
// What Statics is made of: one state of the body, its residual and tangent, Newton's method, continuation, superposition of
// a linear material, sensitivities. Each has its own file.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "palpate/fem/assembly.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/reduced_system.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

constexpr double kLargeTolerance = 1e-11;  ///< relative residual of linear solves of large bodies

/// Of one set of parameters and coefficients.
struct StaticProblem {
  Moduli m;
  VectorX external;    // F a
  VectorX prescribed;  // P_c M b
};

struct StaticState {
  VectorX u, internal;
  double energy = 0;    // strain energy minus work of the dead loads
  double residual = 0;  // relative
  VectorX unbalanced;   // free part of f_int - F a
  int inverted = 0;
};

class StaticSystem {
 public:
  StaticSystem(const TetMesh& mesh, const std::string& material, Boundary boundary, StaticsOptions options);

  void set_region_stiffness(const VectorX& stiffness);
  void set_region_poisson(const VectorX& poisson);
  Equilibrium solve(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX* start,
                    const VectorX& extra);
  Equilibrium solve_stepwise(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX& extra);
  bool is_stable(const Equilibrium& at);
  std::vector<Equilibrium> other_equilibria(const Equilibrium& at);
  SensitivityAlong sensitivity(const Equilibrium& at, const MatrixX& along_force, const MatrixX& along_motion);
  std::vector<Equilibrium> solve_linear(double young, double poisson, const MatrixX& a, const MatrixX& b);
  int inverted_elements(const VectorX& displacement_m) const;  ///< of a linear material
  UnitResponses unit_responses(double poisson, const Eigen::SparseMatrix<double>& watched);

  TetMesh mesh;
  const MaterialLaw& law;
  StaticsOptions options;
  Assembly assembly;
  Boundary boundary;
  bool free;
  ReducedSystem system;
  MatrixX motions;  // along prescribed directions only
  double diameter_m = 0;
  VectorX node_area_m2;  // of the boundary, 0 inside
  // Scratch that const calls share (a Statics is not thread-safe).
  BlockValues blocks, blocks_lambda, blocks_mu;
  VectorX factored_u;  // where the factor is the exact tangent; empty: nowhere
  Moduli factored_moduli;
  bool last_step_shifted = false;  // of Newton's method
  double first_shift = 1e-3;       // to try where the tangent is not positive definite
  double linear_poisson = std::numeric_limits<double>::quiet_NaN();

 private:
  /// Unknowns above which one factor for all loads and derivatives no longer pays before any other method.
  bool is_large() const { return system.takes_any_method() && system.unknowns() > 20000; }
  /// The same for a single step of Newton's method.
  bool steps_by_any() const { return system.takes_any_method() && system.unknowns() > 5000; }
  /// False where the law does not exist.
  bool evaluate(const StaticProblem& p, StaticState& s) const;
  bool factorise_tangent(const StaticProblem& p, const VectorX& u, int& factorisations, bool* shifted = nullptr);
  /// d = K^-1 (unbalanced forces and imposed jump), K the tangent at s or, where it is not positive definite, a shifted one;
  /// the reason why there is none, or nothing. @param forcing  relative residual that is good enough for large bodies
  std::string newton_step(const StaticProblem& p, const StaticState& s, const VectorX& jump, bool at_target, double forcing,
                          VectorX& d, bool& shifted, Equilibrium& out);
  /// A step with the last factor; false: it does not bring the residual down enough, and s is as it was.
  bool stale_step(const StaticProblem& p, const VectorX& jump, bool at_target, StaticState& s, StaticState& trial) const;
  /// From s (evaluated) towards p; the reason why it did not converge, or nothing. @param near  s is close to a state that
  /// the last factor belongs to
  std::string newton(const StaticProblem& p, StaticState& s, Equilibrium& out, int max_steps, bool near);
  /// Says of a converged state what is odd about it: inverted elements, negative curvature.
  void say_what_is_odd(const StaticProblem& p, const StaticState& s, Equilibrium& out);
  /// Steps the loads from rest to p, shrinking the step when Newton fails.
  std::string continuation(const StaticProblem& p, StaticState& s, Equilibrium& out);
  /// Finds the shape where volume is cheap, and corrects it.
  std::string by_way_of_compressible(const StaticProblem& p, const VectorX* start, StaticState& s, Equilibrium& out);
  StaticProblem problem(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX& extra) const;
  Equilibrium blank(double young, double poisson, const VectorX& a, const VectorX& b, const VectorX& extra) const;
  void finish(const StaticProblem& p, StaticState& s, Equilibrium& out) const;
  /// The tangent at a state in `blocks`, ready to be solved with. @returns what it is to be multiplied with: a linear material's is
  /// at E = 1. @throws Error where it is singular
  double prepare_tangent(const StaticProblem& p, const VectorX& u);
  /// What was factorised is of other regions' moduli.
  void forget_factors();
  /// The two parts of a linear material's stiffness, which do not depend on nu (where regions share it).
  void assemble_linear();
  void factorise_linear(double poisson, int* factorisations);
  /// With the matrix of `factorise_linear`. @throws Error when it is not positive definite
  MatrixX solve_linear_system(const MatrixX& right_hand_sides);
  /// With the tangent in `blocks`, which may have negative pivots. @throws Error when it is singular
  MatrixX solve_tangent_system(const MatrixX& right_hand_sides);
};

}  // namespace palpate::fem
