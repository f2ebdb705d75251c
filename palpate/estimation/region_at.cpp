// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/region_at.hpp"

#include <limits>

#include "palpate/fem/regions.hpp"

namespace palpate::estimation {

int region_at(const SimulatedObject& object, const Vec3& place_m) {
  if (object.region.empty()) return 0;
  Index nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (Index e = 0; e < object.mesh.tetrahedra.rows(); ++e) {
    const double d2 = (fem::element_centre(object.mesh, e) - place_m).squaredNorm();
    if (d2 < least) least = d2, nearest = e;
  }
  return object.region[static_cast<std::size_t>(nearest)];
}

}  // namespace palpate::estimation
