// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>

#include "palpate/geometry/solid.hpp"

namespace palpate::geometry {

/// Shared volume over that of both together.
inline double overlap(const Solid& a, const Solid& b) {
  const Vec3 low = a.min_m().cwiseMin(b.min_m()), extent = a.max_m().cwiseMax(b.max_m()) - low;
  std::mt19937 rng(9);
  std::uniform_real_distribution<double> u;
  int both = 0, any = 0;
  for (int i = 0; i < 8000; ++i) {
    const Vec3 p = low + extent.cwiseProduct(Vec3(u(rng), u(rng), u(rng)));
    const bool in_a = a.inside(p), in_b = b.inside(p);
    both += in_a && in_b, any += in_a || in_b;
  }
  return double(both) / any;
}

}  // namespace palpate::geometry
