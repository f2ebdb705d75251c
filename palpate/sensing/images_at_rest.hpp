// SPDX-License-Identifier: Apache-2.0
// Images that show the object as nothing loads it.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// The recording's views of the object, and the first image of each push while nothing loaded it, without the arm (ArmMask).
std::vector<DepthFrame> images_at_rest(const Recording& recording);

}  // namespace palpate::sensing
