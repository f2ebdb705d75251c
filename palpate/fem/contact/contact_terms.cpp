// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/contact/contact_terms.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/cross_matrix.hpp"

namespace palpate::fem {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The nearest positive semi-definite matrix.
void make_convex(Mat3& h) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(h);
  if (eigen.eigenvalues()(0) >= 0) return;
  h = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace

ContactTerms::ContactTerms(const TetMesh& mesh, const BlockPattern& pattern, int per_edge)
    : rest_m_(mesh.nodes_m), points_(mesh, pattern, per_edge) {}

void ContactTerms::set_regions(const std::vector<int>& region, const VectorX& stiffness) {
  region_.resize(static_cast<std::size_t>(points_.face_count()));
  harder_.resize(region_.size());
  for (Index f = 0; f < points_.face_count(); ++f) {
    region_[static_cast<std::size_t>(f)] = region[static_cast<std::size_t>(points_.element(f))];
    harder_[static_cast<std::size_t>(f)] = stiffness(region_[static_cast<std::size_t>(f)]);
  }
}

Vec3 ContactTerms::position(const VectorX& u, Index face, int point) const {
  Vec3 x = Vec3::Zero();
  for (int a = 0; a < points_.nodes_per_face(); ++a) {
    const Index node = points_.node(face, a);
    x += points_.shape(point)(a) * (rest_m_.row(node).transpose() + u.segment<3>(3 * node));
  }
  return x;
}

// visit(face, point, x, outward) for points near enough to be touched; outward() is the normal of the deformed surface.
template <typename Visit>
void ContactTerms::for_each_candidate(const TouchingBody& body, const VectorX& u, Visit&& visit) const {
  if (points_.nodes_per_face() == 6) for_each_candidate_of<6>(body, u, visit);
  else for_each_candidate_of<3>(body, u, visit);
}

template <int nodes, typename Visit>
void ContactTerms::for_each_candidate_of(const TouchingBody& body, const VectorX& u, Visit&& visit) const {
  const double reach = body.shape->bounding_radius_m();
  const Vec3 centre = body.T_base_tool * body.shape->bounding_centre_m();
  const Pose to_tool = body.T_base_tool.inverse();
  ShapePoint corner;
  Eigen::Matrix<double, 3, nodes> x;
  for (Index f = 0; f < points_.face_count(); ++f) {
    double nearest2 = kInfinity;
    for (int a = 0; a < nodes; ++a) {
      const Index node = points_.node(f, a);
      x.col(a) = rest_m_.row(node).transpose() + u.segment<3>(3 * node);
      nearest2 = std::min(nearest2, (x.col(a) - centre).squaredNorm());
    }
    double size2 = 0;
    for (int a = 1; a < nodes; ++a) size2 = std::max(size2, (x.col(a) - x.col(0)).squaredNorm());
    if (reach < kInfinity && std::sqrt(nearest2) > reach + std::sqrt(size2)) continue;
    if (reach == kInfinity) {  // a plane: faces that are farther from it than they are long
      double gap = kInfinity;
      for (int a = 0; a < nodes && gap > std::sqrt(size2); ++a) {
        if (body.shape->at(to_tool * x.col(a), points_.cell_m(f), corner)) gap = std::min(gap, corner.gap_m);
      }
      if (gap > std::sqrt(size2)) continue;
    }
    for (int p = 0; p < points_.per_face(); ++p) {
      const auto outward = [&] {
        const Eigen::Matrix<double, nodes, 2> along = points_.d_shape(p);
        const Eigen::Matrix<double, 3, 2> t = x * along;
        return Vec3(t.col(0).cross(t.col(1)));
      };
      const Eigen::Matrix<double, nodes, 1> share = points_.shape(p);
      visit(f, p, Vec3(x * share), outward);
    }
  }
}

bool ContactTerms::shape_at(const TouchingBody& body, Index face, int point, const Vec3& y, ShapePoint& out) const {
  if (!body.shape->at(y, points_.cell_m(face), out)) return false;
  if (body.seat_m != nullptr) out.gap_m -= (*body.seat_m)[static_cast<std::size_t>(face) * points_.per_face() + point];
  return true;
}

std::vector<double> ContactTerms::seats(const TouchingBody& body, double reach_m) const {
  std::vector<double> seat(static_cast<std::size_t>(points_.point_count()), 0);
  const VectorX rest = VectorX::Zero(3 * static_cast<Index>(rest_m_.rows()));
  ShapePoint shape;
  for_each_candidate(body, rest, [&](Index f, int p, const Vec3& x, const auto&) {
    if (!body.shape->at(body.T_base_tool.inverse() * x, points_.cell_m(f), shape) || shape.gap_m > reach_m) return;
    seat[static_cast<std::size_t>(f) * points_.per_face() + p] = shape.gap_m;
  });
  return seat;
}

template <typename Outward>
bool ContactTerms::sample(const TouchingBody& body, Index face, int point, const Vec3& y, const Outward& outward_of,
                          bool with_hessian, Sample& out) const {
  const double k = layer_pa_m(body, face);
  const std::size_t index = static_cast<std::size_t>(face) * points_.per_face() + point;
  if (body.law == Touch::bonded) {
    if (!body.memory->touching[index]) return false;
    const Vec3 s = y - body.memory->anchor_m[index];
    out.energy = 0.5 * k * s.squaredNorm();
    out.gradient = k * s;
    out.hessian = k * Mat3::Identity();
    out.gap = body.memory->normal[index].dot(s);
    out.pressure = -k * out.gap;
    return true;
  }
  ShapePoint shape;
  if (!shape_at(body, face, point, y, shape)) return false;
  if (!(shape.gap_m < 0) || !(shape.coverage > 0)) return false;
  // The far side of a thin object also lies inside a tool that was put deep; it faces away from what could touch it.
  const Vec3 outward = outward_of();
  if (outward.dot(body.T_base_tool.linear() * shape.normal) > 0.5 * outward.norm() * shape.normal.norm()) return false;
  const double g = shape.gap_m, chi = shape.coverage;
  const Vec3& n = shape.normal;
  out.gap = g;
  out.slips = false;
  out.pressure = -chi * k * g;
  out.energy = 0.5 * chi * k * g * g;
  out.gradient = k * (chi * g * n + 0.5 * g * g * shape.coverage_gradient);
  if (with_hessian)
    out.hessian = k * (chi * (n * n.transpose() + g * shape.curvature) +
                       g * (n * shape.coverage_gradient.transpose() + shape.coverage_gradient * n.transpose()) +
                       0.5 * g * g * shape.coverage_hessian);
  if (body.law == Touch::frictionless) return true;

  const double limit = body.memory->limit_pa[index];
  if (!(limit > 0)) return true;
  Vec3 normal = body.memory->normal[index];
  if (normal.squaredNorm() == 0) normal = n.normalized();
  const Mat3 across = Mat3::Identity() - normal * normal.transpose();
  const Vec3 s = across * (y - body.memory->anchor_m[index]);
  const double length = s.norm();
  if (k * length <= limit) {
    out.energy += 0.5 * k * length * length;
    out.gradient += k * s;
    if (with_hessian) out.hessian += k * across;
  } else {
    out.slips = true;
    out.energy += limit * (length - 0.5 * limit / k);
    out.gradient += limit / length * s;
    if (with_hessian) out.hessian += limit / length * (across - s * s.transpose() / (length * length));
  }
  return true;
}

template <typename Visit>
void ContactTerms::for_each_touching(const TouchingBody& body, const VectorX& u, Visit&& visit, bool with_hessian) const {
  const Mat3 back = body.T_base_tool.linear().transpose();
  const Vec3 tip = body.T_base_tool.translation();
  Sample s;
  for_each_candidate(body, u, [&](Index f, int p, const Vec3& x, const auto& outward) {
    const Vec3 y = back * (x - tip);
    if (sample(body, f, p, y, outward, with_hessian, s)) visit(f, p, x, outward, y, s);
  });
}

double ContactTerms::energy_and_forces(const TouchingBody& body, const VectorX& u, VectorX& forces, Vec6& gradient,
                                       double* rounding2_n2) const {
  const Mat3& r = body.T_base_tool.linear();
  // Interpolation, frame change and anchor round one after the other.
  constexpr double place = 3 * std::numeric_limits<double>::epsilon();
  const double tip_m = body.T_base_tool.translation().norm();
  double energy = 0;
  for_each_touching(body, u, [&](Index f, int p, const Vec3& x, const auto&, const Vec3&, const Sample& s) {
    const double weight = points_.weight_m2(f, p);
    const Vec3 force = weight * (r * s.gradient);
    energy += weight * s.energy;
    if (rounding2_n2 != nullptr) {
      const double lost_n = weight * layer_pa_m(body, f) * place * (x.norm() + tip_m);
      *rounding2_n2 += lost_n * lost_n;
    }
    for (int a = 0; a < points_.nodes_per_face(); ++a)
      forces.segment<3>(3 * points_.node(f, a)) += points_.shape(p)(a) * force;
    gradient.head<3>() -= force;
    gradient.tail<3>() -= (x - body.T_base_tool.translation()).cross(force);
  });
  return energy;
}

void ContactTerms::tangent(const TouchingBody& body, const VectorX& u, bool convex, BlockValues& blocks,
                           ToolTerms& tool) const {
  const Mat3& r = body.T_base_tool.linear();
  const int nodes = points_.nodes_per_face();
  tool = {};
  tool.coupling.setZero(u.size(), 6);
  for_each_touching(body, u, [&](Index f, int p, const Vec3& x, const auto&, const Vec3&, const Sample& s) {
    const double weight = points_.weight_m2(f, p);
    const Vec3 force = weight * (r * s.gradient), arm = x - body.T_base_tool.translation();
    Mat3 h = weight * (r * s.hessian * r.transpose());
    if (convex) make_convex(h);
    const Mat3 arm_cross = cross_matrix(arm), force_cross = cross_matrix(force);
    // df = rotation x f + h (dx - dtip - rotation x arm)
    Eigen::Matrix<double, 3, 6> to_twist;
    to_twist << -h, h * arm_cross - force_cross;
    for (int a = 0; a < nodes; ++a) {
      const double na = points_.shape(p)(a);
      tool.coupling.middleRows<3>(3 * points_.node(f, a)) += na * to_twist;
      for (int b = 0; b < nodes; ++b) {
        if (points_.node(f, a) < points_.node(f, b)) continue;  // h is symmetric: the lower block alone
        Eigen::Map<Mat3>(&blocks[9 * static_cast<std::size_t>(points_.block(f, a, b))]) += na * points_.shape(p)(b) * h;
      }
    }
    tool.gradient.head<3>() -= force;
    tool.gradient.tail<3>() -= arm.cross(force);
    tool.hessian.topRows<3>() -= to_twist;
    // d(arm x f) = -dtip x f + arm x df
    tool.hessian.bottomRows<3>() -= arm_cross * to_twist;
    tool.hessian.bottomLeftCorner<3, 3>() -= force_cross;
  }, true);
}

void ContactTerms::forces_by_region(const TouchingBody& body, const VectorX& u, MatrixX& forces, MatrixX& gradients) const {
  const Mat3& r = body.T_base_tool.linear();
  for_each_touching(body, u, [&](Index f, int p, const Vec3& x, const auto&, const Vec3&, const Sample& s) {
    const Index region = region_[static_cast<std::size_t>(f)];
    const Vec3 force = points_.weight_m2(f, p) * (r * s.gradient);
    for (int a = 0; a < points_.nodes_per_face(); ++a)
      forces.block<3, 1>(3 * points_.node(f, a), region) += points_.shape(p)(a) * force;
    gradients.col(region).head<3>() -= force;
    gradients.col(region).tail<3>() -= (x - body.T_base_tool.translation()).cross(force);
  });
}

void ContactTerms::d_radius(const TouchingBody& body, const VectorX& u, VectorX& forces, Vec6& gradient) const {
  const Mat3& r = body.T_base_tool.linear();
  ShapePoint shape;
  for_each_touching(body, u, [&](Index f, int p, const Vec3& x, const auto&, const Vec3& y, const Sample&) {
    if (body.law == Touch::bonded || !shape_at(body, f, p, y, shape)) return;
    const RadiusDerivative d = body.shape->d_radius(y, points_.cell_m(f));
    const double k = points_.weight_m2(f, p) * layer_pa_m(body, f), g = shape.gap_m;
    const Vec3 change = k * ((d.coverage * g + shape.coverage * d.gap) * shape.normal + shape.coverage * g * d.normal +
                       g * d.gap * shape.coverage_gradient + 0.5 * g * g * d.coverage_gradient);
    const Vec3 force = r * change;
    for (int a = 0; a < points_.nodes_per_face(); ++a)
      forces.segment<3>(3 * points_.node(f, a)) += points_.shape(p)(a) * force;
    gradient.head<3>() -= force;
    gradient.tail<3>() -= (x - body.T_base_tool.translation()).cross(force);
  });
}

std::vector<ContactTerms::Held> ContactTerms::held(const TouchingBody& body, const VectorX& u) const {
  std::vector<Held> out;
  if (body.law == Touch::frictionless) return out;
  ShapePoint shape;
  for_each_touching(body, u, [&](Index f, int p, const Vec3& x, const auto&, const Vec3& y, const Sample& s) {
    Held h;
    h.face = f;
    h.point = p;
    h.index = static_cast<std::size_t>(f) * points_.per_face() + p;
    h.weight_m2 = points_.weight_m2(f, p);
    h.stiffness_pa_m = layer_pa_m(body, f);
    h.arm_m = x - body.T_base_tool.translation();
    h.y_m = y;
    h.anchor_m = body.memory->anchor_m[h.index];
    if (body.law != Touch::bonded) {
      h.limit_pa = body.memory->limit_pa[h.index];
      if (!(h.limit_pa > 0)) return;
      shape_at(body, f, p, y, shape);
      h.normal = body.memory->normal[h.index];
      if (h.normal.squaredNorm() == 0) h.normal = shape.normal.normalized();
      const Vec3 offset = y - h.anchor_m, tangential = offset - h.normal.dot(offset) * h.normal;
      h.length_m = tangential.norm();
      if (h.length_m > 0) h.across = tangential / h.length_m;
      h.slips = s.slips;
      h.pressure_slope = -h.stiffness_pa_m * (shape.coverage * shape.normal + shape.gap_m * shape.coverage_gradient);
      if (body.shape->has_radius()) {
        const RadiusDerivative d = body.shape->d_radius(y, points_.cell_m(f));
        h.pressure_d_radius = -h.stiffness_pa_m * (d.coverage * shape.gap_m + shape.coverage * d.gap);
      }
    }
    out.push_back(h);
  });
  return out;
}

Mat3 ContactTerms::normal_slope(const TouchingBody& body, Index face, const Vec3& y) const {
  ShapePoint shape;
  if (!body.shape->at(y, points_.cell_m(face), shape)) return Mat3::Zero();
  const double length = shape.normal.norm();
  const Vec3 n = shape.normal / length;
  return (shape.curvature - n * (n.transpose() * shape.curvature)) / length;
}

Vec3 ContactTerms::normal_d_radius(const TouchingBody& body, Index face, const Vec3& y) const {
  ShapePoint shape;
  if (!body.shape->has_radius() || !body.shape->at(y, points_.cell_m(face), shape)) return Vec3::Zero();
  return body.shape->d_radius(y, points_.cell_m(face)).normal;
}

TouchMemory ContactTerms::bond(const TouchingBody& body, const VectorX& u, double reach_m) const {
  TouchMemory memory;
  memory.anchor_m.assign(points_.point_count(), Vec3::Zero());
  memory.normal.assign(points_.point_count(), Vec3::Zero());
  memory.touching.assign(points_.point_count(), 0);
  ShapePoint shape;
  for_each_candidate(body, u, [&](Index f, int p, const Vec3& x, const auto&) {
    const Vec3 y = body.T_base_tool.inverse() * x;
    if (!body.shape->at(y, points_.cell_m(f), shape) || std::abs(shape.gap_m) > reach_m || shape.coverage < 0.5) return;
    const std::size_t index = static_cast<std::size_t>(f) * points_.per_face() + p;
    memory.anchor_m[index] = y;
    memory.normal[index] = shape.normal;
    memory.touching[index] = 1;
  });
  return memory;
}

void ContactTerms::begin_increment(const TouchingBody& body, const VectorX& u, TouchMemory& memory) const {
  if (body.law == Touch::frictionless || body.law == Touch::bonded) return;
  const auto count = static_cast<std::size_t>(points_.point_count());
  memory.anchor_m.resize(count, Vec3::Zero());
  memory.normal.resize(count, Vec3::Zero());
  memory.limit_pa.resize(count, 0);
  memory.touching.resize(count, 0);
  const Pose T_tool_base = body.T_base_tool.inverse();
  ShapePoint shape;
  for (Index f = 0; f < points_.face_count(); ++f)
    for (int p = 0; p < points_.per_face(); ++p) {
      const std::size_t index = static_cast<std::size_t>(f) * points_.per_face() + p;
      if (memory.touching[index]) continue;
      memory.anchor_m[index] = T_tool_base * position(u, f, p);
      const bool known = body.shape->at(memory.anchor_m[index], points_.cell_m(f), shape);
      memory.normal[index] = known ? Vec3(shape.normal.normalized()) : Vec3::Zero();
    }
}

double ContactTerms::update_limits(const TouchingBody& body, const VectorX& u, double friction, TouchMemory& memory) const {
  if (body.law == Touch::frictionless || body.law == Touch::bonded) return 0;
  std::vector<double> limit(memory.limit_pa.size(), 0);
  for_each_touching(body, u, [&](Index f, int p, const Vec3&, const auto&, const Vec3&, const Sample& s) {
    limit[static_cast<std::size_t>(f) * points_.per_face() + p] =
        body.law == Touch::sticking ? kInfinity : friction * s.pressure;
  });
  double change = 0;
  for (Index f = 0; f < points_.face_count(); ++f)
    for (int p = 0; p < points_.per_face(); ++p) {
      const std::size_t index = static_cast<std::size_t>(f) * points_.per_face() + p;
      if (limit[index] == memory.limit_pa[index]) continue;
      change += body.law == Touch::sticking ? 1 : points_.weight_m2(f, p) * std::abs(limit[index] - memory.limit_pa[index]);
    }
  memory.limit_pa = std::move(limit);
  return change;
}

void ContactTerms::end_increment(const TouchingBody& body, const VectorX& u, TouchMemory& memory) const {
  if (body.law == Touch::frictionless || body.law == Touch::bonded) return;
  std::fill(memory.touching.begin(), memory.touching.end(), 0);
  for_each_touching(body, u, [&](Index f, int p, const Vec3&, const auto&, const Vec3& y, const Sample& sample) {
    const std::size_t index = static_cast<std::size_t>(f) * points_.per_face() + p;
    memory.touching[index] = sample.slips ? 2 : 1;
    ShapePoint shape;
    body.shape->at(y, points_.cell_m(f), shape);
    if (memory.normal[index].squaredNorm() == 0) memory.normal[index] = shape.normal.normalized();
    if (!sample.slips) return;
    const Vec3 offset = y - memory.anchor_m[index];
    const Vec3 s = offset - memory.normal[index].dot(offset) * memory.normal[index];
    const double k = layer_pa_m(body, f);
    memory.normal[index] = shape.normal.normalized();
    memory.anchor_m[index] = y - memory.limit_pa[index] / (k * s.norm()) * s;
  });
}

ContactTerms::Patch ContactTerms::patch(const TouchingBody& body, const VectorX& u) const {
  std::vector<Vec3> where;
  std::vector<double> pressure, area;
  Patch out;
  for_each_touching(body, u, [&](Index f, int p, const Vec3& x, const auto& outward, const Vec3&, const Sample& s) {
    where.push_back(x);
    pressure.push_back(s.pressure);
    area.push_back(0.5 * outward().norm() / points_.per_face());
    out.layer_energy_j -= 0.5 * points_.weight_m2(f, p) * s.pressure * s.gap;
    out.penetration_m = std::max(out.penetration_m, -s.gap);
    if (body.memory && !body.memory->touching.empty())
      out.slipping += body.memory->touching[static_cast<std::size_t>(f) * points_.per_face() + p] == 2 ? 1 : 0;
  });
  const auto count = static_cast<Index>(where.size());
  out.points_m.resize(count, 3);
  for (Index i = 0; i < count; ++i) out.points_m.row(i) = where[i].transpose();
  out.pressure_pa = Eigen::Map<const VectorX>(pressure.data(), count);
  out.area_m2 = Eigen::Map<const VectorX>(area.data(), count);
  return out;
}

}  // namespace palpate::fem
