// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/triangle_tree.hpp"

#include <array>
#include <atomic>
#include <cmath>
#include <mutex>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/geometry/bvh.hpp"
#include "palpate/geometry/closest_search.hpp"
#include "palpate/geometry/watertight_ray.hpp"
#include "palpate/geometry/wide_bvh.hpp"

namespace palpate::geometry {
namespace {

constexpr int leaf_size = 4;

/// Ray prepared for the slab test and for triangles.
struct Ray {
  Vec3 origin, inverse;
  WatertightRay watertight;

  Ray(const Vec3& o, const Vec3& d) : origin(o), inverse(d.cwiseInverse()), watertight(d) {}

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
    return watertight.hit(A.data(), B.data(), C.data(), max_range, out);
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
  std::optional<ClosestSearch> search;
  std::atomic<bool> search_is_old = true;  // who casts rays alone, refit after refit, need not wait for it
  std::mutex refitting;

  const ClosestSearch& up_to_date_search() {
    if (search_is_old.load(std::memory_order_acquire)) {
      const std::lock_guard lock(refitting);
      if (search_is_old.load(std::memory_order_relaxed)) {
        if (search) {
          search->refit(mesh, bvh);
        } else {
          search.emplace(mesh, bvh);
        }
        search_is_old.store(false, std::memory_order_release);
      }
    }
    return *search;
  }
  bool has(Index triangle) const { return triangle >= 0 && triangle < static_cast<Index>(mesh.triangles.rows()); }
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
}

TriangleTree::TriangleTree(const TriangleTree& other) : impl_(std::make_unique<Impl>()) {
  impl_->mesh = other.impl_->mesh;
  impl_->bvh = other.impl_->bvh;
  impl_->wide = other.impl_->wide;
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
  refit_bvh(impl_->bvh, vertices_m, impl_->mesh.triangles);
  copy_boxes(impl_->wide, impl_->bvh);
  impl_->search_is_old = true;
}

ClosestPoint TriangleTree::closest(const Vec3& p, Index hint) const {
  ClosestPoint out;
  out.squared_distance_m2 = std::numeric_limits<double>::quiet_NaN();
  if (!p.allFinite()) return out;
  const ClosestSearch::Found found = impl_->up_to_date_search().closest(p, hint);
  if (found.triangle < 0) return out;  // coordinates so large that squares overflow
  out.triangle = found.triangle;
  out.barycentric = Vec3(1 - found.at.v - found.at.w, found.at.v, found.at.w);
  out.point_m = found.point_m;
  out.squared_distance_m2 = found.at.squared;
  return out;
}

bool TriangleTree::within(const Vec3& p, double squared, Index hint) const {
  return p.allFinite() && impl_->up_to_date_search().within(p, squared, hint);
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
  if (s.has(hint)) meet(hint);
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
