// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/finer_at_supports.hpp"

#include "palpate/geometry/box_rims.hpp"
#include "palpate/geometry/stand_on.hpp"

namespace palpate::reconstruction {

std::vector<geometry::FinerNear> finer_at_supports(const std::vector<Support>& supports, const TriMesh& surface) {
  std::vector<geometry::FinerNear> all;
  for (const Support& support : supports) {
    std::vector<geometry::FinerNear> finer;
    if (support.kind == SupportKind::plane || support.kind == SupportKind::table) finer = geometry::finer_at_feet(support.plane, surface);
    if (support.kind == SupportKind::box || (support.kind == SupportKind::clamp && support.select == NodeSelection::box))
      finer = geometry::finer_at_rims(support.box_min_m.array() - support.tolerance_m, support.box_max_m.array() + support.tolerance_m, surface);
    all.insert(all.end(), finer.begin(), finer.end());
  }
  return all;
}

}  // namespace palpate::reconstruction
