// SPDX-License-Identifier: Apache-2.0
#include "python/poses.hpp"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <numbers>

namespace palpate::python {
namespace {

/// By the rule of files (palpate/io/recording_read_object.cpp), so that one recording is the same from both.
/// @param what  before the reason, for the message
Mat3 nearest_rotation(const Mat3& given, const Place& place, const std::string& what) {
  constexpr double few_digits = 1e-2;
  if (!given.allFinite()) place.refuse(what + "it holds NaN or infinity");
  const double off = (given.transpose() * given - Mat3::Identity()).norm();
  if (off > few_digits)
    place.refuse(fmt::format("{}R^T R of its 3 x 3 part R is off from the unit matrix by {:.2g}; up to {:g} passes for few digits, and the nearest rotation is taken",
                             what, off, few_digits));
  if (given.determinant() < 0) place.refuse(what + "its 3 x 3 part mirrors (the determinant is -1); an axis points the wrong way, or two are swapped");
  const Eigen::JacobiSVD<Mat3> svd(given, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Mat3 exact = svd.matrixU() * svd.matrixV().transpose();
  return (exact - given).norm() < 1e-12 ? given : exact;  // what is exact already keeps its digits
}

template <typename Vector>
Vector finite(const py::object& given, const Place& place) {
  const Vector numbers = from_python<Vector>(given, place);
  if (!numbers.allFinite()) place.refuse("holds NaN or infinity");
  return numbers;
}

Mat3 rotation_of_quaternion(const py::object& given) {
  const Place place("quaternion_xyzw");
  const auto q = finite<Eigen::Vector4d>(given, place);
  const double length = q.stableNorm();
  constexpr double nothing = 1e-9;
  if (!(length > nothing)) place.refuse("has no length, which is no rotation; [0, 0, 0, 1] turns nothing");
  return Eigen::Quaterniond(q[3] / length, q[0] / length, q[1] / length, q[2] / length).normalized().toRotationMatrix();
}

Mat3 rotation_of_vector(const py::object& given) {
  const Place place("rotation_vector_rad");
  const auto vector = finite<Vec3>(given, place);
  const double angle = vector.stableNorm();
  constexpr double whole_turn = 2 * std::numbers::pi, rounding = 1e-6;
  if (angle > whole_turn + rounding)
    place.refuse(fmt::format("turns by {:.4g} rad, more than a whole turn; is it in degrees? Its length is the angle, in radians", angle));
  if (angle == 0) return Mat3::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

}  // namespace

Pose rigid_pose(const Eigen::Matrix4d& matrix, const Place& place) {
  const std::string what = "must be a rigid transform (a rotation, a translation in metres, and 0 0 0 1 in the last row): ";
  constexpr double rounding = 1e-6;
  const Eigen::RowVector4d last = matrix.row(3);
  if (!matrix.allFinite()) place.refuse(what + "it holds NaN or infinity");
  if ((last - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() > rounding)
    place.refuse(fmt::format("{}its last row is {:g} {:g} {:g} {:g}; the translation is the last column", what, last[0], last[1], last[2], last[3]));
  Pose pose = Pose::Identity();
  pose.linear() = nearest_rotation(matrix.topLeftCorner<3, 3>(), place, what);
  pose.translation() = matrix.topRightCorner<3, 1>();
  return pose;
}

py::object pose_of(const py::object& position_m, const py::object& quaternion_xyzw, const py::object& rotation_vector_rad, const py::object& rotation) {
  const int given = int{!quaternion_xyzw.is_none()} + int{!rotation_vector_rad.is_none()} + int{!rotation.is_none()};
  if (given > 1) throw Error("say the rotation once: one of quaternion_xyzw, rotation_vector_rad and rotation, or none of them where nothing is turned", "pose");
  Pose pose = Pose::Identity();
  pose.translation() = finite<Vec3>(position_m, Place("position_m"));
  if (!quaternion_xyzw.is_none()) pose.linear() = rotation_of_quaternion(quaternion_xyzw);
  if (!rotation_vector_rad.is_none()) pose.linear() = rotation_of_vector(rotation_vector_rad);
  if (!rotation.is_none()) pose.linear() = nearest_rotation(from_python<Mat3>(rotation, Place("rotation")), Place("rotation"), "must be a rotation: ");
  return to_python(pose);
}

}  // namespace palpate::python
