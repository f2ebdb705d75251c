// SPDX-License-Identifier: Apache-2.0
// Ways of a tool around an object: over it, or along its sides. Inner header of the room.
#pragma once

#include <vector>

#include "palpate/acquisition/keep_out.hpp"

namespace palpate::acquisition {

/// Each leg of a way either moves or turns the tool, which is a rod behind its tip and keeps out of the box; a turn is the
/// shortest. Straight where nothing is in between. Sorted by length, the start left out.
/// @param from, to  outside the box, which has the clearance in it  @param tool_length_m  of the rod, from the tip backwards
std::vector<std::vector<Pose>> ways_around(const KeepOut& box, const Pose& from, const Pose& to, double tool_length_m);

/// From one pose to another in steps no longer and no wider than these, the last one included.
std::vector<Pose> in_pieces(const Pose& from, const Pose& to, double length_m, double angle_rad);

}  // namespace palpate::acquisition
