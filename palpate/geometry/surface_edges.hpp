// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

/// An edge of a surface and the triangles on both sides of it.
struct SurfaceEdge {
  Index from = -1, to = -1;              ///< vertices, the smaller number first
  std::array<Index, 2> triangles{-1, -1};  ///< the second is -1 where the surface ends, or where more than two meet
};

/// Every edge once, in the order of its vertices.
std::vector<SurfaceEdge> surface_edges(const Triangles& triangles);

}  // namespace palpate::geometry
