// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/contact/rigid_shape.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"

namespace palpate::fem {
namespace {

// Stiffness share of a point at distance s from a rim (negative inside): fades over the last cell inside the rim, so that
// points enter and leave smoothly, and twice differentiably, as a rim moves over them. It ends at the rim itself, because
// beyond it the free surface bulges up past the face, and a layer is stiff however small its share.
struct Step {
  double value = 0, slope = 0, bend = 0;
};
Step covered(double s, double width) {
  const double t = -s / width;
  if (t >= 1) return {1, 0, 0};
  if (t <= 0) return {};
  return {t * t * t * (10 + t * (6 * t - 15)), -30 * t * t * (1 - t) * (1 - t) / width,
          60 * t * (1 - t) * (1 - 2 * t) / (width * width)};
}

class PlaneShape final : public RigidShape {
 public:
  bool at(const Vec3& y, double, ShapePoint& out) const override {
    out = {};
    out.gap_m = y.z();
    out.normal = Vec3::UnitZ();
    return true;
  }
  double bounding_radius_m() const override { return std::numeric_limits<double>::infinity(); }
};

// Sphere (length 0) and capsule.
class RoundShape final : public RigidShape {
 public:
  RoundShape(double radius, double length) : radius_(radius), length_(length) {}
  bool at(const Vec3& y, double, ShapePoint& out) const override {
    const double along = std::clamp(y.x(), -0.5 * length_, 0.5 * length_);
    const Vec3 arm = y - Vec3(along, 0, -radius_);
    const double distance = arm.norm();
    if (!(distance > 1e-3 * radius_)) return false;  // on the axis there is no direction to push to
    out = {};
    out.gap_m = distance - radius_;
    out.normal = arm / distance;
    Mat3 across = Mat3::Identity();
    if (std::abs(y.x()) < 0.5 * length_) across(0, 0) = 0;
    out.curvature = (across - out.normal * out.normal.transpose()) / distance;
    return true;
  }
  bool has_radius() const override { return true; }
  RadiusDerivative d_radius(const Vec3& y, double cell) const override {
    ShapePoint p;
    RadiusDerivative d;
    if (!at(y, cell, p)) return d;
    d.gap = p.normal.z() - 1;  // the centre moves back by as much
    d.normal = p.curvature.col(2);
    return d;
  }
  double bounding_radius_m() const override { return radius_ + 0.5 * length_; }
  Vec3 bounding_centre_m() const override { return {0, 0, -radius_}; }

 private:
  double radius_, length_;
};

class DiscShape final : public RigidShape {
 public:
  explicit DiscShape(double radius) : radius_(radius) {}
  bool at(const Vec3& y, double cell, ShapePoint& out) const override {
    const double rho2 = y.head<2>().squaredNorm();
    if (rho2 >= radius_ * radius_ || y.z() < -2 * radius_) return false;  // asked of every point of the skin, so quickly
    const double rho = std::sqrt(rho2);
    const Step step = covered(rho - radius_, std::min(cell, 0.5 * radius_));
    if (step.value <= 0) return false;
    out = {};
    out.gap_m = y.z();
    out.normal = Vec3::UnitZ();
    out.coverage = step.value;
    if (step.slope != 0) {
      const Vec3 e(y.x() / rho, y.y() / rho, 0);
      out.coverage_gradient = step.slope * e;
      Mat3 around = Mat3::Identity() - e * e.transpose();
      around(2, 2) = 0;
      out.coverage_hessian = step.bend * e * e.transpose() + step.slope / rho * around;
    }
    return true;
  }
  bool has_radius() const override { return true; }
  RadiusDerivative d_radius(const Vec3& y, double cell) const override {
    const double rho = y.head<2>().norm();
    const Step step = covered(rho - radius_, std::min(cell, 0.5 * radius_));
    RadiusDerivative d;
    d.coverage = -step.slope;
    if (step.slope != 0) d.coverage_gradient = -step.bend * Vec3(y.x() / rho, y.y() / rho, 0);
    return d;
  }
  double bounding_radius_m() const override { return 2.5 * radius_; }

 private:
  double radius_;
};

class EdgeShape final : public RigidShape {
 public:
  EdgeShape(double half_width, double length) : half_width_(half_width), half_length_(0.5 * length) {}
  bool at(const Vec3& y, double cell, ShapePoint& out) const override {
    const Step x = covered(std::abs(y.x()) - half_length_, std::min(cell, 0.5 * half_length_)),
               w = covered(std::abs(y.y()) - half_width_, std::min(cell, 0.5 * half_width_));
    if (x.value * w.value <= 0 || y.z() < -2 * half_length_) return false;
    const double sx = y.x() < 0 ? -1 : 1, sy = y.y() < 0 ? -1 : 1;
    out = {};
    out.gap_m = y.z();
    out.normal = Vec3::UnitZ();
    out.coverage = x.value * w.value;
    out.coverage_gradient = Vec3(sx * x.slope * w.value, sy * x.value * w.slope, 0);
    out.coverage_hessian(0, 0) = x.bend * w.value;
    out.coverage_hessian(1, 1) = x.value * w.bend;
    out.coverage_hessian(0, 1) = out.coverage_hessian(1, 0) = sx * sy * x.slope * w.slope;
    return true;
  }
  bool has_radius() const override { return true; }
  RadiusDerivative d_radius(const Vec3& y, double cell) const override {
    const Step x = covered(std::abs(y.x()) - half_length_, std::min(cell, 0.5 * half_length_)),
               w = covered(std::abs(y.y()) - half_width_, std::min(cell, 0.5 * half_width_));
    RadiusDerivative d;
    d.coverage = -x.value * w.slope;
    d.coverage_gradient = -Vec3((y.x() < 0 ? -1 : 1) * x.slope * w.slope, (y.y() < 0 ? -1 : 1) * x.value * w.bend, 0);
    return d;
  }
  double bounding_radius_m() const override { return 2.5 * half_length_ + 2 * half_width_; }

 private:
  double half_width_, half_length_;
};

void need_positive(double value, const char* name) {
  if (!(value > 0)) throw Error("must be positive, is " + std::to_string(value), name);
}

}  // namespace

RadiusDerivative RigidShape::d_radius(const Vec3&, double) const { throw Error("has no radius", "RigidShape"); }

RigidShapePtr plane_shape() { return std::make_shared<PlaneShape>(); }
RigidShapePtr sphere_shape(double radius_m) {
  need_positive(radius_m, "sphere.radius_m");
  return std::make_shared<RoundShape>(radius_m, 0);
}
RigidShapePtr capsule_shape(double radius_m, double length_m) {
  need_positive(radius_m, "capsule.radius_m");
  need_positive(length_m, "capsule.length_m");
  return std::make_shared<RoundShape>(radius_m, length_m);
}
RigidShapePtr disc_shape(double radius_m) {
  need_positive(radius_m, "disc.radius_m");
  return std::make_shared<DiscShape>(radius_m);
}
RigidShapePtr edge_shape(double half_width_m, double length_m) {
  need_positive(half_width_m, "edge.radius_m");
  need_positive(length_m, "edge.length_m");
  return std::make_shared<EdgeShape>(half_width_m, length_m);
}

RigidShapePtr shape_of(const Tool& tool) {
  switch (tool.shape) {
    case ToolShape::sphere:
      return sphere_shape(tool.radius_m);
    case ToolShape::disc:
      return disc_shape(tool.radius_m);
    case ToolShape::capsule:
      return capsule_shape(tool.radius_m, tool.length_m);
    case ToolShape::edge:
      return edge_shape(tool.radius_m, tool.length_m);
    case ToolShape::platen:
      return plane_shape();
    case ToolShape::mesh:
      if (!tool.mesh) throw Error("needs its mesh", "tools." + tool.name + ".mesh");
      return mesh_shape(*tool.mesh);
    case ToolShape::vertices:
      break;
  }
  throw Error("names nodes, not a surface: contact search needs a sphere, disc, capsule, edge, mesh or platen",
              "tools." + tool.name + ".shape");
}

Pose tool_pose(const Vec3& tip_m, const Vec3& direction, const Vec3& axis) {
  if (!(direction.norm() > 0)) throw Error("has no length", "direction");
  const Vec3 z = direction.normalized();
  Vec3 x = axis - axis.dot(z) * z;
  x = x.norm() > 1e-6 * axis.norm() && axis.norm() > 0 ? Vec3(x.normalized()) : z.unitOrthogonal();
  Pose pose = Pose::Identity();
  pose.linear() << x, z.cross(x), z;
  pose.translation() = tip_m;
  return pose;
}

}  // namespace palpate::fem
