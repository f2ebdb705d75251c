// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "palpate/core/mesh.hpp"
#include "palpate/report/canvas.hpp"

namespace palpate::report {

/// A tetrahedral mesh with its edges: whole on the left; on the right without the elements before a plane through its
/// middle, so that the inner ones are seen. Transparent where there is no object. `up` stands upright in the picture.
Picture draw_mesh(const TetMesh& mesh, int width, int height, const Vec3& up = Vec3::UnitZ());

/// A surface with its edges, from where `draw_mesh` looks.
Picture draw_surface(const TriMesh& surface, int width, int height, const Vec3& up = Vec3::UnitZ());

/// Clouds in the colours of categories, from there.
/// @param around  what fills the picture, so that several compare
Picture draw_clouds(std::span<const Points> clouds, const Points& around, int width, int height, const Vec3& up = Vec3::UnitZ());

}  // namespace palpate::report
