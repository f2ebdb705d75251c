// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/regions.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/geometry/nearest_vertices.hpp"

namespace palpate::fem {
namespace {

std::string where(const Region& region) { return region.source.empty() ? "regions." + region.name : region.source; }

Points centres_of(const TetMesh& mesh) {
  Points centres(mesh.tetrahedra.rows(), 3);
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) centres.row(e) = element_centre(mesh, e);
  return centres;
}

// Region that names each element of `listed`, or -1.
std::vector<int> named_elements(const std::vector<Region>& regions, const TetMesh* listed) {
  std::vector<int> named;
  for (std::size_t r = 0; r < regions.size(); ++r) {
    if (regions[r].select != RegionSelection::elements) continue;
    if (listed == nullptr) throw Error("elements need a volume mesh at rest; choose the region by a box or by points", where(regions[r]));
    named.resize(static_cast<std::size_t>(listed->tetrahedra.rows()), -1);
    for (const Index e : regions[r].elements) {
      if (e < 0 || e >= listed->tetrahedra.rows())
        throw Error("element " + std::to_string(e) + " is not in the volume mesh, which has " +
                        std::to_string(listed->tetrahedra.rows()) + " (indices are 0-based)",
                    where(regions[r]));
      int& owner = named[static_cast<std::size_t>(e)];
      if (owner >= 0 && owner != static_cast<int>(r))
        throw Error("element " + std::to_string(e) + " belongs to '" + regions[static_cast<std::size_t>(owner)].name + "' already",
                    where(regions[r]));
      owner = static_cast<int>(r);
    }
  }
  return named;
}

}  // namespace

Vec3 element_centre(const TetMesh& mesh, Index element) {
  Vec3 centre = Vec3::Zero();
  for (int k = 0; k < 4; ++k) centre += 0.25 * mesh.nodes_m.row(mesh.tetrahedra(element, k)).transpose();
  return centre;
}

std::vector<int> regions_of(const TetMesh& mesh, const std::vector<Region>& regions, const TetMesh* listed) {
  const Points centres = centres_of(mesh);
  const std::vector<int> named = named_elements(regions, listed);
  std::optional<geometry::NearestVertices> listed_centres;
  if (!named.empty() && listed->tetrahedra.rows() != mesh.tetrahedra.rows()) listed_centres.emplace(centres_of(*listed));
  std::vector<int> region(static_cast<std::size_t>(mesh.tetrahedra.rows()), -1);
  std::vector<Index> count(regions.size(), 0);
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    const Vec3 at = centres.row(e);
    int mine = -1, listing = -1, rest = -1, around = -1;
    if (!named.empty()) {
      Index nearest = e;
      if (listed_centres) {
        geometry::NearestVertices::Memory none;
        nearest = listed_centres->nearest(at, none).vertex;
        if (nearest < 0) throw Error("the centre of element " + std::to_string(e) + " is not finite; check its nodes", "mesh");
      }
      listing = named[static_cast<std::size_t>(nearest)];
    }
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t r = 0; r < regions.size() && mine < 0; ++r) {
      const Region& one = regions[r];
      const int number = static_cast<int>(r);
      switch (one.select) {
        case RegionSelection::elements:
          if (listing == number) mine = number;
          break;
        case RegionSelection::box:
          if ((at.array() >= one.box_min_m.array()).all() && (at.array() <= one.box_max_m.array()).all()) mine = number;
          break;
        case RegionSelection::points: {
          if (one.points_m.rows() == 0) throw Error("has no points; give some of the object's, or leave the region out", "regions." + one.name);
          const double distance = (one.points_m.rowwise() - at.transpose()).rowwise().squaredNorm().minCoeff();
          if (distance < nearest) around = number;
          nearest = std::min(nearest, distance);
          break;
        }
        case RegionSelection::rest: rest = number; break;
      }
    }
    if (mine < 0) mine = around >= 0 ? around : rest;
    if (mine < 0)
      throw Error("no region holds the point [" + std::to_string(at.x()) + ", " + std::to_string(at.y()) + ", " +
                      std::to_string(at.z()) + "] of the object; let one of them take the rest",
                  "regions");
    region[static_cast<std::size_t>(e)] = mine;
    ++count[static_cast<std::size_t>(mine)];
  }
  for (std::size_t r = 0; r < regions.size(); ++r) {
    if (count[r] == 0) throw Error("no element's centre lies in region '" + regions[r].name + "'", where(regions[r]));
  }
  return region;
}

}  // namespace palpate::fem
