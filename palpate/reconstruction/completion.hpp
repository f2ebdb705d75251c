// SPDX-License-Identifier: Apache-2.0
// The side of an object that nobody saw.
#pragma once

#include "palpate/reconstruction/fuse_views.hpp"

namespace palpate::reconstruction {

/// Replaces what completes the fused views (`planar`) by the solid that options.completion asks for, cut to what is not free.
/// Space is sorted in cubes of about one cell, and the skin of the chosen ones, smoothed like points are, becomes the facets.
/// Nothing changes where the planar completion is within two per cent of that solid, or nothing is known of free space.
/// Mirrors stand upright on the support (or along z), and are judged by where the images of seen facets fall: on what was
/// seen, into hidden space or into free space (the criterion of Bohg et al. 2011, "Mind the gap"). First comes a symmetry of
/// what was seen, where there is one, then the plane within 30 degrees of across the line of sight that says how far back the
/// object reaches. Grooves between two such parts are closed. An object that was seen from all around needs no mirror: what is
/// known of free space and of the facets is spread over what is hidden (hidden_field.hpp).
void complete(FusedViews& fused, const FuseOptions& options);

}  // namespace palpate::reconstruction
