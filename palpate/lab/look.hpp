// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate::lab {

/// What a surface is to a camera.
struct Look {
  double albedo = 0.5;  ///< share of light that comes back: time of flight is noisier on dark things
  double texture = 1;   ///< 0 uniform ... 1 as good as a test pattern: what passive stereo needs
};

}  // namespace palpate::lab
