// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/camera.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::sensing {
namespace {

using Mat2 = Eigen::Matrix2d;

// Brown-Conrady with a rational radial factor; plumb_bob is the case k4 = k5 = k6 = 0.
Vec2 distort_brown(const std::vector<double>& given, const Vec2& p, Mat2* derivative) {
  std::array<double, 8> k{};
  for (std::size_t i = 0; i < given.size() && i < k.size(); ++i) k[i] = given[i];
  const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
  const double top = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double bottom = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
  const double radial = top / bottom;
  const Vec2 tangential(2 * k[2] * x * y + k[3] * (r2 + 2 * x * x), k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y);
  if (derivative) {
    const double d_top = k[0] + r2 * (2 * k[1] + 3 * r2 * k[4]);
    const double d_bottom = k[5] + r2 * (2 * k[6] + 3 * r2 * k[7]);
    const double d_radial = (d_top - radial * d_bottom) / bottom;  // by r2
    *derivative = radial * Mat2::Identity() + 2 * d_radial * p * p.transpose();
    (*derivative)(0, 0) += 2 * k[2] * y + 6 * k[3] * x;
    (*derivative)(0, 1) += 2 * k[2] * x + 2 * k[3] * y;
    (*derivative)(1, 0) += 2 * k[2] * x + 2 * k[3] * y;
    (*derivative)(1, 1) += 6 * k[2] * y + 2 * k[3] * x;
  }
  return radial * p + tangential;
}

double fisheye_angle(const std::vector<double>& k, double theta, double* derivative) {
  const double t2 = theta * theta;
  if (derivative) *derivative = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
  return theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

Vec2 distort_fisheye(const std::vector<double>& k, const Vec2& p, Mat2* derivative) {
  const double r = p.norm();
  if (r < 1e-9) {
    if (derivative) *derivative = Mat2::Identity();
    return p;
  }
  double slope = 0;
  const double bent = fisheye_angle(k, std::atan(r), &slope);
  if (derivative) {
    const Vec2 u = p / r;
    const double radial = slope / (1 + r * r), tangential = bent / r;
    *derivative = tangential * Mat2::Identity() + (radial - tangential) * u * u.transpose();
  }
  return bent / r * p;
}

Vec2 distort(const Camera& camera, const Vec2& p, Mat2* derivative) {
  switch (camera.distortion) {
    case DistortionModel::plumb_bob:
    case DistortionModel::rational:
      return distort_brown(camera.distortion_coefficients, p, derivative);
    case DistortionModel::fisheye:
      return distort_fisheye(camera.distortion_coefficients, p, derivative);
    case DistortionModel::none:
      break;
  }
  if (derivative) *derivative = Mat2::Identity();
  return p;
}

std::optional<Vec2> undistort_fisheye(const std::vector<double>& k, const Vec2& bent) {
  const double target = bent.norm();
  if (target < 1e-9) return bent;
  double theta = std::min(target, 1.5);
  for (int i = 0; i < 30; ++i) {
    double slope = 0;
    const double miss = fisheye_angle(k, theta, &slope) - target;
    if (slope <= 0) return std::nullopt;  // beyond the fold of the polynomial
    const double step = miss / slope;
    theta -= step;
    if (std::abs(step) < 1e-14) {
      if (theta < 0 || theta >= 0.5 * M_PI - 1e-6) return std::nullopt;
      return std::tan(theta) / target * bent;
    }
  }
  return std::nullopt;
}

// Newton from the distorted point; a step that does not come closer is halved, so that strong distortion converges too.
std::optional<Vec2> undistort_brown(const std::vector<double>& k, const Vec2& bent) {
  Vec2 p = bent;
  Mat2 slope;
  Vec2 miss = distort_brown(k, p, &slope) - bent;
  for (int i = 0; i < 50; ++i) {
    if (miss.norm() < 1e-14 * (1 + bent.norm())) break;
    // The physical branch is the one connected to the centre, where the map keeps its orientation.
    if (slope.determinant() <= 0) return std::nullopt;
    Vec2 step = -slope.inverse() * miss;
    int halvings = 0;
    for (; halvings < 30; ++halvings, step *= 0.5) {
      Mat2 next_slope;
      const Vec2 next_miss = distort_brown(k, p + step, &next_slope) - bent;
      if (next_miss.norm() < miss.norm()) {
        p += step;
        miss = next_miss;
        slope = next_slope;
        break;
      }
    }
    if (halvings == 30) break;
  }
  if (miss.norm() > 1e-11 * (1 + bent.norm()) || slope.determinant() <= 0) return std::nullopt;
  return p;
}

/// True for a point beyond the largest circle that the lens maps one to one: the polynomials turn back there, or leap over a pole,
/// and what is far out of view would be drawn inside the picture. Told by the way out to it.
bool beyond_fold(const Camera& camera, const Vec2& p) {
  constexpr int stations = 8;
  if (camera.distortion == DistortionModel::none || p.norm() < 1e-9) return false;
  const Vec2 outwards = p.normalized();
  const double angle = std::atan(p.norm());
  for (int i = 1; i <= stations; ++i) {
    Mat2 slope;
    const Vec2 bent = distort(camera, std::tan(angle * i / stations) * outwards, &slope);
    if (!(bent.dot(outwards) > 0) || !(outwards.dot(slope * outwards) > 0)) return true;
  }
  return false;
}

}  // namespace

void check(const Camera& camera) {
  if (camera.width_px <= 0 || camera.height_px <= 0)
    throw Error("must be positive: give the image's width and height in pixels", "camera.width_px, height_px");
  if (!(camera.fx_px > 0) || !(camera.fy_px > 0) || !std::isfinite(camera.fx_px) || !std::isfinite(camera.fy_px))
    throw Error("must be positive: give the focal length in pixels", "camera.fx_px, fy_px");
  if (!std::isfinite(camera.cx_px) || !std::isfinite(camera.cy_px))
    throw Error("must be finite: give the principal point in pixels", "camera.cx_px, cy_px");
  const std::size_t count = camera.distortion_coefficients.size();
  const auto wrong = [&](const std::string& expected) {
    throw Error("has " + std::to_string(count) + " numbers, the model needs " + expected, "camera.distortion_coefficients");
  };
  switch (camera.distortion) {
    case DistortionModel::none:
      if (count != 0) wrong("none (name a distortion model to use them)");
      break;
    case DistortionModel::plumb_bob:
      if (count != 4 && count != 5) wrong("4 or 5 (k1 k2 p1 p2 [k3])");
      break;
    case DistortionModel::rational:
      if (count != 8) wrong("8 (k1 k2 p1 p2 k3 k4 k5 k6)");
      break;
    case DistortionModel::fisheye:
      if (count != 4) wrong("4 (k1 k2 k3 k4)");
      break;
  }
  for (const double k : camera.distortion_coefficients)
    if (!std::isfinite(k)) throw Error("must be finite", "camera.distortion_coefficients");
}

std::optional<Vec2> project(const Camera& camera, const Vec3& point, Eigen::Matrix<double, 2, 3>* derivative) {
  if (!(point.z() > 0)) return std::nullopt;
  const Vec2 p = point.head<2>() / point.z();
  if (beyond_fold(camera, p)) return std::nullopt;
  Mat2 slope;
  const Vec2 bent = distort(camera, p, derivative ? &slope : nullptr);
  if (derivative) {
    Eigen::Matrix<double, 2, 3> perspective;
    perspective << 1, 0, -p.x(), 0, 1, -p.y();
    *derivative = Vec2(camera.fx_px, camera.fy_px).asDiagonal() * slope * perspective / point.z();
  }
  return Vec2(camera.fx_px * bent.x() + camera.cx_px, camera.fy_px * bent.y() + camera.cy_px);
}

std::optional<Vec3> unproject(const Camera& camera, const Vec2& pixel) {
  const Vec2 bent((pixel.x() - camera.cx_px) / camera.fx_px, (pixel.y() - camera.cy_px) / camera.fy_px);
  std::optional<Vec2> p = bent;
  if (camera.distortion == DistortionModel::plumb_bob || camera.distortion == DistortionModel::rational)
    p = undistort_brown(camera.distortion_coefficients, bent);
  else if (camera.distortion == DistortionModel::fisheye)
    p = undistort_fisheye(camera.distortion_coefficients, bent);
  if (!p || beyond_fold(camera, *p)) return std::nullopt;
  return Vec3(p->x(), p->y(), 1.0);
}

Points pixel_directions(const Camera& camera) {
  check(camera);
  Points directions(Eigen::Index(camera.width_px) * camera.height_px, 3);
  for (int row = 0; row < camera.height_px; ++row)
    for (int column = 0; column < camera.width_px; ++column) {
      const std::optional<Vec3> direction = unproject(camera, Vec2(column, row));
      directions.row(Eigen::Index(row) * camera.width_px + column) =
          direction ? *direction : Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
    }
  return directions;
}

}  // namespace palpate::sensing
