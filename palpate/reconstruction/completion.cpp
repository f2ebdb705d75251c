// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/completion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/geometry/winding_number.hpp"
#include "palpate/reconstruction/cubes.hpp"
#include "palpate/reconstruction/facets.hpp"
#include "palpate/reconstruction/hidden_field.hpp"
#include "palpate/reconstruction/mirrors.hpp"

namespace palpate::reconstruction {
namespace {

constexpr int most_cubes_across = 64;       // of the seen part's diagonal
constexpr double faces_nobody = 0.1;        // resultant of the seen facets over their area: below, they look all ways
constexpr double unchanged = 0.02;          // of the volume: the planar completion is then as good
constexpr double close_cubes = 8;           // to a seen facet, in cubes: ...
constexpr double anchor_cubes = 2.5;        // ... right behind it, the object was seen
constexpr double nearer_share = 0.7;        // of how far a place is from what was seen: its image then knows more
constexpr double untold_cells = 2;          // above the support: not told from it by any sensor
constexpr double touch_margin = 1.3;        // of a tool's radius
constexpr double from_behind = 0.3;         // cosine between a push and the way to the sensors

class Completer {
 public:
  Completer(const FusedViews& fused, const FuseOptions& options)
      : options_(options), free_(options.free_to_support ? options.free_to_support : options.free), seen_(fused.facets), planar_(fused.facets) {
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
  /// @param symmetries_found  how many of what was seen were found, where they were looked for
  std::vector<char> solid(int& symmetries_found) const {
    if (toward_.isZero() && options_.completion == Completion::mirrored) return {};  // seen from above
    const geometry::WindingNumber winding(planar_);
    const geometry::TriangleTree to_seen(seen_);
    std::vector<char> hidden(cubes_.count()), planar(cubes_.count()), anchored(cubes_.count());
    std::vector<double> from_seen_m(cubes_.count());
    std::size_t before = 0;
    cubes_.each([&](int x, int y, int z) {
      const Vec3 p = cubes_.middle(x, y, z);
      const std::size_t k = cubes_.at(x, y, z);
      const auto c = to_seen.closest(p);
      const Vec3 from = p - c.point_m;
      const double far = from.norm(), out = from.dot(area_of(seen_, c.triangle).normalized());
      // Close to what was seen, noise decides what is free; what lies outward of a facet is not hidden by it.
      hidden[k] = !free_(p) && !(far < close_cubes * cubes_.h && out > 0.5 * far);
      from_seen_m[k] = far;
      anchored[k] = hidden[k] && far < anchor_cubes * cubes_.h && out < 0;
      const bool inside = winding(p) > 0.5;
      planar[k] = inside && hidden[k];
      before += inside;
    });
    std::vector<char> out = options_.completion == Completion::hidden ? hidden : planar;
    std::vector<char> open(cubes_.count());
    for (std::size_t k = 0; k < open.size(); ++k) open[k] = hidden[k] && !anchored[k];
    const auto value = [&](const std::vector<char>& cubes, const Vec3& p) {
      const auto k = cubes_.of(p);
      return k >= 0 && cubes[std::size_t(k)] != 0;
    };
    if (options_.completion == Completion::tapered) {
      const Mirror mirror = upside_down();
      cubes_.each([&](int x, int y, int z) {
        const std::size_t k = cubes_.at(x, y, z);
        if (open[k]) out[k] = planar[k] && value(planar, mirror.of(cubes_.middle(x, y, z)));
      });
    }
    // What one mirror says is handed to the next. What is known of the image counts: that it is free, or solid not only as
    // the rim of what was hidden; where nothing is, what was there before. Of several symmetries the one whose image is nearer to what
    // was seen knows, for of a ball one says of one half of its back what is only guessed of the other.
    std::vector<char> free_by_image(cubes_.count());
    const auto reflect = [&](const Mirror& mirror, std::vector<char>* only_guessed) {
      std::vector<char> next = out, still_open = open, next_free = free_by_image;
      cubes_.each([&](int x, int y, int z) {
        const std::size_t k = cubes_.at(x, y, z);
        if (!open[k]) return;
        const Vec3 p = cubes_.middle(x, y, z), image = mirror.of(p);
        if (value(out, image)) {
          const bool within = std::all_of(Cubes::sides.begin(), Cubes::sides.end(), [&](const auto& s) {
            return z + s[2] < 0 || value(out, mirror.of(p + cubes_.h * cubes_.axes * Vec3(s[0], s[1], s[2])));
          });
          if (!within && !value(anchored, image)) return;
          const double of_image_m = from_seen_m[std::size_t(cubes_.of(image))];
          if (!only_guessed || of_image_m <= nearer_share * from_seen_m[k]) next[k] = 1, still_open[k] = 0;
          else if (nearer_share * of_image_m <= from_seen_m[k]) (*only_guessed)[k] = 1;
        } else if (cubes_.of(image) >= 0 && (!value(hidden, image) || (only_guessed && value(free_by_image, image)))) {
          next[k] = still_open[k] = 0;
          next_free[k] = 1;
        }
      });
      out.swap(next), open.swap(still_open), free_by_image.swap(next_free);
    };
    if (options_.completion == Completion::mirrored) {
      const MirrorSearch search(seen_, up_, cubes_.h, free_);
      const std::vector<Mirror> symmetries = search.symmetries();
      symmetries_found = static_cast<int>(symmetries.size());
      std::vector<char> guessed(cubes_.count());
      for (const Mirror& mirror : symmetries) reflect(mirror, symmetries.size() > 1 ? &guessed : nullptr);
      if (symmetries.size() > 1)  // what the last ones showed
        for (const Mirror& mirror : symmetries) reflect(mirror, &guessed);
      for (std::size_t k = 0; k < open.size(); ++k)
        if (open[k] && guessed[k]) out[k] = 1, open[k] = 0;
      if (const auto back = half_way_back(search)) reflect(*back, nullptr);
    }
    keep_narrow_above_support(anchored, out);
    if (options_.completion == Completion::mirrored) close_grooves(hidden, open, out);
    for (const Touch& touch : options_.touched) reach_to(touch, hidden, anchored, out);
    out = cubes_.connected(out, planar);
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
      for (const auto& s : Cubes::sides) {
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
      const Vec3 p = cubes_.axes.transpose() * middle_of(seen_, t);
      low = low.cwiseMin(p), high = high.cwiseMax(p);
    }
    cubes_.h = std::max(0.5 * fused.cell_m, (high - low).norm() / most_cubes_across);
    untold_m_ = untold_cells * fused.cell_m;
    behind_m_ = (high - low).head<2>().norm();
    const Vec3 back = cubes_.axes.transpose() * (-behind_m_ * toward_);
    low.head<2>() = low.head<2>().cwiseMin(low.head<2>() + back.head<2>()), high.head<2>() = high.head<2>().cwiseMax(high.head<2>() + back.head<2>());
    const Vec3 margin = Vec3::Constant(2 * cubes_.h);
    low -= margin, high += margin;
    if (options_.support) low.z() = up_.dot(options_.support->point_m);
    cubes_.low = low;
    for (int k = 0; k < 3; ++k) cubes_.n[std::size_t(k)] = std::max(1, int(std::ceil((high[k] - low[k]) / cubes_.h)));
  }

  /// No sensor tells a place right above the support from the support itself, and what is free further up may seem hidden there:
  /// the object becomes no wider from there down, unless something was seen.
  void keep_narrow_above_support(const std::vector<char>& anchored, std::vector<char>& solid) const {
    if (!options_.support) return;
    const int untold = std::min(cubes_.n[2] - 1, static_cast<int>(std::ceil(untold_m_ / cubes_.h)));
    for (int z = untold - 1; z >= 0; --z)
      for (int x = 0; x < cubes_.n[0]; ++x)
        for (int y = 0; y < cubes_.n[1]; ++y) {
          const std::size_t k = cubes_.at(x, y, z);
          if (!anchored[k] && !solid[cubes_.at(x, y, z + 1)]) solid[k] = 0;
        }
  }

  /// Where a tool met the object there is its skin: nothing before it, and all behind it as far as the rest.
  void reach_to(const Touch& touch, const std::vector<char>& hidden, const std::vector<char>& anchored, std::vector<char>& solid) const {
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
      if (along > depth || anchored[k]) return;
      const double wide = touch_margin * touch.radius_m;
      // Skins bulge: what reaches out to the tool widens inwards, for a pillar of the tool's width would give way by itself.
      if (along > 0 && (aside < wide || (aside < wide + along && hidden[k]))) solid[k] = 1;
      else if (along <= 0 && along > -2 * touch.radius_m && aside < wide) solid[k] = 0;
    });
  }

  /// A cube of which nothing is known belongs to the object where it stands, with no free space before them, between two parts
  /// of it on most level lines: no mirror says what lies in its own plane.
  void close_grooves(const std::vector<char>& hidden, const std::vector<char>& open, std::vector<char>& solid) const {
    const Vec3 u = cubes_.axes.col(0), v = cubes_.axes.col(1);
    const std::array<Vec3, 4> lines{u, v, (u + v).normalized(), (u - v).normalized()};
    constexpr int most = 3;
    const std::vector<char> before = solid;
    const auto ends_in_solid = [&](Vec3 p, const Vec3& step) {
      for (p += step;; p += step) {
        const auto k = cubes_.of(p);
        if (k < 0) return false;
        if (before[std::size_t(k)]) return true;
        if (!hidden[std::size_t(k)]) return false;
      }
    };
    cubes_.each([&](int x, int y, int z) {
      const std::size_t k = cubes_.at(x, y, z);
      if (before[k] || !open[k]) return;
      const Vec3 p = cubes_.middle(x, y, z);
      const auto stands_between = [&](const Vec3& d) {
        return ends_in_solid(p, cubes_.h * d) && ends_in_solid(p, -cubes_.h * d);
      };
      if (std::count_if(lines.begin(), lines.end(), stands_between) >= most) solid[k] = 1;
    });
  }

  /// The mirror that says how far back the object reaches.
  std::optional<Mirror> half_way_back(const MirrorSearch& search) const {
    std::vector<Vec3> touched_m;
    for (const Touch& touch : options_.touched)
      if (touch.inward.dot(toward_) > from_behind) touched_m.push_back(touch.point_m);
    return search.half_way_back(toward_, behind_m_, touched_m);
  }

  /// Through nearly half the height: at half of it a ball would stand on a point, and what is held has a foot (of 0.46 of the ball's breadth).
  Mirror upside_down() const {
    constexpr double of_height = 0.47;
    double top = -1e300;
    for (Index t = 0; t < seen_.triangles.rows(); ++t) top = std::max(top, up_.dot(middle_of(seen_, t)));
    return {up_, cubes_.low.z() + of_height * (top - cubes_.low.z())};
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
  const std::function<bool(const Vec3&)>& free_;
  TriMesh seen_, planar_;
  Vec3 up_, toward_ = Vec3::Zero();  // toward the sensors, along the plane
  double behind_m_ = 0, untold_m_ = 0;
  Cubes cubes_;
};

}  // namespace

void complete(FusedViews& fused, const FuseOptions& options) {
  if (!options.free) return;
  if (fused.around) {
    fused.inside = hidden_field(fused, options);
    return;
  }
  const Completer completer(fused, options);
  const std::vector<char> solid = completer.solid(fused.symmetries);
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
