// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/triangle_tree.hpp"

#include <array>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/geometry/bvh.hpp"
#include "palpate/geometry/wide_bvh.hpp"

namespace palpate::geometry {
namespace {

constexpr int leaf_size = 4;

struct Corner {
  Vec3 a, ab, ac;
  bool thin = false;  ///< height below 1e-6 of the longest edge: barycentrics from products of dot products cancel
};

Corner make_corner(const Points& v, const Triangles& t, Index i) {
  Corner c;
  c.a = v.row(t(i, 0)).transpose();
  c.ab = v.row(t(i, 1)).transpose() - c.a;
  c.ac = v.row(t(i, 2)).transpose() - c.a;
  const double longest = std::max({c.ab.squaredNorm(), c.ac.squaredNorm(), (c.ac - c.ab).squaredNorm()});
  c.thin = !(c.ab.cross(c.ac).squaredNorm() > 1e-12 * longest * longest);
  return c;
}

struct Candidate {
  double squared = 0, v = 0, w = 0;  ///< point = a + v ab + w ac
};

double squared_at(const Corner& t, const Vec3& ap, double v, double w) { return (ap - v * t.ab - w * t.ac).squaredNorm(); }

double along(const Vec3& edge, const Vec3& from_start) {
  const double length2 = edge.squaredNorm();
  return length2 > 0 ? std::clamp(edge.dot(from_start) / length2, 0.0, 1.0) : 0.0;
}

/// Needles, points and lines: the best of three edges, and of the inside where a normal exists.
Candidate closest_thin(const Corner& t, const Vec3& ap) {
  const double s = along(t.ab, ap), u = along(t.ac, ap), r = along(t.ac - t.ab, ap - t.ab);
  std::array<Candidate, 3> edges{Candidate{0, s, 0}, Candidate{0, 0, u}, Candidate{0, 1 - r, r}};
  Candidate best{std::numeric_limits<double>::infinity(), 0, 0};
  for (Candidate& c : edges) {
    c.squared = squared_at(t, ap, c.v, c.w);
    if (c.squared < best.squared) best = c;
  }
  const Vec3 n = t.ab.cross(t.ac);
  const double n2 = n.squaredNorm();
  if (n2 > 0) {
    const double v = ap.cross(t.ac).dot(n) / n2, w = t.ab.cross(ap).dot(n) / n2;
    if (v >= 0 && w >= 0 && v + w <= 1) {
      const Candidate inside{squared_at(t, ap, v, w), v, w};
      if (inside.squared < best.squared) best = inside;
    }
  }
  return best;
}

/// Ericson, Real-Time Collision Detection (2005), section 5.1.5: the Voronoi regions of corners, edges and face in turn.
inline Candidate closest_on(const Corner& t, const Vec3& p) {
  const Vec3 ap = p - t.a;
  if (t.thin) return closest_thin(t, ap);
  const double d1 = t.ab.dot(ap), d2 = t.ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return {ap.squaredNorm(), 0, 0};
  const Vec3 bp = ap - t.ab;
  const double d3 = t.ab.dot(bp), d4 = t.ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return {bp.squaredNorm(), 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 / (d1 - d3);
    return {(ap - v * t.ab).squaredNorm(), v, 0};
  }
  const Vec3 cp = ap - t.ac;
  const double d5 = t.ab.dot(cp), d6 = t.ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return {cp.squaredNorm(), 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 / (d2 - d6);
    return {(ap - w * t.ac).squaredNorm(), 0, w};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {squared_at(t, ap, 1 - w, w), 1 - w, w};
  }
  const double scale = 1 / (va + vb + vc);
  const double v = vb * scale, w = vc * scale;
  return {squared_at(t, ap, v, w), v, w};
}

/// Ray prepared for the slab test and for the watertight triangle test (Woop, Benthin, Wald 2013): the ray becomes the
/// z axis of a sheared frame, and a point on a shared edge belongs to both triangles, so that no ray slips between.
struct Ray {
  Vec3 origin, inverse;
  int kx = 0, ky = 1, kz = 2;
  double sx = 0, sy = 0, sz = 1;

  Ray(const Vec3& o, const Vec3& d) : origin(o), inverse(d.cwiseInverse()) {
    d.cwiseAbs().maxCoeff(&kz);
    kx = (kz + 1) % 3;
    ky = (kx + 1) % 3;
    sx = d[kx] / d[kz];
    sy = d[ky] / d[kz];
    sz = 1 / d[kz];
  }

  /// Entry into the box, or infinity. Comparisons are written so that 0 * inf (a ray within a face of the box) counts as in.
  double enter(const Box& b, double max_range) const {
    double near = 0, far = max_range;
    for (int k = 0; k < 3; ++k) {
      const bool forward = inverse[k] >= 0;
      const double t0 = ((forward ? b.min[k] : b.max[k]) - origin[k]) * inverse[k];
      const double t1 = ((forward ? b.max[k] : b.min[k]) - origin[k]) * inverse[k] * (1 + 4e-16);
      if (t0 > near) near = t0;
      if (t1 < far) far = t1;
    }
    return near <= far ? near : std::numeric_limits<double>::infinity();
  }

  bool hit(const Vec3& a, const Vec3& b, const Vec3& c, double max_range, RayHit& out) const {
    const Vec3 A = a - origin, B = b - origin, C = c - origin;
    const double ax = A[kx] - sx * A[kz], ay = A[ky] - sy * A[kz];
    const double bx = B[kx] - sx * B[kz], by = B[ky] - sy * B[kz];
    const double cx = C[kx] - sx * C[kz], cy = C[ky] - sy * C[kz];
    const double u = cx * by - cy * bx, v = ax * cy - ay * cx, w = bx * ay - by * ax;
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
    const double det = u + v + w;
    if (det == 0) return false;
    const double t = (u * sz * A[kz] + v * sz * B[kz] + w * sz * C[kz]) / det;
    if (!(t >= 0 && t < max_range)) return false;
    out.barycentric = Vec3(u, v, w) / det;
    out.range_m = t;
    return true;
  }
};

void check_vertices(const Points& vertices) {
  if (!vertices.allFinite()) throw Error("a vertex is not finite; remove it or repair the mesh", "TriangleTree: vertices_m");
}

}  // namespace

struct TriangleTree::Impl {
  TriMesh mesh;
  Bvh bvh;
  WideBvh wide;
  std::vector<Corner> corners;  ///< in the order of the leaves
  std::vector<Index> slot;      ///< of a triangle in `corners`

  void fill_corners() {
    for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = make_corner(mesh.vertices_m, mesh.triangles, bvh.order[i]);
  }
};

TriangleTree::TriangleTree(TriMesh mesh) : impl_(std::make_unique<Impl>()) {
  if (mesh.triangles.rows() == 0) throw Error("the surface has no triangle", "TriangleTree: triangles");
  const Index n = static_cast<Index>(mesh.vertices_m.rows());
  if (mesh.triangles.minCoeff() < 0 || mesh.triangles.maxCoeff() >= n)
    throw Error("a vertex index is outside 0.." + std::to_string(n - 1), "TriangleTree: triangles");
  check_vertices(mesh.vertices_m);
  impl_->mesh = std::move(mesh);
  impl_->bvh = build_bvh(triangle_boxes(impl_->mesh), leaf_size);
  impl_->wide = widen(impl_->bvh);
  impl_->corners.resize(impl_->bvh.order.size());
  impl_->slot.resize(impl_->bvh.order.size());
  for (std::size_t i = 0; i < impl_->slot.size(); ++i) impl_->slot[impl_->bvh.order[i]] = static_cast<Index>(i);
  impl_->fill_corners();
}

TriangleTree::~TriangleTree() = default;
TriangleTree::TriangleTree(TriangleTree&&) noexcept = default;
TriangleTree& TriangleTree::operator=(TriangleTree&&) noexcept = default;

void TriangleTree::refit(const Points& vertices_m) {
  if (vertices_m.rows() != impl_->mesh.vertices_m.rows())
    throw Error("has " + std::to_string(vertices_m.rows()) + " rows, the tree was built for " +
                    std::to_string(impl_->mesh.vertices_m.rows()),
                "TriangleTree::refit: vertices_m");
  check_vertices(vertices_m);
  impl_->mesh.vertices_m = vertices_m;
  impl_->fill_corners();
  refit_bvh(impl_->bvh, vertices_m, impl_->mesh.triangles);
  copy_boxes(impl_->wide, impl_->bvh);
}

ClosestPoint TriangleTree::closest(const Vec3& p, Index hint) const {
  const Impl& s = *impl_;
  ClosestPoint out;
  out.squared_distance_m2 = std::numeric_limits<double>::quiet_NaN();
  if (!p.allFinite()) return out;
  Candidate best{std::numeric_limits<double>::infinity(), 0, 0};
  Index best_slot = -1;
  if (hint >= 0 && hint < static_cast<Index>(s.slot.size())) {
    best_slot = s.slot[hint];
    best = closest_on(s.corners[best_slot], p);
  }
  struct Visit {
    float squared;
    Index node;
  };
  const WideQuery query(s.wide, p);
  // lower bounds are floats: the limit is rounded up
  const auto as_limit = [](double d) {
    const auto f = static_cast<float>(d);
    return static_cast<double>(f) < d ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
  };
  float limit = as_limit(best.squared);
  std::array<Visit, 3 * bvh_stack_size> stack;
  int top = 0;
  stack[top++] = {0, 0};
  while (top > 0) {
    const Visit visit = stack[--top];
    if (visit.squared > limit) continue;
    const WideNode& node = s.wide.nodes[visit.node];
    const Eigen::Array4f d = query.squared(node);
    std::array<int, 4> order;
    const int n = nearest_first(node, d, limit, order);
    for (int i = 0; i < n; ++i) {  // leaves first, nearest first: they shrink the limit
      const int c = order[i];
      if (node.count[c] == 0 || d[c] > limit) continue;
      for (Index t = node.child[c]; t < node.child[c] + node.count[c]; ++t) {
        const Candidate candidate = closest_on(s.corners[t], p);
        if (candidate.squared < best.squared) best = candidate, best_slot = t;
      }
      limit = as_limit(best.squared);
    }
    for (int i = n - 1; i >= 0; --i) {
      const int c = order[i];
      if (node.count[c] == 0 && d[c] <= limit) stack[top++] = {d[c], node.child[c]};
    }
  }
  if (best_slot < 0) return out;  // coordinates so large that squares overflow
  const Corner& t = s.corners[best_slot];
  out.triangle = s.bvh.order[best_slot];
  out.barycentric = Vec3(1 - best.v - best.w, best.v, best.w);
  out.point_m = t.a + best.v * t.ab + best.w * t.ac;
  out.squared_distance_m2 = best.squared;
  return out;
}

bool TriangleTree::within(const Vec3& p, double squared, Index hint) const {
  const Impl& s = *impl_;
  if (!p.allFinite()) return false;
  if (hint >= 0 && hint < static_cast<Index>(s.slot.size()) && closest_on(s.corners[s.slot[hint]], p).squared <= squared)
    return true;
  const WideQuery query(s.wide, p);
  std::array<Index, 3 * bvh_stack_size> stack;
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const WideNode& node = s.wide.nodes[stack[--top]];
    const Eigen::Array4f d = query.squared(node);
    for (int i = 0; i < 4; ++i) {
      if (node.child[i] < 0 || !(d[i] <= squared)) continue;
      if (node.count[i] == 0) {
        stack[top++] = node.child[i];
        continue;
      }
      for (Index t = node.child[i]; t < node.child[i] + node.count[i]; ++t)
        if (closest_on(s.corners[t], p).squared <= squared) return true;
    }
  }
  return false;
}

std::optional<RayHit> TriangleTree::cast(const Vec3& origin, const Vec3& direction, double max_range, Index hint) const {
  const Impl& s = *impl_;
  if (!origin.allFinite() || !direction.allFinite() || direction.isZero(0)) return std::nullopt;
  const Ray ray(origin, direction);
  RayHit best;
  double range = max_range;
  const auto meet = [&](Index id) {
    const auto corner = [&](int k) { return Vec3(s.mesh.vertices_m.row(s.mesh.triangles(id, k)).transpose()); };
    if (!ray.hit(corner(0), corner(1), corner(2), range, best)) return;
    best.triangle = id;
    range = best.range_m;
  };
  if (hint >= 0 && hint < static_cast<Index>(s.slot.size())) meet(hint);
  struct Visit {
    float enter;
    Index node;
  };
  const WideRay wide(s.wide, origin, direction);
  float limit = wide.limit(range);
  std::array<Visit, 3 * bvh_stack_size> stack;
  int top = 0;
  stack[top++] = {0, 0};
  while (top > 0) {
    const Visit visit = stack[--top];
    if (visit.enter > limit) continue;
    const WideNode& node = s.wide.nodes[visit.node];
    const Eigen::Array4f enter = wide.enter(node, limit);
    std::array<int, 4> order;
    const int n = nearest_first(node, enter, limit, order);
    for (int i = 0; i < n; ++i) {  // leaves first, nearest first: they shrink the limit
      const int c = order[i];
      if (node.count[c] == 0 || enter[c] > limit) continue;
      for (Index t = node.child[c]; t < node.child[c] + node.count[c]; ++t) meet(s.bvh.order[t]);
      limit = wide.limit(range);
    }
    for (int i = n - 1; i >= 0; --i) {
      const int c = order[i];
      if (node.count[c] == 0 && enter[c] <= limit) stack[top++] = {enter[c], node.child[c]};
    }
  }
  if (best.triangle < 0) return std::nullopt;
  return best;
}

int TriangleTree::crossings(const Vec3& origin, const Vec3& direction) const {
  const Impl& s = *impl_;
  if (!origin.allFinite() || !direction.allFinite() || direction.isZero(0)) return 0;
  const Ray ray(origin, direction);
  const double endless = std::numeric_limits<double>::max();
  int count = 0;
  std::array<Index, bvh_stack_size> stack;
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const BvhNode& node = s.bvh.nodes[stack[--top]];
    for (int side = 0; side < 2; ++side) {
      if (node.child[side] < 0 || !(ray.enter(node.box[side], endless) <= endless)) continue;
      if (node.count[side] == 0) {
        stack[top++] = node.child[side];
        continue;
      }
      RayHit hit;
      for (Index i = node.child[side]; i < node.child[side] + node.count[side]; ++i) {
        const Index id = s.bvh.order[i];
        const auto corner = [&](int k) { return Vec3(s.mesh.vertices_m.row(s.mesh.triangles(id, k)).transpose()); };
        count += ray.hit(corner(0), corner(1), corner(2), endless, hit);
      }
    }
  }
  return count;
}

const TriMesh& TriangleTree::mesh() const { return impl_->mesh; }
const Bvh& TriangleTree::bvh() const { return impl_->bvh; }

}  // namespace palpate::geometry
