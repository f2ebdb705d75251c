// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/fused_surface.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "palpate/core/error.hpp"
#include "palpate/geometry/union_find.hpp"
#include "palpate/geometry/winding_number.hpp"
#include "palpate/reconstruction/facets.hpp"
#include "palpate/reconstruction/unseen_patches.hpp"

namespace palpate::reconstruction {
namespace {

constexpr double stands_within = 0.02;  // of the lattice's cell, of a support

PointCloud middles_of(const TriMesh& facets) {
  PointCloud out;
  out.points_m.resize(facets.triangles.rows(), 3);
  out.normals.resize(facets.triangles.rows(), 3);
  for (Index i = 0; i < facets.triangles.rows(); ++i) {
    const auto corner = [&](int k) { return Vec3(facets.vertices_m.row(facets.triangles(i, k)).transpose()); };
    out.points_m.row(i) = (corner(0) + corner(1) + corner(2)).transpose() / 3;
    out.normals.row(i) = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized().transpose();
  }
  return out;
}

/// Signed distance from the fused surface, negative inside; good near it, only a sign far off and where it was cut by sight.
class Field {
  static constexpr double beside = 0.6;  // of the reach: further from every facet is beside the rims

 public:
  Field(const TriMesh& facets, const std::function<double(const Vec3&)>& inside, double reach, const SurfaceOptions& options)
      : inside_(inside), reach_(reach), grid_({middles_of(facets)}, reach), options_(options) {
    if (!inside_) winding_.emplace(facets);
  }

  const Grid& facets() const { return grid_; }
  /// Beyond this distance from every facet only the winding number knows the surface.
  double known_within_m() const { return beside * reach_; }

  double operator()(const Vec3& x) {
    const double d = by_facets(x);
    if (inside_ && options_.support) return std::max(d, options_.support->normal.dot(options_.support->point_m - x));
    return d < 0 && looked_through(x) ? reach_ : d;
  }

  /// Did a sensor look through a place that no facet says anything about?
  bool looked_through(const Vec3& x) {
    if (!options_.free || inside_) return false;
    return !grid_.any_around(x, [&](Index i) { return (grid_.point(i) - x).squaredNorm() < 0.15 * reach_ * reach_; }) && options_.free(x);
  }

  /// The same as if nobody had looked through anything.
  double by_facets(const Vec3& x) {
    const auto d = goes_on(x);
    if (!d) return reach_ * side(x);
    // far from the surface, and beside its rims, only the winding number knows the side
    if (std::abs(d->off_m) < 0.4 * reach_ && d->nearest_m < beside * reach_) return d->off_m;
    return std::abs(d->off_m) * side(x);
  }

  /// From the surface as facets within reach go on, beside their rims too.
  struct Distance {
    double off_m, nearest_m;  ///< along their normals; of the nearest facet's middle
  };
  std::optional<Distance> goes_on(const Vec3& x) {
    near_.clear();
    Index nearest = -1;
    double least = reach_ * reach_;
    grid_.around(x, 1, [&](Index i) {
      const double d2 = (grid_.point(i) - x).squaredNorm();
      if (d2 >= reach_ * reach_) return;
      near_.push_back({i, d2});
      if (d2 < least) least = d2, nearest = i;
    });
    if (nearest < 0) return std::nullopt;
    Vec3 mean = Vec3::Zero();
    for (Near& n : near_) {
      // of a thin part the side that is nearer
      if (grid_.normal(n.facet).dot(grid_.normal(nearest)) <= 0)
        n.weight = 0;
      else
        n.weight = std::pow(1 - n.weight / (reach_ * reach_), 2);
      mean += n.weight * grid_.normal(n.facet);
    }
    mean.normalize();
    double sum = 0, weights = 0;
    for (const Near& n : near_) {
      if (n.weight == 0) continue;
      sum += n.weight * 0.5 * (grid_.normal(n.facet) + mean).dot(x - grid_.point(n.facet));
      weights += n.weight;
    }
    return Distance{sum / weights, std::sqrt(least)};
  }

 private:
  struct Near {
    Index facet;
    double weight;  ///< the squared distance at first
  };

  double side(const Vec3& x) const { return std::clamp(1 - 2 * (inside_ ? inside_(x) : (*winding_)(x)), -1.0, 1.0); }

  const std::function<double(const Vec3&)>& inside_;
  std::optional<geometry::WindingNumber> winding_;
  double reach_;
  Grid grid_;
  const SurfaceOptions& options_;
  std::vector<Near> near_;
};

/// Where the flank meets the plane: marching cuts a corner off every edge that two surfaces make, and of a foot it would leave
/// too little. Vertices in the plane beside ones above it, and those, go along the plane to where the facets' surface is.
void sharpen_foot(const Plane& plane, Field& field, double cell, TriMesh& surface) {
  constexpr int steps = 4;
  constexpr double least_slope = 0.2;  // of the distance from the flank, along the plane: flatter, it does not say where it ends
  constexpr double farthest_cells = 1.5;
  std::vector<char> above(static_cast<std::size_t>(surface.vertices_m.rows())), rim(above.size());
  for (std::size_t i = 0; i < above.size(); ++i)
    above[i] = plane.normal.dot(Vec3(surface.vertices_m.row(static_cast<Index>(i))) - plane.point_m) > 1e-9;
  for (Index t = 0; t < surface.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k)
      for (const int other : {(k + 1) % 3, (k + 2) % 3})
        if (above[surface.triangles(t, other)] && !above[surface.triangles(t, k)])
          rim[surface.triangles(t, k)] = rim[surface.triangles(t, other)] = 1;
  const auto [u, v] = tangents(plane.normal);
  const double h = 0.1 * cell;
  for (std::size_t i = 0; i < rim.size(); ++i) {
    if (!rim[i]) continue;
    const Vec3 from = surface.vertices_m.row(static_cast<Index>(i));
    Vec3 at = from;
    bool known = true;
    for (int step = 0; known && step < steps; ++step) {
      const auto here = field.goes_on(at), beside_u = field.goes_on(at + h * u), beside_v = field.goes_on(at + h * v);
      known = here && beside_u && beside_v;
      if (!known) break;
      const Vec3 gradient = ((beside_u->off_m - here->off_m) * u + (beside_v->off_m - here->off_m) * v) / h;
      known = gradient.norm() > least_slope;
      if (known) at -= here->off_m / gradient.squaredNorm() * gradient;
      known = known && (at - from).norm() < farthest_cells * cell;
    }
    if (known) surface.vertices_m.row(static_cast<Index>(i)) = at.transpose();
  }
}

/// A point of the lattice in half cells: all even (corner of a cube) or all odd (its middle).
using Place = Cell;

class March {
 public:
  March(Field& field, const Vec3& origin, double cell) : field_(field), origin_(origin), cell_(cell) {}

  void add_cubes_around(const Vec3& p) {
    Cell c;
    for (int k = 0; k < 3; ++k) c[k] = std::int64_t(std::floor((p[k] - origin_[k]) / cell_));
    queue_around(c);
  }

  /// Follows the surface out of the cubes that were added, until it is closed.
  TriMesh run() {
    for (std::size_t i = 0; i < cubes_.size(); ++i) {
      const Cell c = cubes_[i];
      if (march(c)) queue_around(c);
      if (cubes_.size() > 20000000) throw Error("is too small for an object of this size", "SurfaceOptions: cell_m");
    }
    TriMesh out;
    out.vertices_m.resize(static_cast<Index>(vertices_.size()), 3);
    for (std::size_t v = 0; v < vertices_.size(); ++v) out.vertices_m.row(static_cast<Index>(v)) = vertices_[v].transpose();
    out.triangles.resize(static_cast<Index>(triangles_.size()), 3);
    for (std::size_t t = 0; t < triangles_.size(); ++t)
      out.triangles.row(static_cast<Index>(t)) << triangles_[t][0], triangles_[t][1], triangles_[t][2];
    return out;
  }

 private:
  struct Corner {
    Vec3 at;
    double value;
    Index id;
  };

  void queue_around(const Cell& c) {
    for (std::int64_t x = -1; x <= 1; ++x)
      for (std::int64_t y = -1; y <= 1; ++y)
        for (std::int64_t z = -1; z <= 1; ++z) {
          const Cell n{c[0] + x, c[1] + y, c[2] + z};
          if (known_.try_emplace(key_of(n), 0).second) cubes_.push_back(n);
        }
  }

  Index corner(const Place& p) {
    const auto [it, fresh] = corner_of_.try_emplace(key_of(p), static_cast<Index>(corners_.size()));
    if (fresh) {
      const Vec3 at = origin_ + 0.5 * cell_ * Vec3(double(p[0]), double(p[1]), double(p[2]));
      const double value = field_(at);
      corners_.push_back({at, value == 0 ? 1e-12 * cell_ : value, it->second});
    }
    return it->second;
  }

  /// The tetrahedra around a cube's three upper faces (as in geometry::Lattice). @returns whether the surface passes them
  bool march(const Cell& c) {
    bool passed = false;
    const auto middle = [&](const Cell& q) { return corner({2 * q[0] + 1, 2 * q[1] + 1, 2 * q[2] + 1}); };
    for (int axis = 0; axis < 3; ++axis) {
      Cell next = c;
      ++next[axis];
      const Index a = middle(c), b = middle(next);
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<Index, 4> ring;
      for (int k = 0; k < 4; ++k) {
        Place p{2 * next[0], 2 * next[1], 2 * next[2]};
        p[u] += k == 1 || k == 2 ? 2 : 0;
        p[v] += k >= 2 ? 2 : 0;
        ring[k] = corner(p);
      }
      for (int k = 0; k < 4; ++k) passed |= cut({a, b, ring[k], ring[(k + 1) % 4]});
    }
    return passed;
  }

  Index vertex(Index in, Index out) {
    const auto [it, fresh] = vertex_of_.try_emplace((Key(in) << 32) | Key(out), static_cast<Index>(vertices_.size()));
    if (fresh) {
      const Corner &a = corners_[in], &b = corners_[out];
      double share = a.value / (a.value - b.value);
      if (field_.looked_through(b.at)) {  // halved down to where sight ends
        double hidden = 0, seen = 1;
        for (int k = 0; k < 5; ++k) {
          const double middle = 0.5 * (hidden + seen);
          (field_.looked_through(a.at + middle * (b.at - a.at)) ? seen : hidden) = middle;
        }
        share = field_.by_facets(b.at) < 0 ? seen : std::min(share, seen);
      }
      share = std::clamp(share, 0.02, 0.98);  // no triangle without area
      vertices_.push_back(a.at + share * (b.at - a.at));
    }
    return it->second;
  }

  bool cut(const std::array<Index, 4>& tet) {
    std::array<Index, 4> in, out;
    int n = 0, m = 0;
    for (const Index i : tet) (corners_[i].value < 0 ? in[n++] : out[m++]) = i;
    if (n == 0 || m == 0) return false;
    const auto add = [&](Index a, Index b, Index c) {
      const Vec3 normal = (vertices_[b] - vertices_[a]).cross(vertices_[c] - vertices_[a]);
      if (normal.dot(corners_[out[0]].at - corners_[in[0]].at) < 0) std::swap(b, c);
      triangles_.push_back({a, b, c});
    };
    if (n == 1) {
      add(vertex(in[0], out[0]), vertex(in[0], out[1]), vertex(in[0], out[2]));
    } else if (n == 3) {
      add(vertex(in[0], out[0]), vertex(in[1], out[0]), vertex(in[2], out[0]));
    } else {
      const Index a = vertex(in[0], out[0]), b = vertex(in[0], out[1]), c = vertex(in[1], out[1]), d = vertex(in[1], out[0]);
      add(a, b, c);
      add(a, c, d);
    }
    return true;
  }

  Field& field_;
  Vec3 origin_;
  double cell_;
  std::vector<Cell> cubes_;
  std::unordered_map<Key, char> known_;
  std::unordered_map<Key, Index> corner_of_, vertex_of_;
  std::vector<Corner> corners_;
  std::vector<Vec3> vertices_;
  std::vector<std::array<Index, 3>> triangles_;
};

/// Leaves out closed parts that are much smaller than the largest or do not belong, and hollows.
TriMesh without_specks(const TriMesh& mesh, const std::function<bool(const Vec3&)>& belongs) {
  const auto vertices_before = static_cast<std::size_t>(mesh.vertices_m.rows());
  geometry::UnionFind parts(mesh.vertices_m.rows());
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int k = 1; k < 3; ++k) parts.join(mesh.triangles(t, 0), mesh.triangles(t, k));
  const auto at = [&](Index t, int k) { return Vec3(mesh.vertices_m.row(mesh.triangles(t, k)).transpose()); };
  std::vector<double> area(vertices_before, 0), volume(vertices_before, 0);
  const Vec3 middle = at(0, 0);
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const Vec3 n = (at(t, 1) - at(t, 0)).cross(at(t, 2) - at(t, 0));
    area[parts.root(mesh.triangles(t, 0))] += n.norm();
    volume[parts.root(mesh.triangles(t, 0))] += n.dot(at(t, 0) - middle);
  }
  const double largest = *std::max_element(area.begin(), area.end());
  std::vector<char> kept(vertices_before, belongs ? 0 : 1);
  if (belongs)
    for (Index v = 0; v < mesh.vertices_m.rows(); ++v)
      if (!kept[parts.root(v)] && belongs(mesh.vertices_m.row(v).transpose())) kept[parts.root(v)] = 1;
  TriMesh out;
  std::vector<Index> place(vertices_before, -1);
  out.vertices_m.resize(mesh.vertices_m.rows(), 3);
  out.triangles.resize(mesh.triangles.rows(), 3);
  Index vertices = 0, triangles = 0;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const Index r = parts.root(mesh.triangles(t, 0));
    if (area[r] < 0.01 * largest || volume[r] <= 0 || !kept[r]) continue;
    for (int k = 0; k < 3; ++k) {
      Index& p = place[mesh.triangles(t, k)];
      if (p < 0) {
        p = vertices++;
        out.vertices_m.row(p) = mesh.vertices_m.row(mesh.triangles(t, k));
      }
      out.triangles(triangles, k) = p;
    }
    ++triangles;
  }
  out.vertices_m.conservativeResize(vertices, 3);
  out.triangles.conservativeResize(triangles, 3);
  return out;
}

}  // namespace

TriMesh fused_surface(const FusedViews& fused, const SurfaceOptions& options) {
  if (!(options.cell_m >= 0) || !std::isfinite(options.cell_m))
    throw Error("must be a length, or 0", "SurfaceOptions: cell_m");
  if (fused.facets.triangles.rows() == 0) throw Error("there is no facet to lay a surface through", "FusedViews: facets");
  const double cell = options.cell_m > 0 ? options.cell_m : 1.1 * fused.cell_m;
  TriMesh facets = fused.facets;
  if (fused.inside) facets.triangles.conservativeResize(fused.held, 3);  // what completes them is in the field
  Field field(facets, fused.inside, 1.25 * fused.cell_m, options);
  const Vec3 low = facets.vertices_m.colwise().minCoeff().transpose();
  March march(field, low - Vec3(0.31, 0.37, 0.43) * cell, cell);
  for (Index i = 0; i < facets.triangles.rows(); ++i)
    march.add_cubes_around(facets.vertices_m.row(facets.triangles(i, 0)).transpose());
  const TriMesh all = march.run();
  TriMesh out = all.triangles.rows() > 0 ? without_specks(all, options.belongs) : all;
  if (out.triangles.rows() == 0)
    throw Error("what was seen encloses nothing: there is no inside. Add views, or complete it with its support", "clouds");
  if (fused.inside && options.support) {  // marching leaves the foot within a hair of the plane
    const Plane& plane = *options.support;
    for (Index v = 0; v < out.vertices_m.rows(); ++v) {
      const double height_m = plane.normal.dot(Vec3(out.vertices_m.row(v)) - plane.point_m);
      if (std::abs(height_m) < stands_within * cell) out.vertices_m.row(v) -= height_m * plane.normal.transpose();
    }
    sharpen_foot(plane, field, cell, out);
  }
  smooth_unseen_patches(out, field.facets(), field.known_within_m(), options.free, fused.inside ? options.support : std::nullopt);
  return out;
}

}  // namespace palpate::reconstruction
