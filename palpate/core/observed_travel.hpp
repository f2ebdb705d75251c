// SPDX-License-Identifier: Apache-2.0
// What a recording says of the way of its tools.
#pragma once

#include "palpate/core/recording.hpp"

namespace palpate {

/// How far the tool of this load had gone, as its encoder read it in this step; nullptr where none did.
const ToolTravel* observed_travel(const Step& step, const Load& load);

/// A ball whose force is measured, whose patch nobody stated (`radius_std_m`), and whose travel was read wherever it presses in
/// this push, in which nothing slid: then its travel says how much of it touches.
bool shows_what_it_touches(const Tool& ball, const Push& push);

}  // namespace palpate
