// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/progress.hpp"
#include "palpate/geometry/lattice.hpp"
#include "palpate/geometry/tet_editor.hpp"

namespace palpate::geometry {

/// Inside of tetrahedralise. Merges vertices closer than `share` of the wished edge length, shortest edges first.
void merge_short_edges(TetEditor& mesh, const Solid& solid, double share, double above_quality);

struct ImproveOptions {
  double target_quality = 0.43;  ///< tet_quality of the worst element at which work stops
  int most_rounds = 9;
  double tolerance = 0.1;  ///< how far a local change may leave the surface, share of the wished edge length
};

/// Fits to the surface and improves the worst elements by turns: smoothing, edge and face removal, merging, splitting.
/// False when the caller asked to stop.
bool improve(TetEditor& mesh, const Solid& solid, const SurfaceSamples& samples, const ImproveOptions& options,
             const OnProgress& progress = {});

}  // namespace palpate::geometry
