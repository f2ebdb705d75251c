// SPDX-License-Identifier: Apache-2.0
// An object of the lab that nothing holds: a ball between two opposed pads of one size.
#pragma once

#include "palpate/lab/object.hpp"

namespace palpate::lab {

inline constexpr double opposed_ball_radius_m = 0.06;

/// It lies on a pad that is let into the table and is pressed from above. Its one site is its top; weight is left out.
LabObject opposed_ball(const ObjectOptions& options = {});

}  // namespace palpate::lab
