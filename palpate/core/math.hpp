// SPDX-License-Identifier: Apache-2.0
// The array types that every room speaks: row-major, one point (or element) a row, so that they map to numpy without a copy.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

namespace palpate {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat3 = Eigen::Matrix3d;
using Pose = Eigen::Isometry3d;  ///< `T_a_b` maps coordinates of frame b into frame a
using Index = std::int32_t;
using VectorX = Eigen::VectorXd;
using MatrixX = Eigen::MatrixXd;

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;         ///< N x 3, metres
using Triangles = Eigen::Matrix<Index, Eigen::Dynamic, 3, Eigen::RowMajor>;       ///< counter-clockwise seen from outside
using Tetrahedra = Eigen::Matrix<Index, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;  ///< M x 4 or M x 10
using DepthImage = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;  ///< rows x cols, metres, 0 = no data
using MaskImage = Eigen::Matrix<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;  ///< 1 = invalid

}  // namespace palpate
