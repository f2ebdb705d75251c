// SPDX-License-Identifier: Apache-2.0
// Where one surface ends in an image and another begins: pixels there mix both.
#pragma once

#include "palpate/core/recording.hpp"
#include "palpate/sensing/back_projection.hpp"

namespace palpate::sensing {

/// Pixels beside a depth edge: neighbours whose depths differ by more than noise and the surface's own fall explain. With
/// options.blind_to_own_noise what it falls by is taken off first, as the planes around both say: a limit that it uses up would be
/// passed more often by noise of one sign, and the pixels that stay would be wrong on average. And on slopes the noise is that of
/// samples beside the pixel's centre, too.
/// @param missing  1: no depth there, and no edge either unless options.remove_hole_borders
MaskImage depth_edges(const DepthFrame& frame, const MaskImage& missing, const BackProjectionOptions& options);

}  // namespace palpate::sensing
