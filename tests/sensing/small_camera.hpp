// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/recording.hpp"

namespace palpate {

/// 160 x 120 pixels, 30 degrees wide, its axis through the middle.
inline Camera small_camera() {
  Camera camera;
  camera.width_px = 160;
  camera.height_px = 120;
  camera.fx_px = camera.fy_px = 300;
  camera.cx_px = 79.5;
  camera.cy_px = 59.5;
  return camera;
}

}  // namespace palpate
