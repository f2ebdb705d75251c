// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/estimation/forward_model.hpp"

namespace palpate::estimation {

/// Which region of the object a place lies in or next to: the nearest element's, an index of region_names; 0 where it has none.
int region_at(const SimulatedObject& object, const Vec3& place_m);

}  // namespace palpate::estimation
