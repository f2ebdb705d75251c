// SPDX-License-Identifier: Apache-2.0
// One fine, watertight surface through the facets of fused views.
#pragma once

#include "palpate/reconstruction/fuse_views.hpp"

namespace palpate::reconstruction {

struct SurfaceOptions {
  double cell_m = 0;  ///< of the lattice; triangles have edges of half of it to all of it. 0 = 1.1 times FusedViews::cell_m
  std::function<bool(const Vec3&)> free = {};  ///< says of a place that a sensor looked through it: it is outside where no facet is near
  std::optional<Plane> support = {};  ///< nothing of the object is behind it; used where FusedViews::inside is given
  std::function<bool(const Vec3&)> belongs = {};  ///< parts with no such vertex are left out; empty: all are kept
};

/// Where facets are near, the surface is where the mean of their distances vanishes, each measured along the mean of its own
/// normal and that of its neighbourhood (which a sphere satisfies exactly to second order, so that curved parts do not
/// bulge); elsewhere, where FusedViews::inside passes one half or, without it, where their winding number does or a sensor's sight ends, then bent as little as may be
/// (unseen_patches.hpp). Marching tetrahedra over a body-centred lattice: every edge has exactly two triangles. Parts below a
/// hundredth of the largest one's area are left out.
/// @throws Error when the facets enclose nothing, or the cells are too small for the object.
TriMesh fused_surface(const FusedViews& fused, const SurfaceOptions& options = {});

}  // namespace palpate::reconstruction
