// SPDX-License-Identifier: Apache-2.0
// What estimation, prediction and planning need of one object, one set of contacts and one material: the watched rows of the
// displacement (surface, tool travel), the reactions of imposed motions and all derivatives, without asking how they were
// had.
//
//   linear material      superposition, a polynomial in nu (LinearResponse); exact in E and in the loads
//   a branch of loads    forces E t a0 with t in (0, t_max]: u / t and du/da on a grid of Chebyshev points in -log(1 - 2 nu)
//                        and t, first order in loads across a0
//   anything else        Newton's method and the implicit function theorem
//
// Energies are proportional to E, so forces enter as F / E alone. t, not its logarithm, is the branch's variable: u is
// analytic in t through rest, so that one polynomial serves from the smallest load on.
#pragma once

#include <memory>

#include "palpate/fem/linear_response.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

/// Where an answer came from.
enum class ResponseSource { superposed, branch, solved };

struct ResponseState {
  bool converged = false;
  std::string reason;
  ResponseSource source = ResponseSource::solved;
  VectorX watched_m;                                 ///< r
  VectorX reaction_n;                                ///< m
  VectorX d_log_young, d_poisson;                    ///< r
  MatrixX d_force, d_motion;                         ///< r x k, r x m
  VectorX reaction_d_log_young, reaction_d_poisson;  ///< m
  MatrixX reaction_d_force, reaction_d_motion;       ///< m x k, m x m
  double error = 0;  ///< of `watched_m`, relative to its largest value: the reduced model's own estimate and the mesh's
  int inverted_elements = 0;  ///< counted where `solved`; a branch has none; superposed: -1, not counted
};

/// Says how far a reduced answer is from a full solve at the same place.
struct Certificate {
  bool converged = false;
  std::string reason;
  double difference = 0;            ///< largest of the watched rows, relative to the largest value
  bool stable = false;              ///< no negative curvature of the energy at the full solution
  bool second_equilibrium = false;  ///< loads stepped up from rest end in another state, or this one is unstable and leads
                                    ///< to another
  int inverted_elements = 0;
};

/// Not thread-safe: shares its solver's scratch memory.
class Response {
 public:
  struct Options {
    StaticsOptions statics;
    double poisson_lower = 0, poisson_upper = 0.49;
    double tolerance = 1e-3;          ///< of the branch, relative (a linear material: see LinearResponse)
    VectorX branch_force_over_young;  ///< k: t = 1 is this load over E, m2 for forces; empty: no branch
    int max_solves = 160;             ///< that the branch may take
    double discretisation_error = 0;  ///< of the mesh, relative; passed on with every answer
  };

  /// @param watched  r x 3n rows wanted of the displacement (boundary.forces' transpose gives the mean motion under loads)
  /// @throws Error where Statics does, and when the branch does not fit the boundary
  Response(const TetMesh& mesh, const std::string& material, Boundary boundary, Eigen::SparseMatrix<double> watched,
           Options options);
  ~Response();
  Response(Response&&) noexcept;
  Response& operator=(Response&&) noexcept;

  /// Surface, reactions and derivatives at E, nu, force and motion coefficients.
  ResponseState at(double young_modulus_pa, double poisson_ratio, const VectorX& force, const VectorX& motion) const;

  /// One full solve at the same place, and one with the loads stepped up from rest.
  Certificate certify(const ResponseState& state, double young_modulus_pa, double poisson_ratio, const VectorX& force,
                      const VectorX& motion) const;

  double branch_end() const;    ///< largest t that the branch reaches (0: there is none; below 1: the material gave way)
  double branch_error() const;  ///< of its last coefficients, relative
  int solves() const;           ///< full solves so far
  const Statics& statics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Six columns of one contact: forces along x, y, z spread over the patch; and, per newton along `direction`, what it means
/// to shift the contact by a metre along two tangents (orthogonal to `direction`) and to widen the patch by log radius. A
/// contact shift s under a force F is then the coefficient F s, a change of radius F dlog r, both to first order. Order: x,
/// y, z, shift along tangent 1, tangent 2, log radius.
struct ContactColumns {
  Eigen::SparseMatrix<double> forces;  ///< 3n x 6
  Vec3 tangent_1, tangent_2;
};
ContactColumns contact_columns(const TetMesh& mesh, const Vec3& centre_m, double radius_m, const Vec3& direction);

}  // namespace palpate::fem
