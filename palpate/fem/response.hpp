// SPDX-License-Identifier: Apache-2.0
// All that estimation, prediction and planning see of a body: one object, the contacts and supports that act on it, one material.
// It answers what is watched of the displacement (a surface), the mean motion under the loads (tip travel), the reactions of
// imposed motions (wrench) and all derivatives, without asking how they were had.
//
//   linear material      superposition, a polynomial in nu (LinearResponse); exact in E and in the loads
//   a branch of loads    forces E t a0 with t in (0, t_max]: u / t and du/da on a grid of Chebyshev points in -log(1 - 2 nu)
//                        and t, first order in loads across a0
//   rigid contacts       Newton's method on body and contacts together; with friction steps in sequence (ContactStatics)
//   anything else        Newton's method and the implicit function theorem (Statics)
//
// Energies are proportional to E, so forces enter as F / E alone. t, not its logarithm, is the branch's variable: u is
// analytic in t through rest, so that one polynomial serves from the smallest load on.
#pragma once

#include <memory>
#include <optional>

#include "palpate/fem/contact_statics.hpp"
#include "palpate/fem/linear_response.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

/// Where an answer came from.
enum class ResponseSource { superposed, branch, solved };

/// A rigid contact whose tip a motion coefficient moves: metres along `direction`. Further ones of a contact: where it stands before it moves.
struct DrivenContact {
  std::size_t contact = 0;
  Vec3 direction = Vec3::Zero();
};

/// Directions of the loads that derivatives are wanted along, one a column.
struct LoadDirections {
  MatrixX force, motion;  ///< k x c, m x c
};

/// Where a response is asked.
struct ResponseQuery {
  double young_modulus_pa = 0, poisson_ratio = 0;
  VectorX force;                               ///< k: coefficients of Boundary::forces
  VectorX motion;                              ///< m: of Boundary::motions, then of every driven contact
  bool derivatives = true;                     ///< false: without any, at a part of the time
  std::optional<LoadDirections> along = {};    ///< nothing: every coefficient by itself, forces first
  VectorX stiffness = {};                      ///< a region: its E over the one asked for; empty: as they were last
  VectorX region_poisson = {};                 ///< the same of StaticsOptions::region_poisson
  VectorX extra = {};                          ///< the material's further parameters, in its table's order
};

/// A solved state in full: what another solve may start from.
struct ResponseSolution {
  VectorX displacement_m;  ///< 3n
  MatrixX derivative;      ///< 3n x columns, as ResponseState's; no columns: not asked for
  std::shared_ptr<const ContactEquilibrium> touching;           ///< of a body with contacts
  std::shared_ptr<const ContactPathSensitivity> touching_along;  ///< the same, differentiated
};
using ResponseSolutionPtr = std::shared_ptr<const ResponseSolution>;

/// What a solve may start from. On a path, `from` is part of the question; else all of it saves work and changes no answer.
struct ResponseStart {
  const VectorX* displacement_m = nullptr;  ///< 3n: first guess of Newton's method; with `nearby`: that one's, moved to here
  ResponseSolutionPtr from;                 ///< where this load step begins; without contacts a first guess
  bool on_path = false;        ///< what touches remembers: `from` is the step before, and its derivatives carry on
  ResponseSolutionPtr nearby;  ///< on a path: end of this same load step at parameters nearby
};

/// Columns of every derivative: log E, nu, log of the stiffness of every further region (the first one's is E), nu of every further
/// region where they have their own (Options::statics.region_poisson), then the directions that were asked for.
struct ResponseState {
  bool converged = false;
  std::string reason;
  ResponseSource source = ResponseSource::solved;
  VectorX watched_m;    ///< r
  VectorX conjugate_m;  ///< k: F' u, work-conjugate to the forces
  VectorX reaction_n;   ///< m: work-conjugate to the motions
  VectorX driven_force_n;  ///< of a driven contact on the body, three each: what its reaction is a part of
  MatrixX d_watched, d_conjugate, d_reaction, d_driven_force;  ///< r, k, m, 3 a driven contact x columns
  Index parameters = 2;  ///< columns before the directions
  double error = 0;      ///< of `watched_m`, relative to its largest value: the reduced model's own estimate and the mesh's
  /// Counted where `solved`; a branch has none; superposed: 0 where small gradients rule them out, else -1, not counted.
  int inverted_elements = 0;
  ResponseSolutionPtr solution;  ///< where `solved`

  /// Of answers to every coefficient (no LoadDirections).
  auto d_force() const { return d_watched.middleCols(parameters, conjugate_m.size()); }
  auto d_motion() const { return d_watched.rightCols(reaction_n.size()); }
  auto reaction_d_force() const { return d_reaction.middleCols(parameters, conjugate_m.size()); }
  auto reaction_d_motion() const { return d_reaction.rightCols(reaction_n.size()); }
};

/// Says how far a reduced answer is from a full solve at the same place.
struct Certificate {
  bool converged = false;
  std::string reason;
  double difference = 0;            ///< largest of the watched rows, relative to the largest value
  bool stable = false;              ///< no negative curvature of the energy at the full solution
  bool second_equilibrium = false;  ///< the full solve or loads stepped up from rest end in another state, or this one is
                                    ///< unstable and leads to another
  int inverted_elements = 0;
};

/// Where answers are superposed it may be asked by several threads at once; else it shares its solver's scratch memory: one a
/// thread.
class Response {
 public:
  struct Options {
    StaticsOptions statics;
    double poisson_lower = 0, poisson_upper = 0.49;
    double superposed_tolerance = 1e-7;  ///< of a linear material's polynomial in nu, relative (LinearResponse::Options)
    double branch_tolerance = 1e-3;      ///< of the branch, relative
    VectorX branch_force_over_young;     ///< k: t = 1 is this load over E, m2 for forces; empty: no branch
    int max_solves = 160;                ///< that the branch may take
    double discretisation_error = 0;     ///< of the mesh, relative; passed on with every answer
    std::vector<RigidContact> contacts;  ///< rigid bodies that it touches or may touch
    std::vector<DrivenContact> driven;   ///< those of them that motion coefficients move
    double friction_tolerance = 0;       ///< 0: that of ContactOptions
  };

  /// @param watched  r x 3n rows wanted of the displacement
  /// @throws Error where Statics and ContactStatics do, and when the branch does not fit the boundary
  Response(const TetMesh& mesh, const std::string& material, Boundary boundary, Eigen::SparseMatrix<double> watched,
           Options options);
  ~Response();
  Response(Response&&) noexcept;
  Response& operator=(Response&&) noexcept;

  /// From the reduced model where there is one that reaches there, else solved from rest.
  /// @throws Error unless there is one value for each of the forces and motions
  ResponseState at(const ResponseQuery& query) const;

  /// Solved in full, whether or not a reduced model would do. Without a start: from rest.
  ResponseState solve(const ResponseQuery& query, const ResponseStart& start = {}) const;

  /// Elements that are turned inside out there: by superposition where the whole displacement is kept as a polynomial, else solved for.
  int inverted_elements(const ResponseQuery& query) const;

  /// Fields that the watched rows of a superposed answer are sums of (LinearResponse::span); nullptr: ask for `at` instead.
  std::shared_ptr<const ResponseSpan> span(double poisson_ratio) const;
  /// What `at` says beside the watched rows, where span() has an answer: a fraction of the work.
  ResponseState readings(const ResponseQuery& query) const;

  /// One full solve at the same place, and one with the loads stepped up from rest. @throws Error for a body with contacts
  Certificate certify(const ResponseState& state, const ResponseQuery& query) const;

  /// Forgets the factor that the next solution begins with, so that its digits do not depend on what was solved before.
  void forget();

  bool superposes() const;
  bool touches() const;         ///< it has contacts
  Index motion_count() const;   ///< m
  double branch_end() const;    ///< largest t that the branch reaches (0: there is none; below 1: the material gave way)
  double branch_error() const;  ///< of its last coefficients, relative
  int solves() const;           ///< full solves and factorisations of a superposed body so far
  int load_cases() const;       ///< right-hand sides of a superposed body so far

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::fem
