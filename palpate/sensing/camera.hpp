// SPDX-License-Identifier: Apache-2.0
// Pinhole camera: x right, y down, z forward; pixel centres at whole numbers, pixel = (column, row).
#pragma once

#include <Eigen/Core>
#include <optional>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// Throws when a camera cannot project.
/// @throws Error naming the field: no size, a focal length that is not positive, or a number of distortion coefficients that
///         does not belong to the model (none: 0; plumb_bob: 4 or 5; rational: 8; fisheye: 4).
void check(const Camera& camera);

/// Pixel of a point in the camera frame; nothing behind the camera (z <= 0), nor so far aside that the
/// lens has no image of it (beyond the fold of a polynomial). Distortion models, (x, y) = (X, Y) / Z:
///  - plumb_bob, rational: coefficients k1 k2 p1 p2 [k3 [k4 k5 k6]], the Brown-Conrady model with the ratio
///    (1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6) as radial factor, as OpenCV and ROS define them;
///  - fisheye: k1..k4, equidistant with theta_d = theta (1 + k1 t2 + k2 t4 + k3 t6 + k4 t8) (Kannala and Brandt 2006).
/// @param derivative  if given: 2 x 3, d pixel / d point
std::optional<Vec2> project(const Camera& camera, const Vec3& point_camera_m,
                            Eigen::Matrix<double, 2, 3>* derivative = nullptr);

/// Direction (z = 1, not unit length) that projects to a pixel; nothing where the distortion has no inverse there (beyond
/// the fold of a polynomial, or 90 degrees off the axis).
std::optional<Vec3> unproject(const Camera& camera, const Vec2& pixel);

/// `unproject` of every pixel centre, row-major: width * height x 3; rows are NaN where there is no inverse.
Points pixel_directions(const Camera& camera);

}  // namespace palpate::sensing
