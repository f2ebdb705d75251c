// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/completion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/geometry/winding_number.hpp"
#include "palpate/reconstruction/facets.hpp"

namespace palpate::reconstruction {
namespace {

constexpr int most_cubes_across = 64;       // of the seen part's diagonal
constexpr double faces_nobody = 0.1;        // resultant of the seen facets over their area: below, they look all ways
constexpr double unchanged = 0.02;          // of the volume: the planar completion is then as good
constexpr double close_cubes = 8;           // to a seen facet, in cubes: ...
constexpr double anchor_cubes = 2.5;        // ... right behind it, the object was seen
constexpr double touch_margin = 1.3;        // of a tool's radius
constexpr double price_of_misfit = 1;
constexpr int turns = 1;                    // of 15 degrees, away from the line of sight, that a mirror may have
constexpr double price_of_turn = 0.05;
constexpr int looked_at = 800;              // facets that the mirror is judged by
constexpr double price_of_depth = 0.05;     // prefers the nearer of two mirrors that are as good
constexpr double most_free = 0.1;           // of the mirrored facets that may stand in free space

Vec3 corner_mean(const TriMesh& m, Index t) {
  return (m.vertices_m.row(m.triangles(t, 0)) + m.vertices_m.row(m.triangles(t, 1)) + m.vertices_m.row(m.triangles(t, 2)))
             .transpose() / 3;
}

Vec3 area_of(const TriMesh& m, Index t) {
  const Vec3 a = m.vertices_m.row(m.triangles(t, 0)), b = m.vertices_m.row(m.triangles(t, 1)), c = m.vertices_m.row(m.triangles(t, 2));
  return 0.5 * (b - a).cross(c - a);
}

/// Cubes along the support's plane.
struct Cubes {
  Mat3 axes;  // columns; the last one points up
  Vec3 low;   // corner, in those axes
  double h = 0;
  std::array<int, 3> n{};

  std::size_t count() const { return std::size_t(n[0]) * std::size_t(n[1]) * std::size_t(n[2]); }
  std::size_t at(int x, int y, int z) const { return (std::size_t(z) * std::size_t(n[1]) + std::size_t(y)) * std::size_t(n[0]) + std::size_t(x); }
  bool holds(int x, int y, int z) const { return x >= 0 && y >= 0 && z >= 0 && x < n[0] && y < n[1] && z < n[2]; }
  Vec3 middle(int x, int y, int z) const { return axes * (low + h * Vec3(x + 0.5, y + 0.5, z + 0.5)); }
  /// Of the cube that holds a point; -1 outside of all.
  std::ptrdiff_t of(const Vec3& p) const {
    const Vec3 local = (axes.transpose() * p - low) / h;
    const int x = int(std::floor(local.x())), y = int(std::floor(local.y())), z = int(std::floor(local.z()));
    return holds(x, y, z) ? std::ptrdiff_t(at(x, y, z)) : -1;
  }
  template <class Visit>
  void each(Visit visit) const {
    for (int z = 0; z < n[2]; ++z)
      for (int y = 0; y < n[1]; ++y)
        for (int x = 0; x < n[0]; ++x) visit(x, y, z);
  }
};

constexpr std::array<std::array<int, 3>, 6> sides{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

struct Mirror {
  Vec3 normal = Vec3::Zero();
  double offset_m = 0;
  Vec3 of(const Vec3& p) const { return p - 2 * (normal.dot(p) - offset_m) * normal; }
};

class Completer {
 public:
  Completer(const FusedViews& fused, const FuseOptions& options) : options_(options), seen_(fused.facets), planar_(fused.facets) {
    seen_.triangles.conservativeResize(fused.seen, 3);
    Vec3 facing = Vec3::Zero();
    double area = 0;
    for (Index t = 0; t < fused.seen; ++t) facing += area_of(seen_, t), area += area_of(seen_, t).norm();
    up_ = options.support ? options.support->normal : Vec3(Vec3::UnitZ());
    facing = (facing - facing.dot(up_) * up_) / area;
    if (facing.norm() > faces_nobody) toward_ = facing.normalized();
    lay_cubes(fused);
  }

  /// Cubes of the solid that is asked for; empty where the planar completion will do.
  std::vector<char> solid() const {
    if (toward_.isZero() && options_.completion == Completion::mirrored) return {};  // seen from all around, or from above
    const geometry::WindingNumber winding(planar_);
    const geometry::TriangleTree to_seen(seen_);
    std::vector<char> hidden(cubes_.count()), planar(cubes_.count()), anchored(cubes_.count());
    std::size_t before = 0;
    cubes_.each([&](int x, int y, int z) {
      const Vec3 p = cubes_.middle(x, y, z);
      const std::size_t k = cubes_.at(x, y, z);
      const auto c = to_seen.closest(p);
      const Vec3 from = p - c.point_m;
      const double far = from.norm(), out = from.dot(area_of(seen_, c.triangle).normalized());
      // Close to what was seen, noise decides what is free; what lies outward of a facet is not hidden by it.
      hidden[k] = !options_.free(p) && !(far < close_cubes * cubes_.h && out > 0.5 * far);
      anchored[k] = hidden[k] && far < anchor_cubes * cubes_.h && out < 0;
      const bool inside = winding(p) > 0.5;
      planar[k] = inside && hidden[k];
      before += inside;
    });
    std::vector<char> out = planar;
    const auto value = [&](const std::vector<char>& cubes, std::ptrdiff_t k) { return k >= 0 && cubes[std::size_t(k)] != 0; };
    std::optional<Mirror> mirror;
    if (options_.completion == Completion::mirrored) mirror = find_mirror();
    if (options_.completion == Completion::tapered) mirror = upside_down();
    if (options_.completion == Completion::hidden) out = hidden;
    if (mirror) {
      cubes_.each([&](int x, int y, int z) {
        const std::size_t k = cubes_.at(x, y, z);
        if (!hidden[k] || anchored[k]) return;
        // what is known of the image counts, and where nothing is, the planar completion
        const auto image = cubes_.of(mirror->of(cubes_.middle(x, y, z)));
        if (options_.completion == Completion::tapered) out[k] = planar[k] && value(planar, image);
        else if (value(planar, image)) out[k] = 1;
        else if (image >= 0 && !value(hidden, image)) out[k] = 0;
      });
    }
    for (const Touch& touch : options_.touched) reach_to(touch, anchored, out);
    out = connected(out, planar);
    std::size_t changed = before - static_cast<std::size_t>(std::count(planar.begin(), planar.end(), 1));
    for (std::size_t k = 0; k < out.size(); ++k) changed += out[k] != planar[k];
    return double(changed) < unchanged * double(before) ? std::vector<char>() : out;
  }

  std::vector<Facet> skin(const std::vector<char>& solid, double cell) const {
    const std::vector<double> blurred = blur(blur(std::vector<double>(solid.begin(), solid.end())));
    const auto value = [&](int x, int y, int z) {
      z = std::max(z, 0);  // what stands on the support goes on below it
      return cubes_.holds(x, y, z) ? blurred[cubes_.at(x, y, z)] : 0.0;
    };
    const geometry::TriangleTree to_seen(seen_);
    std::vector<Facet> flat, loose;
    PointCloud points;
    std::vector<Vec3> middles, normals;
    cubes_.each([&](int x, int y, int z) {
      if (!solid[cubes_.at(x, y, z)]) return;
      for (const auto& s : sides) {
        const int a = x + s[0], b = y + s[1], c = z + s[2];
        if (cubes_.holds(a, b, c) && solid[cubes_.at(a, b, c)]) continue;
        const Vec3 out = cubes_.axes * Vec3(s[0], s[1], s[2]);
        const Vec3 middle = cubes_.middle(x, y, z) + 0.5 * cubes_.h * out;
        const double near = std::max(1.2 * cubes_.h, cell);
        const bool seen = to_seen.closest(middle).squared_distance_m2 < near * near;
        if (c < 0 && options_.support) {
          if (!seen) flat.push_back({middle, out, cubes_.h * cubes_.h, 0});
          continue;
        }
        const Vec3 falls = -cubes_.axes * Vec3(value(x + 1, y, z) - value(x - 1, y, z) + value(a + 1, b, c) - value(a - 1, b, c),
                                               value(x, y + 1, z) - value(x, y - 1, z) + value(a, b + 1, c) - value(a, b - 1, c),
                                               value(x, y, z + 1) - value(x, y, z - 1) + value(a, b, c + 1) - value(a, b, c - 1));
        if (falls.norm() < 1e-9) continue;
        middles.push_back(middle), normals.push_back(falls.normalized());
        if (!seen) loose.push_back({middle, falls.normalized(), cubes_.h * cubes_.h, 0});
      }
    });
    points.points_m.resize(Index(middles.size()), 3), points.normals.resize(Index(middles.size()), 3);
    for (std::size_t i = 0; i < middles.size(); ++i)
      points.points_m.row(Index(i)) = middles[i].transpose(), points.normals.row(Index(i)) = normals[i].transpose();
    const double reach = 1.5 * cubes_.h;
    const Grid grid({points}, reach);
    for (Facet& f : loose) settle(f, grid, reach);
    if (!loose.empty()) share_out_area(loose, cubes_.h);
    flat.insert(flat.end(), loose.begin(), loose.end());
    return flat;
  }

 private:
  void lay_cubes(const FusedViews& fused) {
    const auto [u, v] = tangents(up_);
    cubes_.axes << u, v, up_;
    Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (Index t = 0; t < fused.seen; ++t) {
      const Vec3 p = cubes_.axes.transpose() * corner_mean(seen_, t);
      low = low.cwiseMin(p), high = high.cwiseMax(p);
    }
    cubes_.h = std::max(0.5 * fused.cell_m, (high - low).norm() / most_cubes_across);
    behind_m_ = (high - low).head<2>().norm();
    const Vec3 back = cubes_.axes.transpose() * (-behind_m_ * toward_);
    low.head<2>() = low.head<2>().cwiseMin(low.head<2>() + back.head<2>()), high.head<2>() = high.head<2>().cwiseMax(high.head<2>() + back.head<2>());
    const Vec3 margin = Vec3::Constant(2 * cubes_.h);
    low -= margin, high += margin;
    if (options_.support) low.z() = up_.dot(options_.support->point_m);
    cubes_.low = low;
    for (int k = 0; k < 3; ++k) cubes_.n[std::size_t(k)] = std::max(1, int(std::ceil((high[k] - low[k]) / cubes_.h)));
  }

  /// Where a tool met the object there is its skin: nothing before it, and all behind it as far as the rest.
  void reach_to(const Touch& touch, const std::vector<char>& anchored, std::vector<char>& solid) const {
    double depth = 0;
    for (double d = 0.5 * cubes_.h; d < behind_m_ && depth == 0; d += 0.5 * cubes_.h) {
      const auto k = cubes_.of(touch.point_m + d * touch.inward);
      if (k >= 0 && solid[std::size_t(k)]) depth = d;
    }
    if (depth == 0) return;  // it met nothing of this object
    cubes_.each([&](int x, int y, int z) {
      const Vec3 from = cubes_.middle(x, y, z) - touch.point_m;
      const double along = from.dot(touch.inward), aside = (from - along * touch.inward).norm();
      const std::size_t k = cubes_.at(x, y, z);
      if (aside > touch_margin * touch.radius_m || along > depth || anchored[k]) return;
      if (along > 0) solid[k] = 1;
      else if (along > -2 * touch.radius_m) solid[k] = 0;
    });
  }

  /// Through half the height.
  Mirror upside_down() const {
    double top = -1e300;
    for (Index t = 0; t < seen_.triangles.rows(); ++t) top = std::max(top, up_.dot(corner_mean(seen_, t)));
    return {up_, 0.5 * (top + cubes_.low.z())};
  }

  std::optional<Mirror> find_mirror() const {
    if (toward_.isZero()) return std::nullopt;
    const geometry::TriangleTree tree(seen_);
    const double near = 2 * cubes_.h;
    const auto stride = std::max<Index>(1, static_cast<Index>(seen_.triangles.rows()) / looked_at);
    std::vector<std::pair<Vec3, Vec3>> facets;
    for (Index t = 0; t < seen_.triangles.rows(); t += stride) facets.emplace_back(corner_mean(seen_, t), area_of(seen_, t).normalized());
    std::optional<Mirror> best;
    double most = -1e300;
    for (int step = -turns; step <= turns; ++step) {
      Mirror mirror;
      mirror.normal = Eigen::AngleAxisd(step * M_PI / 12, up_) * toward_;
      double front = -1e300;
      for (const auto& [p, n] : facets) front = std::max(front, mirror.normal.dot(p));
      for (double depth = 0.5 * cubes_.h; depth < behind_m_; depth += 0.5 * cubes_.h) {
        mirror.offset_m = front - depth;
        double good = 0, bad = 0, slope = 0, curvature = 0;
        for (const auto& [p, n] : facets) {
          const Vec3 image = mirror.of(p);
          const auto c = tree.closest(image);
          const Vec3 turned = n - 2 * mirror.normal.dot(n) * mirror.normal;
          if (c.squared_distance_m2 < near * near) {
            const Vec3 normal = area_of(seen_, c.triangle).normalized();
            if (turned.dot(normal) < 0.7) continue;
            const double across = 2 * normal.dot(mirror.normal);
            ++good, slope += across * normal.dot(image - c.point_m), curvature += across * across;
          } else {
            bad += options_.free(image - cubes_.h * turned);  // within a solid, not on its rim
          }
        }
        const double all = double(facets.size());
        if (bad > most_free * all) continue;
        // where images and facets say that the mirror belongs, by least squares
        const double off_m = curvature > 0.01 * good ? std::abs(slope) / curvature : 0;
        const double score = (good - 2 * bad) / all - price_of_misfit * off_m / near - price_of_depth * depth / behind_m_ - price_of_turn * std::abs(step);
        if (score > most) most = score, best = mirror;
      }
    }
    return best;
  }

  /// Of `from`, what hangs together with `core`.
  std::vector<char> connected(const std::vector<char>& from, const std::vector<char>& core) const {
    std::vector<char> out(from.size(), 0);
    std::vector<std::array<int, 3>> pending;
    cubes_.each([&](int x, int y, int z) {
      const std::size_t k = cubes_.at(x, y, z);
      if (core[k] && from[k]) out[k] = 1, pending.push_back({x, y, z});
    });
    while (!pending.empty()) {
      const auto [x, y, z] = pending.back();
      pending.pop_back();
      for (const auto& s : sides) {
        const int a = x + s[0], b = y + s[1], c = z + s[2];
        if (!cubes_.holds(a, b, c) || out[cubes_.at(a, b, c)] || !from[cubes_.at(a, b, c)]) continue;
        out[cubes_.at(a, b, c)] = 1;
        pending.push_back({a, b, c});
      }
    }
    return out;
  }

  std::vector<double> blur(const std::vector<double>& in) const {
    std::vector<double> out(in.size());
    cubes_.each([&](int x, int y, int z) {
      double sum = 0;
      for (int c = -1; c <= 1; ++c)
        for (int b = -1; b <= 1; ++b)
          for (int a = -1; a <= 1; ++a) {
            const int zz = std::max(z + c, 0);
            if (cubes_.holds(x + a, y + b, zz)) sum += in[cubes_.at(x + a, y + b, zz)];
          }
      out[cubes_.at(x, y, z)] = sum / 27;
    });
    return out;
  }

  const FuseOptions& options_;
  TriMesh seen_, planar_;
  Vec3 up_, toward_ = Vec3::Zero();  // toward the sensors, along the plane
  double behind_m_ = 0;
  Cubes cubes_;
};

}  // namespace

void complete(FusedViews& fused, const FuseOptions& options) {
  if (!options.free) return;
  const Completer completer(fused, options);
  const std::vector<char> solid = completer.solid();
  if (solid.empty()) return;
  const std::vector<Facet> skin = completer.skin(solid, fused.cell_m);
  fused.support_area_m2 = 0;
  for (const Facet& f : skin) fused.support_area_m2 += f.area_m2;
  const TriMesh added = triangles_of(skin);
  TriMesh& all = fused.facets;
  all.vertices_m.conservativeResize(3 * fused.seen + added.vertices_m.rows(), 3);
  all.triangles.conservativeResize(fused.seen + added.triangles.rows(), 3);
  all.vertices_m.bottomRows(added.vertices_m.rows()) = added.vertices_m;
  all.triangles.bottomRows(added.triangles.rows()) = added.triangles.array() + 3 * fused.seen;
}

}  // namespace palpate::reconstruction
