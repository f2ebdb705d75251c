// SPDX-License-Identifier: Apache-2.0
// The tool in images and clouds of a robot whose description does not hold it: most sticks are home-made.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// A tool as sensors see it when nothing but its radius is known: a stick of this radius that ends at the tip. What is within
/// the radius, 3 mm and three standard deviations of the axis, from that far before the tip on, is on it or under it.
struct Stick {
  Vec3 tip_m = Vec3::Zero();     ///< base frame
  Vec3 inward = -Vec3::UnitZ();  ///< unit length, along the stick and into the object
  double radius_m = 0;
};

/// The points that are not on a stick.
/// @throws Error when sigma_m has neither one value nor one a point
PointCloud without_sticks(const PointCloud& cloud, const std::vector<Stick>& sticks);

/// 1 where a pixel shows a stick.
/// @throws Error as pixel_directions does
MaskImage mask_sticks(const DepthFrame& frame, const std::vector<Stick>& sticks);

}  // namespace palpate::sensing
