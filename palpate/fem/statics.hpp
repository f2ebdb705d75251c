// SPDX-License-Identifier: Apache-2.0
// Static equilibrium of one body under loads and motions that are linear in a few coefficients:
//
//   f_int(u; E, nu) = F a          on free degrees of freedom
//   u               = M b          on prescribed ones
//
// F holds nodal forces per unit coefficient (one column: unit force along x on a patch, unit density times gravity, ...), M
// nodal displacements per unit coefficient (platen travel). Everything that an estimator wants to know about forces
// (scale, tare, direction, density, tilt of gravity) is then a coefficient, and its sensitivity one more back-substitution.
#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <string>
#include <vector>

#include "palpate/core/math.hpp"
#include "palpate/core/mesh.hpp"

namespace palpate::fem {

/// Prescribed directions of one node: `axes` columns 0..count-1 are orthonormal directions whose displacement is prescribed
/// (count 3: clamped; 1: sliding on a plane with that normal).
struct Constraint {
  Index node = 0;
  Mat3 axes = Mat3::Identity();
  int count = 3;
};

struct Boundary {
  std::vector<Constraint> constraints;  ///< at most one a node
  Eigen::SparseMatrix<double> forces;   ///< 3n x k, newton per unit coefficient
  Eigen::SparseMatrix<double> motions;  ///< 3n x m, metres per unit coefficient, non-zero on constrained nodes only
  bool inertia_relief = false;          ///< free object: rigid motions projected out, no constraints
};

/// Completes the constraints' axes to orthonormal bases, holds nodes that no element uses, gives empty columns their size.
/// @throws Error on indices, axes or motions that do not fit the mesh
Boundary checked(const TetMesh& mesh, Boundary boundary);

/// How the part of an energy that locks near nu = 0.5 is integrated.
enum class Dilatation {
  pointwise,  ///< as the law says: plain linear or quadratic tetrahedra
  averaged,   ///< the volume change is projected on continuous linear functions (quadratic tetrahedra: Taylor-Hood, right up
              ///< to nu = 0.4999) or averaged over patches around nodes (linear ones)
};

struct StaticsOptions {
  Dilatation dilatation = Dilatation::pointwise;
  double residual_tolerance = 1e-9;  ///< on free dofs, relative to the largest of external and internal force norms
  int max_newton_steps = 60;
  int max_load_steps = 400;  ///< in the continuation that is started when plain Newton fails
  int threads = 1;
  int loads_expected = 0;  ///< of a linear material: about how many one matrix will be solved for, one after the other
  std::vector<int> region;   ///< an element: its region, 0 and up; empty: one region
  VectorX region_stiffness;  ///< a region: its E over the one asked for; empty: 1
  VectorX region_poisson;    ///< a region: its own nu (NaN: the one asked for); empty: all share the one asked for
};

/// A state of the body. `converged` false is a result, not an exception; `reason` says why in plain words.
struct Equilibrium {
  VectorX displacement_m;  ///< 3n, node-major (x0 y0 z0 x1 ...)
  double young_modulus_pa = 0, poisson_ratio = 0;
  VectorX extra;  ///< the material's further parameters
  VectorX force_coefficients, motion_coefficients;
  VectorX motion_reaction;  ///< m: work-conjugate to the motion coefficients, M' (f_int - F a), newton
  bool converged = false;
  std::string reason;  ///< why it did not converge, or what is odd about the state (inverted elements)
  int newton_steps = 0;
  int factorisations = 0;
  int inverted_elements = 0;
  /// Noticed on the way: the energy has a direction of negative curvature at this state, so that another state of less
  /// energy exists (Statics::other_equilibria finds it). Also said in `reason`. Not looked for where Newton's method met no
  /// sign of it.
  bool unstable = false;
  double residual = 0;  ///< relative, as in StaticsOptions
  /// Mean pressure under the loads over E, weighted with force. Above about 0.3 co-rotational and St. Venant-Kirchhoff
  /// bodies lose stability under the tool, and every other law is far beyond small strain.
  double pressure_over_young = 0;
};

/// Exact derivatives from the tangent's factor at the equilibrium (implicit function theorem).
struct Sensitivity {
  VectorX d_log_young;           ///< 3n: du / d log E
  VectorX d_poisson;             ///< 3n: du / d nu
  MatrixX d_extra;               ///< 3n x e: du / d extra
  MatrixX d_log_stiffness;       ///< 3n x r: du / d log of a region's stiffness (no columns where there is one region)
  MatrixX d_region_poisson;      ///< 3n x r: du / d own nu of a region (no columns where none has its own)
  MatrixX d_force;               ///< 3n x k: du / d a
  MatrixX d_motion;              ///< 3n x m: du / d b
  VectorX reaction_d_log_young;  ///< m
  VectorX reaction_d_poisson;    ///< m
  MatrixX reaction_d_extra;      ///< m x e
  MatrixX reaction_d_log_stiffness;  ///< m x r
  MatrixX reaction_d_region_poisson;  ///< m x r
  MatrixX reaction_d_force;      ///< m x k
  MatrixX reaction_d_motion;     ///< m x m
};

/// The same along a few directions of the coefficients: (a, b) moves by column c of (force_directions, motion_directions).
struct SensitivityAlong {
  VectorX d_log_young, d_poisson;                    ///< 3n
  MatrixX d_extra, d_log_stiffness, d_region_poisson, d_along;  ///< 3n x e, 3n x r, 3n x r (or none), 3n x c
  VectorX reaction_d_log_young, reaction_d_poisson;  ///< m
  MatrixX reaction_d_extra, reaction_d_log_stiffness, reaction_d_region_poisson, reaction_d_along;  ///< m x the same
};

/// What watched rows W u and the motions' reactions of a linear material are for unit coefficients, at E = 1 Pa:
///   W u = (force a) / E + motion b,   reaction = (reaction_force a) + E (reaction_motion b).
struct UnitResponses {
  double poisson_ratio = 0;
  MatrixX force, force_d_poisson;                      ///< r x k: per newton (or what a means), at E = 1
  MatrixX motion, motion_d_poisson;                    ///< r x m
  MatrixX reaction_force, reaction_force_d_poisson;    ///< m x k
  MatrixX reaction_motion, reaction_motion_d_poisson;  ///< m x m
  VectorX largest_gradient_force;   ///< k: largest Frobenius norm of the displacement gradient in any quadrature point
  VectorX largest_gradient_motion;  ///< m
  double residual = 0;              ///< largest of any column, relative
};

/// Description (mesh, element, material, boundary), immutable but for the regions' moduli, plus the symbolic analysis that
/// all solves share. Calls are const but share scratch memory and the last factor: use one Statics a thread.
class Statics {
 public:
  /// @param mesh   linear (4 columns) or quadratic (10 columns) tetrahedra; the columns choose the element
  /// @param material  a name in the table of materials.hpp
  /// @throws Error on an inside-out or degenerate element, an unknown material, a node index out of range, regions that do
  ///         not fit the mesh, or supports that leave a rigid motion free (names which one) unless inertia_relief is set.
  Statics(const TetMesh& mesh, const std::string& material, Boundary boundary, StaticsOptions options = {});
  ~Statics();
  Statics(Statics&&) noexcept;
  Statics& operator=(Statics&&) noexcept;

  /// Solves from here on are with these. @throws Error unless there is one positive number a region
  void set_region_stiffness(const VectorX& stiffness);
  /// The same of StaticsOptions::region_poisson. @throws Error unless there is one in (-1, 0.5), or NaN, a region
  void set_region_poisson(const VectorX& poisson);

  /// @param extra  values of the material's further parameters (e.g. alpha of the foam law), in its table's order
  /// Newton's method with a line search on the potential energy; when it fails from `start`, the loads are stepped from
  /// rest.
  /// @param start  displacement to start Newton from (nullptr: zero)
  Equilibrium solve(double young_modulus_pa, double poisson_ratio, const VectorX& force_coefficients,
                    const VectorX& motion_coefficients, const VectorX* start = nullptr, const VectorX& extra = {}) const;

  /// The same with the loads stepped up from rest, never at once: where several equilibria exist, the one on the branch that
  /// starts at rest.
  Equilibrium solve_stepwise(double young_modulus_pa, double poisson_ratio, const VectorX& force_coefficients,
                             const VectorX& motion_coefficients, const VectorX& extra = {}) const;

  /// True where the energy has no direction of negative curvature at `at` (its tangent is positive definite).
  bool is_stable(const Equilibrium& at) const;

  /// Further equilibria that are reached from an unstable one along its direction of least curvature, to both sides; none
  /// where `at` is stable, or where both sides lead to no other state.
  std::vector<Equilibrium> other_equilibria(const Equilibrium& at) const;

  /// Re-factorises the tangent at `at` only if it is not the last one solved (linear material: once per nu).
  Sensitivity sensitivity(const Equilibrium& at) const;

  /// One back-substitution a direction instead of one a coefficient. @param force_directions k x c  @param motion_directions
  /// m x c
  SensitivityAlong sensitivity_along(const Equilibrium& at, const MatrixX& force_directions,
                                     const MatrixX& motion_directions) const;

  /// Many load cases of a linear material with one factor: columns of `force_coefficients` (k x cases).
  std::vector<Equilibrium> solve_many(double young_modulus_pa, double poisson_ratio, const MatrixX& force_coefficients,
                                      const MatrixX& motion_coefficients) const;

  /// A linear material's answers to every unit coefficient at one nu, with their derivatives to nu: one factorisation and
  /// 2 (k + m) back-substitutions in bundles. Every load case, E and derivative is then a sum of a few columns.
  /// @param watched  r x 3n
  UnitResponses unit_responses(double poisson_ratio, const Eigen::SparseMatrix<double>& watched) const;

  /// Elements with J <= 0 at a quadrature point of this displacement (3n) of a linear material, whether or not it is in equilibrium.
  int inverted_elements(const VectorX& displacement_m) const;

  bool is_linear() const;
  const TetMesh& mesh() const;
  const Boundary& boundary() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::fem
