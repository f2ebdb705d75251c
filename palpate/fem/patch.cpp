// SPDX-License-Identifier: Apache-2.0
// Traction over a patch of the boundary, with consistent nodal forces.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <queue>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::fem {
namespace {

constexpr int kDepth = 8;  // a face that the rim crosses is halved this often along the rim: 1/256 of an edge

VectorX face_shape(Index nodes, const Vec3& l) {
  if (nodes == 3) return l;
  VectorX n(6);
  n << l(0) * (2 * l(0) - 1), l(1) * (2 * l(1) - 1), l(2) * (2 * l(2) - 1), 4 * l(0) * l(1), 4 * l(1) * l(2),
      4 * l(2) * l(0);
  return n;
}

class Patch {
 public:
  Patch(const TetMesh& mesh, const Tetrahedra& faces, const ContactPatch& where)
      : mesh_(mesh), faces_(faces), where_(where), radius_(where.radius_m) {}

  // Integral of the face's shape functions over the part of the face inside the patch.
  VectorX integrate(Index face) const {
    VectorX sum = VectorX::Zero(faces_.cols());
    add(face, Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ(), 0, sum);
    return sum;
  }

  Vec3 at(Index face, const Vec3& l) const {
    const VectorX n = face_shape(static_cast<Index>(faces_.cols()), l);
    Vec3 x = Vec3::Zero();
    for (Index k = 0; k < n.size(); ++k) x += n(k) * mesh_.nodes_m.row(faces_(face, k)).transpose();
    return x;
  }

  // Of the face's points to the middle of the patch.
  double distance(Index face) const {
    double best = std::numeric_limits<double>::infinity();
    const int n = 8;
    for (int i = 0; i <= n; ++i)
      for (int j = 0; i + j <= n; ++j) {
        const Vec3 l(1.0 - double(i + j) / n, double(i) / n, double(j) / n);
        best = std::min(best, where_.distance_m(at(face, l)));
      }
    return best;
  }

 private:
  void add(Index face, const Vec3& a, const Vec3& b, const Vec3& c, int depth, VectorX& sum) const {
    const Vec3 xa = at(face, a), xb = at(face, b), xc = at(face, c);
    const Vec3 middle = (xa + xb + xc) / 3;
    const double reach =
        std::sqrt(std::max({(xa - middle).squaredNorm(), (xb - middle).squaredNorm(), (xc - middle).squaredNorm()}));
    const double distance = where_.distance_m(middle);
    if (distance > radius_ + 1.1 * reach) return;
    // Under a punch the pressure rises towards the rim: only pieces that are far from it are taken whole.
    const bool inside = distance < radius_ - (where_.pressure == Pressure::punch ? 4.0 : 1.1) * reach;
    if (depth < kDepth && !(inside && depth >= (faces_.cols() == 6 ? 2 : 0))) {
      const Vec3 ab = 0.5 * (a + b), bc = 0.5 * (b + c), ca = 0.5 * (c + a);
      add(face, a, ab, ca, depth + 1, sum);
      add(face, ab, b, bc, depth + 1, sum);
      add(face, ca, bc, c, depth + 1, sum);
      add(face, ab, bc, ca, depth + 1, sum);
      return;
    }
    if (!inside && distance > radius_) return;
    // Three-point rule, exact for the quadratic shape functions of a flat face.
    const double area = 0.5 * (xb - xa).cross(xc - xa).norm();
    const Eigen::Index n = faces_.cols();
    for (const Vec3& l : {Vec3(0.5 * (a + b)), Vec3(0.5 * (b + c)), Vec3(0.5 * (c + a))})
      sum += area / 3 * pressure(where_.distance_m(at(face, l)), 0.5 * reach) * face_shape(static_cast<Index>(n), l);
  }
  // Relative, as a mean over a ring of this half width: under a flat rigid punch 1 / sqrt(1 - r^2 / a^2) (Boussinesq; Johnson,
  // Contact Mechanics, 3.36), which has no value at the rim but an integral.
  double pressure(double r, double half_width) const {
    if (where_.pressure == Pressure::uniform) return 1;
    const double a = radius_, inner = std::clamp(r - half_width, 0.0, a), outer = std::min(r + half_width, a);
    if (!(outer > inner)) return 0;
    const auto left = [&](double at) { return std::sqrt(std::max(0.0, 1 - at * at / (a * a))); };
    return 2 * a * a * (left(inner) - left(outer)) / (outer * outer - inner * inner);
  }

  const TetMesh& mesh_;
  const Tetrahedra& faces_;
  const ContactPatch& where_;
  double radius_;
};

}  // namespace

double ContactPatch::distance_m(const Vec3& x_m) const {
  const double length2 = half_length_m.squaredNorm();
  const double along = length2 > 0 ? std::clamp((x_m - centre_m).dot(half_length_m) / length2, -1.0, 1.0) : 0.0;
  return (x_m - centre_m - along * half_length_m).norm();
}

Eigen::SparseMatrix<double> spread_over_patch(const TetMesh& mesh, const Vec3& centre_m, double radius_m) {
  return spread_over_patch(mesh, ContactPatch{centre_m, radius_m, Vec3::Zero()});
}

Eigen::SparseMatrix<double> spread_over_patch(const TetMesh& mesh, const ContactPatch& where) {
  const double radius_m = where.radius_m;
  if (!(radius_m > 0)) throw Error("must be positive, is " + std::to_string(radius_m), "radius_m");
  const Tetrahedra faces = boundary_faces(mesh);
  const Patch patch(mesh, faces, where);
  const Index n = static_cast<Index>(mesh.nodes_m.rows());

  std::map<Index, VectorX> share;  // faces that the patch reaches
  Index nearest = -1;
  double nearest_distance = std::numeric_limits<double>::infinity();
  for (Index f = 0; f < faces.rows(); ++f) {
    const VectorX sum = patch.integrate(f);
    if (sum.cwiseAbs().sum() == 0) continue;
    share[f] = sum;
    const double distance = patch.distance(f);
    if (distance < nearest_distance) {
      nearest_distance = distance;
      nearest = f;
    }
  }
  if (nearest < 0)
    throw Error(fmt::format("no boundary face lies within {:.4g} m of the contact point ({:.5g}, {:.5g}, {:.5g}): is it in the mesh's frame?",
                            radius_m, where.centre_m.x(), where.centre_m.y(), where.centre_m.z()),
                "contact_m");

  // Walk over shared edges from the nearest face.
  std::map<std::pair<Index, Index>, std::vector<Index>> by_edge;
  for (const auto& [f, sum] : share)
    for (int k = 0; k < 3; ++k) by_edge[std::minmax(faces(f, k), faces(f, (k + 1) % 3))].push_back(f);
  std::map<Index, bool> reached{{nearest, true}};
  std::queue<Index> front;
  front.push(nearest);
  while (!front.empty()) {
    const Index f = front.front();
    front.pop();
    for (int k = 0; k < 3; ++k)
      for (Index other : by_edge[std::minmax(faces(f, k), faces(f, (k + 1) % 3))])
        if (!reached.count(other)) {
          reached[other] = true;
          front.push(other);
        }
  }

  VectorX weight = VectorX::Zero(n);
  for (const auto& [f, flag] : reached)
    for (Index k = 0; k < faces.cols(); ++k) weight(faces(f, k)) += share[f](k);
  const double area = weight.sum();
  std::vector<Eigen::Triplet<double>> triplets;
  for (Index i = 0; i < n; ++i)
    if (weight(i) != 0)
      for (int k = 0; k < 3; ++k) triplets.emplace_back(3 * i + k, k, weight(i) / area);
  Eigen::SparseMatrix<double> columns(3 * n, 3);
  columns.setFromTriplets(triplets.begin(), triplets.end());
  return columns;
}

}  // namespace palpate::fem
