// SPDX-License-Identifier: Apache-2.0
// The plane through the depths around a pixel.
#pragma once

#include <limits>

#include "palpate/core/math.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/sensing/back_projection.hpp"
#include "palpate/sensing/depth_noise.hpp"

namespace palpate::sensing {

struct FittedPlane {
  Vec3 normal = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());  ///< camera frame, unit length, facing the camera
  double depth_m = std::numeric_limits<double>::quiet_NaN();               ///< at the pixel, along the optical axis
  bool found() const { return normal.allFinite() && depth_m > 0; }
};

struct FittedPlanes {
  FittedPlane with_pixel;
  /// Of its neighbours alone: what is chosen by it, a weight or whether a pixel stays, does not know the pixel's own noise. Where
  /// an outline cuts the window in half, a pixel that is too far tips the plane by itself and gets less weight for it, and those
  /// that are too near are left to pull: by 0.02 mm of 2.7, of which thousands of rays made half a standard deviation of nu.
  FittedPlane of_neighbours;
};

/// Of one image. All that it is given outlives it.
class PlaneFitter {
 public:
  /// @param invalid     pixels that belong to no plane: 1
  /// @param directions  pixel_directions of the frame's camera
  PlaneFitter(const DepthFrame& frame, const MaskImage& invalid, const BackProjectionOptions& options, const Points& directions);
  /// A plane is linear in inverse depth over the undistorted image: 1/z = a x + b y + c. None where too few neighbours are on the
  /// same surface.
  FittedPlanes at(int row, int column) const;

 private:
  double around_m(int row, int column) const;
  FittedPlane solved(const Mat3& normal_matrix, const Vec3& right_hand_side, int count, const Vec3& ray) const;

  const DepthFrame& frame_;
  const MaskImage& invalid_;
  const BackProjectionOptions& options_;
  const Points& directions_;
  DepthSigma sigma_;
};

}  // namespace palpate::sensing
