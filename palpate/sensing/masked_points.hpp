// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// What the camera saw under the frame's mask, base frame, within the box `low_m` to `high_m`: evenly thinned to `most`
/// points at most. For people who want to see whether the mask took what it should; no fit uses them.
/// @throws Error when image, mask and camera differ in size
Points masked_points(const DepthFrame& frame, const Vec3& low_m, const Vec3& high_m, Index most);

}  // namespace palpate::sensing
