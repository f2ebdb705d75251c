// SPDX-License-Identifier: Apache-2.0
// Inside and outside of an object that was seen from all around, where nobody saw it. Of this room alone.
#pragma once

#include "palpate/reconstruction/fuse_views.hpp"

namespace palpate::reconstruction {

/// 1 close behind the facets that are held, 0 close before them and where a sensor looked through, harmonic between, level
/// at the support and gently drawn to what the planar completion says: a skin that spans gaps, stands upright on the table, and
/// takes what hides below an overhang for solid where no free space is near. What hangs together with no facet is outside.
/// Of the other completions, `planar` is followed wherever nothing is known, `tapered` leaves out what little speaks for, and
/// `hidden` takes in what little speaks against.
/// @returns a function of a place: inside where it is above one half
std::function<double(const Vec3&)> hidden_field(const FusedViews& fused, const FuseOptions& options);

}  // namespace palpate::reconstruction
