// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/mesh.hpp"
#include "palpate/report/canvas.hpp"

namespace palpate::report {

/// A tetrahedral mesh with its edges: whole on the left; on the right without the elements before a plane through its
/// middle, so that the inner ones are seen. Transparent where there is no object. `up` stands upright in the picture.
Picture draw_mesh(const TetMesh& mesh, int width, int height, const Vec3& up = Vec3::UnitZ());

}  // namespace palpate::report
