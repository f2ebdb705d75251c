// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/SparseCore>

#include "palpate/core/recording.hpp"

namespace palpate::estimation {

/// Three columns of nodal forces, unit resultant along x, y, z, of a tool at its contact (vertices: spread equally; sphere and
/// disc: uniform over the patch of that radius; edge and capsule: uniform along the line).
/// @throws Error for a tool that the object is not under, or of a shape that needs contact search.
Eigen::SparseMatrix<double> load_columns(const TetMesh& mesh, const Tool& tool, const Load& load);

}  // namespace palpate::estimation
