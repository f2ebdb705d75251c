// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/regions_by_site.hpp"

#include <algorithm>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::fem {

std::vector<Region> regions_by_site(const Recording& recording) {
  std::vector<Region> regions;
  for (const Push& push : recording.pushes) {
    const std::string name = push.site.empty() ? push.name : push.site;
    auto region = std::find_if(regions.begin(), regions.end(), [&](const Region& each) { return each.name == name; });
    if (region == regions.end()) {
      regions.emplace_back();
      region = regions.end() - 1;
      region->name = name;
      region->select = RegionSelection::points;
    }
    for (const Step& step : push.steps) {
      for (const Load& load : step.loads) {
        if (!load.force_n || load.force_n->norm() == 0) continue;
        const Points& known = region->points_m;
        if (known.rows() > 0 && (known.rowwise() - load.contact_m.transpose()).rowwise().norm().minCoeff() < 1e-6) continue;
        region->points_m.conservativeResize(region->points_m.rows() + 1, 3);
        region->points_m.bottomRows<1>() = load.contact_m.transpose();
      }
    }
    if (region->points_m.rows() == 0)
      throw Error("no force acts at a place in push '" + push.name +
                      "', so no region lies around it; give the regions in the recording",
                  "regions by-site");
  }
  return regions;
}

}  // namespace palpate::fem
