// SPDX-License-Identifier: Apache-2.0
// What an earlier run of the same push left on the record, before it was cut off.
#pragma once

#include <limits>
#include <optional>

#include "palpate/core/recording.hpp"

namespace palpate::acquisition {

struct RecordedPart {
  int steps = 0;
  double force_n = 0, travel_m = 0;  ///< the highest and the deepest
  double back_at_n = std::numeric_limits<double>::infinity();  ///< lowest force under load on the way back
  bool rest = false;                 ///< the untouched object was looked at
  bool unloading = false;            ///< the way back had begun, so the rise is whole
  bool again = false;                ///< the object was looked at after the push: nothing is missing
  std::optional<Vec3> contact_m;     ///< the zero of its travels
  std::optional<DepthFrame> before;  ///< of the untouched object
  double force_tare_std_n = 0, travel_offset_std_m = 0;  ///< as it states them
};

RecordedPart recorded_part(const Push& push, const Vec3& direction);

}  // namespace palpate::acquisition
