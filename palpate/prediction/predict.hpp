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

/// A push on one patch: either its force or its travel is given. Both act along `direction`.
struct NewPush {
  Vec3 direction = -Vec3::UnitZ();  ///< unit length
  std::optional<double> force_n;    ///< along `direction`
  std::optional<double> travel_m;   ///< of the patch, work-conjugate to the force
  VectorX background;               ///< coefficients of the boundary's other columns (gravity); empty = zero
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
  VectorX displacement_m;      ///< 3n, node-major; from the state under the background alone
  VectorX displacement_std_m;  ///< 3n
  VectorX von_mises_pa;        ///< n: Cauchy stress at the nodes, mean of the elements around
  VectorX von_mises_std_pa;    ///< n
  Band largest_von_mises_pa, largest_displacement_m;
  int inverted_elements = 0;
};

/// @param boundary  supports, and forces whose first three columns are unit resultants of the patch along x, y and z (what
///                  follows is background)
/// @throws Error for regions without elements of theirs, for a push with neither or both of force and travel, or without unit direction; as fem::Statics does.
Prediction predict(const TetMesh& mesh, const Elasticity& elasticity, fem::Boundary boundary, const NewPush& push,
                   fem::StaticsOptions options = {});

}  // namespace palpate::prediction
