// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/held_body.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::estimation {
namespace {

double diagonal_m(const TetMesh& mesh) {
  return (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).norm();
}

/// Directions held at each node, orthonormal, in the order in which they were asked for.
class Holds {
 public:
  void add(Index node, const Vec3& direction) {
    auto& held = directions_[node];
    Vec3 rest = direction;
    for (const auto& axis : held) rest -= axis.dot(rest) * axis;
    if (rest.norm() > 1e-6) held.push_back(rest.normalized());
  }
  void clamp(Index node) {
    for (int d = 0; d < 3; ++d) add(node, Vec3::Unit(d));
  }
  /// What carries loads without being a constraint.
  void carry(Index node, const Vec3& direction) { carried_.emplace_back(node, direction); }
  const std::vector<std::pair<Index, Vec3>>& carried() const { return carried_; }
  const std::map<Index, std::vector<Vec3>>& directions() const { return directions_; }

  std::vector<fem::Constraint> constraints() const {
    std::vector<fem::Constraint> list;
    for (const auto& [node, held] : directions_) {
      fem::Constraint constraint;
      constraint.node = node;
      constraint.count = static_cast<int>(held.size());
      for (int c = 0; c < constraint.count; ++c) constraint.axes.col(c) = held[static_cast<std::size_t>(c)];
      complete(constraint.axes, constraint.count);
      list.push_back(constraint);
    }
    return list;
  }

 private:
  static void complete(Mat3& axes, int count) {
    if (count == 1) axes.col(1) = axes.col(0).unitOrthogonal();
    if (count <= 2) axes.col(2) = axes.col(0).cross(axes.col(1));
  }
  std::map<Index, std::vector<Vec3>> directions_;
  std::vector<std::pair<Index, Vec3>> carried_;
};

/// Displacement of a node under the six rigid motions (translations, rotations about the centre in units of `length`).
Eigen::Matrix<double, 3, 6> rigid_motions(const Vec3& arm, double length) {
  Eigen::Matrix<double, 3, 6> m;
  m.leftCols<3>().setIdentity();
  m.rightCols<3>() << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0;
  m.rightCols<3>() /= length;
  return m;
}

MatrixX null_space(const MatrixX& rows) {
  if (rows.rows() == 0) return MatrixX::Identity(6, 6);
  const Eigen::JacobiSVD<MatrixX> svd(rows.transpose() * rows, Eigen::ComputeFullV);
  const auto& values = svd.singularValues();
  int rank = 0;
  while (rank < 6 && values(rank) > 1e-10 * std::max(values(0), 1.0)) ++rank;
  return svd.matrixV().rightCols(6 - rank);
}

/// Of the span of orthonormal columns the basis that is nearest to the axes, whatever basis it was given in: a slide then means the
/// same on every mesh.
MatrixX along_axes(const MatrixX& span) {
  MatrixX left = span * span.transpose(), basis(span.rows(), 0);
  for (Index k = 0; k < span.cols(); ++k) {
    Index longest = 0;
    for (Index i = 1; i < left.cols(); ++i)
      if (left.col(i).norm() > left.col(longest).norm() * (1 + 1e-6)) longest = i;
    basis.conservativeResize(span.rows(), k + 1);
    basis.col(k) = left.col(longest).normalized();
    left -= basis.col(k) * (basis.col(k).transpose() * left);
  }
  return basis;
}

/// Pins the motions that are left at single nodes: as many directions as motions, so that no stress can arise from them.
MatrixX pin_free_motions(const TetMesh& mesh, Holds& holds) {
  const Vec3 centre = mesh.nodes_m.colwise().mean();
  const double length = diagonal_m(mesh);
  std::size_t count = holds.carried().size();
  for (const auto& [node, held] : holds.directions()) count += held.size();
  MatrixX rows(static_cast<Index>(count), 6);  // at once: row by row all of them would be copied for each
  Index next = 0;
  const auto put = [&](Index node, const Vec3& direction) {
    rows.row(next++) = direction.transpose() * rigid_motions(mesh.nodes_m.row(node).transpose() - centre, length);
  };
  for (const auto& [node, held] : holds.directions()) {
    for (const auto& direction : held) put(node, direction);
  }
  for (const auto& [node, direction] : holds.carried()) put(node, direction);
  const MatrixX free = along_axes(null_space(rows));
  if (free.cols() == 0) return MatrixX(3 * mesh.nodes_m.rows(), 0);

  MatrixX left = free;
  while (left.cols() > 0) {
    Index best_node = -1;
    Vec3 best_motion = Vec3::Zero();
    for (Index node = 0; node < mesh.nodes_m.rows(); ++node) {
      Vec3 motion = rigid_motions(mesh.nodes_m.row(node).transpose() - centre, length) * left.col(0);
      if (const auto held = holds.directions().find(node); held != holds.directions().end()) {
        for (const auto& axis : held->second) motion -= axis.dot(motion) * axis;
      }
      if (motion.norm() > best_motion.norm() * (1 + 1e-9)) {
        best_motion = motion;
        best_node = node;
      }
    }
    holds.add(best_node, best_motion.normalized());
    rows.conservativeResize(next + 1, 6);
    put(best_node, best_motion.normalized());
    left = null_space(rows);
  }

  MatrixX motions(3 * mesh.nodes_m.rows(), free.cols());
  for (Index node = 0; node < mesh.nodes_m.rows(); ++node) {
    motions.middleRows<3>(3 * node) = rigid_motions(mesh.nodes_m.row(node).transpose() - centre, length) * free;
  }
  return motions;
}

std::vector<Index> platen_nodes(const TetMesh& mesh, const Tool& platen) {
  const double tolerance = std::max(1e-6, 1e-4 * diagonal_m(mesh));
  std::vector<Index> nodes;
  for (Index node = 0; node < mesh.nodes_m.rows(); ++node) {
    if (std::abs(platen.plane.normal.dot(mesh.nodes_m.row(node).transpose() - platen.plane.point_m)) < tolerance) {
      nodes.push_back(node);
    }
  }
  if (nodes.empty()) {
    throw Error("the platen's plane touches no node of the object; give a point of its face where it first touches",
                "tools." + platen.name + ".plane");
  }
  return nodes;
}

struct Rim {
  Vec3 centre_m, normal;
  double radius_m = 0;  // 0: the nodes are no flat patch
};
Rim rim_of(const TetMesh& mesh, const std::vector<Index>& nodes) {
  Rim rim;
  rim.centre_m.setZero();
  for (Index node : nodes) rim.centre_m += mesh.nodes_m.row(node).transpose() / static_cast<double>(nodes.size());
  Mat3 scatter = Mat3::Zero();
  double radius_m = 0;
  for (Index node : nodes) {
    const Vec3 arm = mesh.nodes_m.row(node).transpose() - rim.centre_m;
    scatter += arm * arm.transpose() / static_cast<double>(nodes.size());
    radius_m = std::max(radius_m, arm.norm());
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(scatter);
  rim.normal = axes.eigenvectors().col(0);
  const Vec3 spread = axes.eigenvalues();  // ascending
  const bool flat = spread(0) < 1e-3 * spread(2);
  const bool wide = spread(1) > 1e-2 * spread(2);
  if (flat && wide) rim.radius_m = radius_m;
  return rim;
}

}  // namespace

double rim_radius_m(const TetMesh& mesh, const Support& support) {
  return rim_of(mesh, fem::support_nodes(mesh, support)).radius_m;
}

bool spreads(const Support& support) { return support.contact == ContactLaw::bonded && support.spread_std_m > 0; }

bool lifts_off(const Support& support) {
  const bool half_space = support.kind == SupportKind::table || support.kind == SupportKind::wall;
  return half_space && support.contact != ContactLaw::bonded;
}

std::vector<Support> held_both_ways(std::vector<Support> supports) {
  for (Support& support : supports) {
    if (lifts_off(support)) support.kind = SupportKind::plane;
    if (support.contact == ContactLaw::friction) support.contact = ContactLaw::bonded;
  }
  return supports;
}

HeldBody hold(const TetMesh& mesh, const std::vector<Support>& supports, const std::vector<const Tool*>& platens) {
  // Of the layer of a table: twenty times stiffer than under a tool, where a rim may run through faces.
  constexpr double table_stiffness = 1000;
  Holds holds;
  HeldBody body;
  for (const Support& support : supports) {
    const auto nodes = fem::support_nodes(mesh, support);
    const Vec3 normal = support.plane.normal.normalized();
    if (lifts_off(support)) {
      fem::RigidContact contact;
      contact.name = support.name;
      contact.shape = fem::plane_shape();
      contact.T_base_tool = fem::tool_pose(support.plane.point_m, normal);
      contact.seat_m = support.tolerance_m;
      contact.stiffness = table_stiffness;
      const bool rough = support.contact == ContactLaw::friction;
      contact.law = rough ? fem::Touch::friction : fem::Touch::frictionless;
      contact.friction_coefficient = support.friction_coefficient;
      body.contacts.push_back(contact);
      for (Index node : nodes) {
        if (!rough) holds.carry(node, normal);
        for (int d = 0; rough && d < 3; ++d) holds.carry(node, Vec3::Unit(d));
      }
      continue;
    }
    if (support.contact == ContactLaw::friction) {
      throw Error("friction needs a surface to slide on: give the support as a table or a wall, or hold its nodes bonded or frictionless",
                  "supports." + support.name + ".contact friction");
    }
    for (Index node : nodes) {
      if (support.contact == ContactLaw::bonded) {
        holds.clamp(node);
      } else {
        holds.add(node, normal);
      }
    }
  }

  std::vector<Eigen::Triplet<double>> motion;
  for (std::size_t p = 0; p < platens.size(); ++p) {
    const Vec3 direction = platens[p]->plane.normal.normalized();
    for (Index node : platen_nodes(mesh, *platens[p])) {
      holds.add(node, direction);
      if (platens[p]->contact == ContactLaw::bonded) holds.clamp(node);
      for (int d = 0; d < 3; ++d) {
        if (direction(d) != 0) motion.emplace_back(3 * node + d, static_cast<int>(p), direction(d));
      }
    }
  }

  int columns = static_cast<int>(platens.size());
  for (const Support& support : supports) {
    if (!spreads(support)) continue;
    const auto nodes = fem::support_nodes(mesh, support);
    const Rim rim = rim_of(mesh, nodes);
    if (!(rim.radius_m > 0))
      throw Error("the held nodes are not flat, so no rim of theirs can slide; leave spread_std_m out",
                  "supports." + support.name + ".spread_std_m");
    for (Index node : nodes) {
      Vec3 outwards = (mesh.nodes_m.row(node).transpose() - rim.centre_m) / rim.radius_m;
      outwards -= rim.normal.dot(outwards) * rim.normal;
      for (int d = 0; d < 3; ++d) motion.emplace_back(3 * node + d, columns, outwards(d));
    }
    ++columns;
  }

  body.free_motions = pin_free_motions(mesh, holds);
  body.constraints = holds.constraints();
  body.motions.resize(3 * mesh.nodes_m.rows(), columns);
  body.motions.setFromTriplets(motion.begin(), motion.end());
  return body;
}

}  // namespace palpate::estimation
