// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/fuse_views.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/reconstruction/completion.hpp"
#include "palpate/reconstruction/facets.hpp"
#include "palpate/reconstruction/skirts.hpp"

namespace palpate::reconstruction {
namespace {

constexpr double skirt_cells = 3.5;  // above the support: flanks that end lower go on to it

/// The object's shadow on the plane, closed with facets that face into the support, and walls from the shadow's rim up to
/// the surface above it.
std::vector<Facet> down_to(const Plane& plane, const std::vector<Facet>& facets, double cell) {
  const auto [u, v] = tangents(plane.normal);
  const double step = 2 * cell;
  using Square = std::pair<std::int64_t, std::int64_t>;
  struct Lowest {
    double height;
    bool underside;  ///< faces the plane: seen from below, nothing is hidden under it
  };
  std::map<Square, Lowest> lowest;  // facet over a square of the plane
  Square low{0, 0}, high{0, 0};
  for (const Facet& f : facets) {
    const Vec3 d = f.middle - plane.point_m;
    const double z = plane.normal.dot(d);
    if (z < -cell) continue;
    const Square at{std::int64_t(std::floor(u.dot(d) / step)), std::int64_t(std::floor(v.dot(d) / step))};
    const Lowest here{z, plane.normal.dot(f.normal) < -0.1};
    const auto [it, fresh] = lowest.try_emplace(at, here);
    if (!fresh && z < it->second.height) it->second = here;
    if (lowest.size() == 1) low = high = at;
    low = {std::min(low.first, at.first), std::min(low.second, at.second)};
    high = {std::max(high.first, at.first), std::max(high.second, at.second)};
  }
  if (lowest.empty()) return {};
  // what the rim of the picture reaches without crossing the shadow is outside: gaps within the shadow are filled
  const auto neighbours = [](const Square& s) {
    return std::array<Square, 4>{
        Square{s.first + 1, s.second}, {s.first - 1, s.second}, {s.first, s.second + 1}, {s.first, s.second - 1}};
  };
  std::set<Square> outside{{low.first - 1, low.second - 1}};
  std::vector<Square> pending(outside.begin(), outside.end());
  while (!pending.empty()) {
    const Square s = pending.back();
    pending.pop_back();
    for (const Square& n : neighbours(s))
      if (n.first >= low.first - 1 && n.first <= high.first + 1 && n.second >= low.second - 1 &&
          n.second <= high.second + 1 && !lowest.contains(n) && outside.insert(n).second)
        pending.push_back(n);
  }
  const auto seen_below = [&](const Square& s) {
    const auto it = lowest.find(s);
    return it != lowest.end() && it->second.underside;
  };
  std::vector<Facet> out;
  for (std::int64_t x = low.first; x <= high.first; ++x)
    for (std::int64_t y = low.second; y <= high.second; ++y) {
      const Square s{x, y};
      if (outside.contains(s) || seen_below(s)) continue;
      const Vec3 middle = plane.point_m + (double(x) + 0.5) * step * u + (double(y) + 0.5) * step * v;
      out.push_back({middle, -plane.normal, step * step, 0});
      for (const Square& n : neighbours(s)) {
        // up to the lower end of a flank that was seen, or of what was seen from above
        const auto top = lowest.find(seen_below(n) ? n : s);
        if (top == lowest.end() || !(outside.contains(n) || seen_below(n))) continue;
        const Vec3 away = double(n.first - x) * u + double(n.second - y) * v;
        const double tall = top->second.height;
        const int rows = std::max(0, static_cast<int>(std::lround(tall / step)));
        for (int k = 0; k < rows; ++k)
          out.push_back({middle + 0.5 * step * away + (k + 0.5) * tall / rows * plane.normal, away, step * tall / rows, 0});
      }
    }
  return out;
}

/// Of a strip that goes up from the plane: twice the mean of its facets'.
double height_of(const std::vector<Facet>& strip, const Plane& plane) {
  double sum = 0, area = 0;
  for (const Facet& f : strip) sum += f.area_m2 * std::max(0.0, plane.normal.dot(f.middle - plane.point_m)), area += f.area_m2;
  return area > 0 ? 2 * sum / area : 0;
}

void require(bool ok, const char* field, const char* bounds) {
  if (!ok) throw Error(bounds, std::string("FuseOptions: ") + field);
}

}  // namespace

void check(const FuseOptions& o) {
  require(o.cell_m >= 0 && std::isfinite(o.cell_m), "cell_m", "must be a length, or 0");
  require(o.fewest_points >= 1, "fewest_points", "must be at least 1");
  require(!o.support || std::abs(o.support->normal.norm() - 1) < 1e-6, "support.normal", "must have unit length");
}

FusedViews fuse_views(const std::vector<PointCloud>& clouds, const FuseOptions& options) {
  check(options);
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  double sigma = 0;
  Index points = 0;
  for (std::size_t c = 0; c < clouds.size(); ++c) {
    if (clouds[c].normals.rows() != clouds[c].points_m.rows())
      throw Error("has no normals, without which inside and outside cannot be told", "cloud " + std::to_string(c));
    for (Index i = 0; i < clouds[c].points_m.rows(); ++i) {
      const Vec3 p = clouds[c].points_m.row(i).transpose();
      if (!p.allFinite()) continue;
      low = low.cwiseMin(p), high = high.cwiseMax(p);
      ++points;
    }
    if (clouds[c].sigma_m.size() > 0) sigma = std::max(sigma, clouds[c].sigma_m.mean());
  }
  if (points < 50) throw Error("only " + std::to_string(points) + " points; a surface needs at least 50", "clouds");
  const double diagonal = (high - low).norm();
  FusedViews out;
  out.cell_m = options.cell_m > 0 ? options.cell_m : std::max(2.2 * sigma, diagonal / 150);

  Grid grid(clouds, out.cell_m);
  if (options.cell_m == 0)  // sparse points need wider cells
    while (double(points) < 4.0 * double(grid.bins().size()) && out.cell_m < 0.1 * diagonal)
      grid = Grid(clouds, out.cell_m *= 1.3);
  std::vector<Facet> facets;
  for (const auto& bin : grid.bins()) {
    if (static_cast<int>(bin.size()) < options.fewest_points) continue;
    Facet f{Vec3::Zero(), Vec3::Zero(), 0, 0};
    for (const Index i : bin) f.middle += grid.point(i), f.normal += grid.normal(i);
    f.middle /= double(bin.size());
    if (f.normal.norm() < 0.3 * double(bin.size())) continue;  // two sheets in one cell
    f.normal.normalize();
    if (settle(f, grid, out.cell_m)) facets.push_back(f);
  }
  if (facets.empty()) throw Error("no part of the surface is covered densely enough; raise cell_m", "clouds");
  share_out_area(facets, out.cell_m);
  out.seen = static_cast<Index>(facets.size());
  out.sigma_m.resize(out.seen);
  for (Index i = 0; i < out.seen; ++i) {
    out.seen_area_m2 += facets[i].area_m2;
    out.sigma_m[i] = facets[i].sigma_m;
  }
  const double low_m = skirt_cells * out.cell_m;
  out.around = options.free && seen_from_all_around(facets, options.support, low_m);
  if (options.support && out.around) {
    const auto strip = skirts(facets, *options.support, low_m, out.cell_m, options.free);
    out.strip_m = height_of(strip, *options.support);
    facets.insert(facets.end(), strip.begin(), strip.end());
  }
  out.held = static_cast<Index>(facets.size());
  if (options.support) {
    const auto bottom = down_to(*options.support, facets, out.cell_m);
    for (const Facet& f : bottom) out.support_area_m2 += f.area_m2;
    facets.insert(facets.end(), bottom.begin(), bottom.end());
  }
  out.facets = triangles_of(facets);
  complete(out, options);
  return out;
}

}  // namespace palpate::reconstruction
