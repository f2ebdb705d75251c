// SPDX-License-Identifier: Apache-2.0
// What an arm keeps out of on its way from one push to the next.
#pragma once

#include <optional>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::acquisition {

/// Base frame, z up.
struct KeepOut {
  Vec3 min_m = Vec3::Zero(), max_m = Vec3::Zero();  ///< around the untouched object
  std::vector<Plane> planes;                        ///< table and walls
};

/// Around the scene's shape as it is given. Nothing: it is known from views only, or not at all.
std::optional<KeepOut> keep_out(const Recording& scene);
/// Around these points, before these planes.
KeepOut keep_out(const Points& surface_m, std::vector<Plane> planes);

/// As wide on every side of the object; the planes stay.
KeepOut grown(KeepOut around, double by_m);
/// A straight line from one to the other passes through the inside; touching is not passing.
bool passes_through(const KeepOut& around, const Vec3& from_m, const Vec3& to_m);
/// How far from a point inside to the outside, along a unit vector. 0 from outside.
double way_out_m(const KeepOut& around, const Vec3& from_m, const Vec3& direction);

}  // namespace palpate::acquisition
