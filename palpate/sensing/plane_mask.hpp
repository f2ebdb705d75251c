// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

struct PlaneMaskOptions {
  double margin_m = 0.003;  ///< error of the plane and of the camera's pose
  double sigmas = 3.0;      ///< plus this many standard deviations of the sensor along the ray
  int window_px = 2;        ///< half width of the window whose median depth decides; 0 = the pixel itself
};

/// @throws Error naming the option that is out of range.
void check(const PlaneMaskOptions& options);

/// Pixels that show tables and walls: 1 where the ray reaches a plane before the measurement does, or less than the margins
/// after it. Margins act along the normal; a low part of the object within them is lost, which a likelihood can bear, while
/// a pixel of the table taken for the object would bias it. Close to the margin the median of the neighbours decides: were it
/// the pixel's own depth, those that noise lifts off the plane would stay and the others go, and the object would seem to
/// bulge out above the table (in the demo's cube: a Poisson ratio 0.03 too low).
/// @throws Error when an option is negative, or the camera is behind a plane (its normal points the wrong way).
MaskImage mask_planes(const DepthFrame& frame, const std::vector<Plane>& planes, const PlaneMaskOptions& options = {});

/// Frame with `mask` merged into its own.
/// @throws Error when the sizes differ.
DepthFrame with_mask(DepthFrame frame, const MaskImage& mask);

/// No pixel outside its mask has a depth: it tells nothing, and no recording may hold it.
bool is_blank(const DepthFrame& frame);

}  // namespace palpate::sensing
