// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/SparseCore>
#include <array>

#include "palpate/core/recording.hpp"

namespace palpate::estimation {

/// Where a load acts, as far as it is known.
inline Vec3 touched_m(const Load& load) { return load.contact_m + load.contact_found_m; }

/// Three columns of nodal forces, unit resultant along x, y, z, of a tool at its contact (vertices: spread equally; sphere and
/// disc: uniform over the patch of that radius; edge and capsule: uniform along the line).
/// @throws Error for a tool that the object is not under, or of a shape that needs contact search.
Eigen::SparseMatrix<double> load_columns(const TetMesh& mesh, const Tool& tool, const Load& load);

/// Two unit vectors across the push, along which a contact may have shifted.
std::array<Vec3, 2> tangents(const Vec3& direction);

/// Derivative of load_columns to a shift of the contact along a tangent (1/m), by central differences over an eighth of the
/// tool's radius: a patch on a mesh is smooth on that scale only.
Eigen::SparseMatrix<double> shifted_columns(const TetMesh& mesh, const Tool& tool, const Load& load, const Vec3& tangent);

/// Derivative of load_columns to the radius of a sphere's or disc's patch (1/m), by the same differences.
Eigen::SparseMatrix<double> widened_columns(const TetMesh& mesh, const Tool& tool, const Load& load);

}  // namespace palpate::estimation
