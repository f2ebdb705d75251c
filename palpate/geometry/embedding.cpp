// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/embedding.hpp"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/geometry/bvh.hpp"
#include "palpate/geometry/triangle_distance.hpp"

namespace palpate::geometry {
namespace {

struct Element {
  Vec3 origin;
  Mat3 edges, inverse;  ///< columns x1 - x0, ...
  bool usable = false;

  Eigen::Vector4d weights(const Vec3& p) const {
    Vec3 w = inverse * (p - origin);
    w += inverse * (p - origin - edges * w);  // one refinement: exact to rounding for flat elements as well
    return {1 - w.sum(), w.x(), w.y(), w.z()};
  }

  double squared_distance(const Vec3& p, const Eigen::Vector4d& w) const {
    if (w.minCoeff() >= 0) return 0;
    const std::array<Vec3, 4> x{origin, origin + edges.col(0), origin + edges.col(1), origin + edges.col(2)};
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 4; ++k)  // only faces that see the point from outside can be nearest
      if (w[k] < 0) best = std::min(best, squared_distance_to_triangle(p, x[(k + 1) % 4], x[(k + 2) % 4], x[(k + 3) % 4]));
    return best;
  }
};

}  // namespace

SurfaceEmbedding embed(const Points& points, const TetMesh& volume) {
  if (!points.allFinite()) throw Error("a point is not finite", "embed: points_m");
  const auto& t = volume.tetrahedra;
  std::vector<Element> elements(t.rows());
  std::vector<Box> boxes(t.rows());
  bool any = false;
  Box everything;
  for (Index i = 0; i < t.rows(); ++i) {
    Element& e = elements[i];
    e.origin = volume.nodes_m.row(t(i, 0)).transpose();
    for (int k = 0; k < 3; ++k) e.edges.col(k) = volume.nodes_m.row(t(i, k + 1)).transpose() - e.origin;
    const double longest = e.edges.colwise().norm().maxCoeff();
    e.usable = std::abs(e.edges.determinant()) > 1e-12 * longest * longest * longest;
    if (!e.usable) continue;
    e.inverse = e.edges.inverse();
    any = true;
    for (int k = 0; k < 4; ++k) boxes[i].add(volume.nodes_m.row(t(i, k)).transpose());
    everything.add(boxes[i]);
  }
  if (!any) throw Error("no tetrahedron has a volume", "embed: volume");
  for (Index i = 0; i < t.rows(); ++i)
    if (!elements[i].usable) boxes[i].add(everything.min);  // never a nearer answer: passed over in the leaf
  const Bvh bvh = build_bvh(boxes, 4);
  const double same = 1e-24 * (everything.max - everything.min).squaredNorm();

  SurfaceEmbedding out;
  out.element.resize(points.rows());
  out.weights.resize(points.rows(), 4);
  for (Eigen::Index row = 0; row < points.rows(); ++row) {
    const Vec3 p = points.row(row).transpose();
    double best = std::numeric_limits<double>::infinity();
    Index best_element = -1;
    Eigen::Vector4d best_weights = Eigen::Vector4d::Zero();
    std::array<std::pair<double, Index>, bvh_stack_size> stack;
    int top = 0;
    stack[top++] = {0, 0};
    while (top > 0) {
      const auto [squared, id] = stack[--top];
      if (squared > best + same) continue;
      const BvhNode& node = bvh.nodes[id];
      std::array<double, 2> d{node.box[0].squared_distance(p), node.box[1].squared_distance(p)};
      const int far = d[1] < d[0] ? 0 : 1;
      for (const int side : {far, 1 - far}) {
        if (node.child[side] < 0 || d[side] > best + same) continue;
        if (node.count[side] == 0) {
          stack[top++] = {d[side], node.child[side]};
          continue;
        }
        for (Index i = node.child[side]; i < node.child[side] + node.count[side]; ++i) {
          const Index e = bvh.order[i];
          if (!elements[e].usable) continue;
          const Eigen::Vector4d w = elements[e].weights(p);
          const double distance = elements[e].squared_distance(p, w);
          // equally near (a shared face, edge or corner): the one that extrapolates least
          const bool tie = std::abs(distance - best) <= same;
          if (tie ? w.minCoeff() > best_weights.minCoeff() : distance < best)
            best = distance, best_element = e, best_weights = w;
        }
      }
    }
    out.element[row] = best_element;
    out.weights.row(row) = best_weights.transpose();
  }
  return out;
}

Points embedded_points(const SurfaceEmbedding& embedding, const TetMesh& volume, const Points& nodal_values) {
  Points out = Points::Zero(embedding.element.rows(), 3);
  for (Eigen::Index i = 0; i < out.rows(); ++i)
    for (int k = 0; k < 4; ++k)
      out.row(i) += embedding.weights(i, k) * nodal_values.row(volume.tetrahedra(embedding.element[i], k));
  return out;
}

}  // namespace palpate::geometry
