// SPDX-License-Identifier: Apache-2.0
// What stands beside the object in its views: other things on the table, a wall of the room.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/reconstruction/fuse_views.hpp"

namespace palpate::reconstruction {

struct ForeignPoints {
  double share = 0;      ///< of all points that were left out
  double nearest_m = 0;  ///< how near they come to the object
};

/// Leaves out points that hang together with nothing that was touched: further from it than 0.15 of its own size, and at least
/// a fiftieth of all points. Fewer are noise that fusing bears, unless they are further than its size, which makes cells wide: these
/// are left out without a word. Nothing is left out where nothing was touched that the views show.
ForeignPoints drop_foreign(std::vector<PointCloud>& clouds, const std::vector<Touch>& touched);

}  // namespace palpate::reconstruction
