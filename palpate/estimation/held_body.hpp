// SPDX-License-Identifier: Apache-2.0
// Nodes that supports and platens hold, as constraints of the static solver.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::estimation {

struct HeldBody {
  std::vector<fem::Constraint> constraints;
  /// 3n x m, one column a platen: metres of node motion per metre of travel.
  Eigen::SparseMatrix<double> motions;
  /// 3n x f: rigid motions that supports leave free. They were pinned at single nodes, which carry no force as long as no load
  /// works on these motions (frictionless platens); 0 columns when the supports hold everything.
  MatrixX free_motions;
};

/// @param platens  tools of shape `platen` whose motion is prescribed; their nodes are those within the plane's tolerance.
/// @throws Error naming the support or platen that touches no node, or that asks for friction.
HeldBody hold(const TetMesh& mesh, const std::vector<Support>& supports, const std::vector<const Tool*>& platens);

}  // namespace palpate::estimation
