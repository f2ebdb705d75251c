// SPDX-License-Identifier: Apache-2.0
// What a view shows of a push: not what the stick hides. Inner header of next_push.
#pragma once

#include <optional>

#include "palpate/estimation/push_candidates.hpp"
#include "palpate/estimation/terms/term.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {

/// Rays of `view` that the stick (radius `radius_m`, from the contact backwards) does not cover.
RayObservation without_stick(const RayObservation& view, const PushCandidate& candidate, double radius_m, double length_m);

/// Share of the surface around the tool, one to three radii from the contact, that a view shows: facing it (nothing: any
/// side), with none of the object in between, and with points that were seen beside it.
double seen_share(const geometry::TriangleTree& surface, const Points& seen_m, const std::optional<Vec3>& eye_m,
                  const PushCandidate& candidate, double radius_m, double spacing_m);

}  // namespace palpate::estimation
