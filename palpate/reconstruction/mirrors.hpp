// SPDX-License-Identifier: Apache-2.0
// Upright planes at which an object seen from one side may be mirrored.
#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::reconstruction {

struct Mirror {
  Vec3 normal = Vec3::Zero();
  double offset_m = 0;
  Vec3 of(const Vec3& p) const { return p - 2 * (normal.dot(p) - offset_m) * normal; }
};

/// Judges mirrors by the images of seen facets: on seen facets of the image's direction they speak for it, in free space
/// against it (Bohg et al. 2011, "Mind the gap"). Keeps references to its arguments.
class MirrorSearch {
 public:
  /// @param seen  facets, one triangle each, outward
  /// @param free  says of a place that a sensor looked through it; asked `step_m` within an image, so that rims do not count
  /// @param step_m  between two planes that are tried; images within two steps of a seen facet lie on it
  MirrorSearch(const TriMesh& seen, const Vec3& up, double step_m, const std::function<bool(const Vec3&)>& free);

  /// The object's own symmetries, the surest first: most of what was seen has its image in what was seen. Planes of all directions
  /// along `up`, at least 30 degrees apart: an animal has one, a box has up to four, and of a ball's some are found.
  std::vector<Mirror> symmetries() const;
  /// Half way to the unseen back: planes within 30 degrees of across `toward` (to the sensor, along the support), up to
  /// `behind_m` behind the front. Where the object's outline bends away, its rim is its own image; where a tool met the back
  /// (`touched_m`), its image lies on what was seen.
  std::optional<Mirror> half_way_back(const Vec3& toward, double behind_m, const std::vector<Vec3>& touched_m) const;

 private:
  using Facets = std::vector<std::pair<Vec3, Vec3>>;  // middles and normals
  struct Judged {
    double good = 0, bad = 0;  // shares of the facets
    double off = 0;            // how far images and facets want the plane elsewhere, by least squares, over near_m()
  };
  Facets some(Index count) const;
  Judged judged(const Mirror& mirror, const Facets& facets) const;
  /// How far images of places where tools met the back are from what was seen, over near_m(), summed.
  double missed(const Mirror& mirror, const std::vector<Vec3>& touched_m) const;
  double near_m() const { return 2 * step_m_; }

  const TriMesh& seen_;
  geometry::TriangleTree tree_;
  Vec3 up_;
  double step_m_;
  const std::function<bool(const Vec3&)>& free_;
};

}  // namespace palpate::reconstruction
