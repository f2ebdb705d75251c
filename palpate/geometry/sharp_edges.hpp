// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "palpate/geometry/solid.hpp"
#include "palpate/geometry/tet_editor.hpp"

namespace palpate::geometry {

/// Inside of tetrahedralise: puts boundary vertices onto the surface's sharp edges and into its corners. Facets of a coarse
/// mesh cut such edges off; a least-squares fit of the surface brings them back only in part, and a bar without its edges
/// bends some per cent too far, on every finer mesh of the same outline as well.
class SharpEdges {
 public:
  /// Finds the smooth parts of the surface (no edge of 40 degrees within), which must outlive this.
  explicit SharpEdges(const Solid& solid);
  ~SharpEdges();

  /// Boundary triangles belong to the part that they lie on, where that is larger than they are, and vertices between two
  /// parts to the edge that these share. A vertex moves only as far as `floor_quality`, or what its elements had before,
  /// allows.
  /// @returns whether any moved
  bool meet(TetEditor& mesh, double floor_quality) const;

  struct Parts;

 private:
  const Solid& solid_;
  std::unique_ptr<const Parts> parts_;
};

}  // namespace palpate::geometry
