// SPDX-License-Identifier: Apache-2.0
// The side of an object that nobody saw.
#pragma once

#include "palpate/reconstruction/fuse_views.hpp"

namespace palpate::reconstruction {

/// Replaces what completes the fused views (`planar`) by the solid that options.completion asks for, cut to what is not free.
/// Space is sorted in cubes of about one cell, and the skin of the chosen ones, smoothed like points are, becomes the facets.
/// Nothing changes where the planar completion is within two per cent of that solid, or nothing is known of free space.
/// The mirror stands upright on the support (or along z), within 45 degrees of across the line of sight, where most of what was
/// seen falls on itself or on hidden space and least on free space (the criterion of Bohg et al. 2011, "Mind the gap").
void complete(FusedViews& fused, const FuseOptions& options);

}  // namespace palpate::reconstruction
