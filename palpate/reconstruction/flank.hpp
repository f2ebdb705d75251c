// SPDX-License-Identifier: Apache-2.0
// The side of an object close above what it stands on, and how it goes on where nobody saw it. Of this room alone.
#pragma once

#include "palpate/reconstruction/facets.hpp"

namespace palpate::reconstruction {

/// An arc downwards: the normal turns evenly with the way.
struct Flank {
  Vec3 at_m = Vec3::Zero();                              ///< where it starts
  Vec3 normal = Vec3::UnitX(), towards = Vec3::UnitY();  ///< there, and where it turns to
  double turn_per_m = 0;
  Vec3 normal_at(double below_m) const;
};

/// The arc that continues what the facets around one show: their middles and normals together, weighed by their distance, say where
/// the surface lies, how it leans and how it bends each way along it. Bending has a prior, about none, give or take one radian over the
/// reach; how much it counts follows from the facets' scatter. Of a ball's bending it hides less than a hundredth.
/// @param up  unit vector, not along the facet's normal
/// @param reach_cells  how far away a facet still counts
Flank flank_below(const Facet& from, const Vec3& up, const Grid& facets, double cell_m, double reach_cells);

}  // namespace palpate::reconstruction
