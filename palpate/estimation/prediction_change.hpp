// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::estimation {

struct StepPrediction;

/// What another model of a step predicts beyond this one at one set of unknowns, value and derivatives; elsewhere the first
/// order of it.
struct PredictionChange {
  VectorX at;                ///< the unknowns
  std::vector<int> columns;  ///< of the derivatives
  Points surface_m;
  MatrixX d_surface;  ///< 3v x columns
  VectorX travel_m;
  MatrixX d_travel;  ///< loads x columns
  std::vector<Vec3> force_n;
  std::vector<Eigen::Matrix<double, 3, Eigen::Dynamic>> d_force;  ///< a load: 3 x columns

  void add_to(StepPrediction& predicted, const VectorX& unknowns, bool derivatives) const;
  /// The same among more unknowns. @param place  where each of `at` is now  @param count  of all of them
  PredictionChange renumbered(const std::vector<int>& place, Index count) const;
};

/// Nothing where one of the two has no equilibrium or they are not of the same surface, loads and unknowns.
std::optional<PredictionChange> change_between(const StepPrediction& from, const StepPrediction& to, const VectorX& unknowns);

}  // namespace palpate::estimation
