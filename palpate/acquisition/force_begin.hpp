// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "palpate/sensing/push_events.hpp"

namespace palpate::acquisition {

struct ForceBeginSearch {
  double farthest_m = 0;   ///< before the place where contact was noticed
  double increment_m = 0;  ///< between samples; the answer is as fine as a tenth of it ...
  double finest_m = 0;     ///< ... or of this, where motions were shorter
};

/// How far before `noticed_m` the force began: there the best line through zero ends among all samples of the approach and of
/// the rise, force k (depth - begin) beyond it, none before.
double force_began_before_m(std::span<const sensing::ContactSample> samples, const Vec3& noticed_m, const Vec3& direction,
                            const ForceBeginSearch& search);

}  // namespace palpate::acquisition
