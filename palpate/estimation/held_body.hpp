// SPDX-License-Identifier: Apache-2.0
// What supports and platens hold: nodes as constraints of the static solver, and rigid bodies that only push.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/fem/contact_statics.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::estimation {

struct HeldBody {
  std::vector<fem::Constraint> constraints;
  /// 3n x m, one column a platen: metres of node motion per metre of travel; then one a support that may spread (spreads).
  Eigen::SparseMatrix<double> motions;
  /// 3n x f: rigid motions that supports leave free. They were pinned at single nodes, which carry no force as long as no load
  /// works on these motions (frictionless platens), orthonormal and as near to the axes as may be; 0 columns when the supports hold everything.
  MatrixX free_motions;
  /// Tables and walls that the object may lift off and slide on (not the bonded ones), in the order of the supports.
  std::vector<fem::RigidContact> contacts;
};

/// True for a support that only pushes.
bool lifts_off(const Support& support);

/// Supports that are found by the linear solver: tables and walls hold in both directions, and friction holds.
std::vector<Support> held_both_ways(std::vector<Support> supports);

/// Distance of the held nodes' rim from their centre; 0 where they are not flat, so that there is no rim that could slide
/// outwards.
double rim_radius_m(const TetMesh& mesh, const Support& support);

/// True for a support whose rim is not known to hold.
bool spreads(const Support& support);

/// @param platens  tools of shape `platen` whose motion is prescribed; their nodes are those within the plane's tolerance.
/// @throws Error naming the support or platen that touches no node, that asks for friction of chosen nodes, or that may
/// spread
///         and is not flat.
HeldBody hold(const TetMesh& mesh, const std::vector<Support>& supports, const std::vector<const Tool*>& platens);

}  // namespace palpate::estimation
