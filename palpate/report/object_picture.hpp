// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "palpate/report/canvas.hpp"

namespace palpate::report {

/// Pale to dark blue for 0..1, the page's map of sizes.
Colour size_colour(double share);

struct ObjectPicture {
  Picture picture;                    ///< transparent where there is no object
  double largest_displacement_m = 0;  ///< what the darkest colour stands for
  std::size_t step = 0;               ///< which entry of "steps" is shown: the one that moved most
};

/// The deformed surface of the page's data, coloured by displacement, with observed points and the force as an arrow, drawn
/// by a depth buffer with 2 x 2 samples a pixel. Empty (width 0) when the data carry no surface.
ObjectPicture draw_object(const nlohmann::json& page, int width, int height);

}  // namespace palpate::report
