// SPDX-License-Identifier: Apache-2.0
// What a learned object does under a push that nobody has made yet, with bands from what is known of its elasticity: one
// equilibrium at the posterior's centre, and the exact derivatives of it to the moduli carry the covariance on.
#pragma once

#include <Eigen/SparseCore>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/mesh.hpp"
#include "palpate/fem/contact_statics.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::prediction {

/// Elasticity with its covariance. Of an object in R regions E and nu are those of the first one.
struct Elasticity {
  std::string material = "neo_hookean";
  double young_modulus_pa = 0, poisson_ratio = 0;
  std::vector<std::string> regions;  ///< R names; empty: one
  VectorX region_stiffness;          ///< R: E over the first region's; empty: one region
  VectorX region_poisson;            ///< R: NaN, then nu of every further region; empty: they share one
  std::vector<int> region;           ///< an element of the mesh: its region; not told by an answer (fem/regions.hpp)
  /// Of (log E, nu), then log of every further region's E over the first one's, then their nu where they have their own.
  MatrixX covariance = MatrixX::Zero(2, 2);
  VectorX extra;  ///< further parameters of the law, taken as known

  double young_modulus_of(Index of) const;  ///< a region, Pa
  double poisson_ratio_of(Index of) const;
  double highest_young_modulus_pa() const;
  double highest_poisson_ratio() const;
};
/// @throws Error when the answer holds no Young's modulus or Poisson ratio.
Elasticity elasticity_of(const Identification& answer);

/// A push on one patch, or by a tool that moves as a rigid body: either its force or its travel is given. Both act along `direction`.
struct NewPush {
  Vec3 direction = -Vec3::UnitZ();  ///< unit length
  std::optional<double> force_n;    ///< along `direction`
  std::optional<double> travel_m;   ///< of the patch, work-conjugate to the force; of a rigid tool: its own
  VectorX background;               ///< coefficients of the boundary's other columns (gravity); empty = zero
};

/// How the object moves as a whole under a force, since what it stands on gives way.
struct RigidWay {
  Eigen::Matrix<double, 6, 3> per_newton = Eigen::Matrix<double, 6, 3>::Zero();  ///< of the pivot: m/N, then rad/N
  Vec3 pivot_m = Vec3::Zero();
  bool moves() const { return !per_newton.isZero(0); }
  Mat3 at(const Vec3& place_m) const;  ///< m/N: motion of a place per force
};

/// What a body is pressed by and stands on, where that is more than a boundary can say.
struct Surroundings {
  std::vector<fem::RigidContact> contacts;  ///< tables and walls that only push; a tool that touches as a rigid body
  std::optional<std::size_t> tool;          ///< which of `contacts` moves along the push; nothing: a patch is pressed
  std::optional<Index> platen;              ///< or which of the boundary's motions does, whose nodes move with it
  RigidWay gives_way;
  Vec3 contact_m = Vec3::Zero();  ///< where the travel is read, which matters where the object gives way as a whole
  bool moves_a_tool() const { return tool || platen; }
};

/// Median and a band of 95 %; positive quantities have a log-normal one.
struct Band {
  double value = 0, std = 0, lower_95 = 0, upper_95 = 0;
};

struct Prediction {
  bool converged = false;
  std::string reason;          ///< why not, or what is odd
  Band force_n, travel_m;      ///< along the push; the given one has no width
  double stiffness_n_m = 0;    ///< d force / d travel there
  Vec3 pressed_n = Vec3::Zero();  ///< all of the force on the object: a rigid tool's may have a part across the push
  VectorX displacement_m;      ///< 3n, node-major; from the state under the background alone
  VectorX displacement_std_m;  ///< 3n
  VectorX von_mises_pa;        ///< n: Cauchy stress at the nodes, mean of the elements around
  VectorX von_mises_std_pa;    ///< n
  Band largest_von_mises_pa, largest_displacement_m;
  int inverted_elements = 0;
};

/// @param boundary  supports, and forces whose first three columns are unit resultants of the patch along x, y and z (what
///                  follows is background). Of a tool that moves: background alone
/// @throws Error for regions without elements of theirs, for a push with neither or both of force and travel, or without unit direction; as fem::Statics does.
Prediction predict(const TetMesh& mesh, const Elasticity& elasticity, fem::Boundary boundary, const NewPush& push,
                   fem::StaticsOptions options = {}, Surroundings around = {});

}  // namespace palpate::prediction
