// SPDX-License-Identifier: Apache-2.0
// How far the sensors scatter while nothing changes: frames and wrenches of unloaded steps against their stated standard deviation.
// These repeats take no part in the fit's residuals, so that a sigma may be judged by them.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

struct StaticScatter {
  std::string what;  ///< "depth" (along the ray), "wrench force"
  std::string unit;
  std::size_t repeats = 0;      ///< unloaded frames, or readings
  std::size_t differences = 0;  ///< numbers that it was measured from
  double measured = 0;          ///< standard deviation of one reading
  double stated = 0;            ///< root mean square of what is stated of the same ones
  double ratio = 1;             ///< measured over stated, each reading by its own

  /// Far enough off that intervals are visibly too narrow (below: too wide), and not by chance.
  bool doubtful() const;
};

/// Depth: images of unloaded steps from one place, pixel by pixel between one and the next, without what neither the mask nor the
/// planes leave of the object, and without the few pixels that something has come into. Force: readings of unloaded steps
/// within one push. Nothing is said of a sensor with fewer than two repeats.
std::vector<StaticScatter> static_scatter(const Recording& recording);

}  // namespace palpate::sensing
