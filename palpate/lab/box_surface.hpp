// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/mesh.hpp"

namespace palpate::lab {

/// Closed surface of a box, every face in `cells` x `cells` squares of two triangles; edges and corners are shared.
TriMesh box_surface(const Vec3& min_m, const Vec3& max_m, int cells);

}  // namespace palpate::lab
