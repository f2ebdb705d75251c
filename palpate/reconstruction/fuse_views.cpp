// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/fuse_views.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <unordered_map>

#include "palpate/core/error.hpp"

namespace palpate::reconstruction {
namespace {

using Key = std::uint64_t;
using Cell = std::array<std::int64_t, 3>;

Key key_of(const Cell& c) {
  constexpr std::int64_t offset = 1 << 20;
  return (Key(c[0] + offset) << 42) | (Key(c[1] + offset) << 21) | Key(c[2] + offset);
}

struct Facet {
  Vec3 middle, normal;
  double area_m2 = 0, sigma_m = 0;
};

std::pair<Vec3, Vec3> tangents(const Vec3& n) {
  const Vec3 u = n.unitOrthogonal();
  return {u, n.cross(u)};
}

class Grid {
 public:
  Grid(const std::vector<PointCloud>& clouds, double cell) : cell_(cell) {
    for (const PointCloud& c : clouds)
      for (Index i = 0; i < c.points_m.rows(); ++i) {
        const Vec3 p = c.points_m.row(i).transpose(), n = c.normals.row(i).transpose();
        if (!p.allFinite() || !n.allFinite()) continue;
        const auto [it, fresh] = index_.try_emplace(key_of(cell_of(p)), static_cast<Index>(bins_.size()));
        if (fresh) bins_.emplace_back();
        bins_[it->second].push_back(static_cast<Index>(points_.size()));
        points_.push_back(p);
        normals_.push_back(n);
      }
  }

  const std::vector<std::vector<Index>>& bins() const { return bins_; }
  const Vec3& point(Index i) const { return points_[i]; }
  const Vec3& normal(Index i) const { return normals_[i]; }

  template <class F>
  void around(const Vec3& p, int reach, F visit) const {
    const Cell c = cell_of(p);
    for (std::int64_t x = -reach; x <= reach; ++x)
      for (std::int64_t y = -reach; y <= reach; ++y)
        for (std::int64_t z = -reach; z <= reach; ++z)
          if (const auto it = index_.find(key_of({c[0] + x, c[1] + y, c[2] + z})); it != index_.end())
            for (const Index i : bins_[it->second]) visit(i);
  }

 private:
  Cell cell_of(const Vec3& p) const {
    return {std::int64_t(std::floor(p.x() / cell_)), std::int64_t(std::floor(p.y() / cell_)),
            std::int64_t(std::floor(p.z() / cell_))};
  }
  double cell_;
  std::vector<Vec3> points_, normals_;
  std::vector<std::vector<Index>> bins_;
  std::unordered_map<Key, Index> index_;
};

/// Puts the facet on the quadratic surface through the points around it.
bool settle(Facet& f, const Grid& grid, double cell) {
  const auto [u, v] = tangents(f.normal);
  Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
  int count = 0;
  double squares = 0, weights = 0;
  grid.around(f.middle, 1, [&](Index i) {
    if (grid.normal(i).dot(f.normal) < 0.5) return;
    const Vec3 d = (grid.point(i) - f.middle) / cell;
    const double x = u.dot(d), y = v.dot(d), r2 = x * x + y * y;
    if (r2 > 2.25) return;
    const double w = (1 - r2 / 2.25) * (1 - r2 / 2.25);
    Eigen::Matrix<double, 6, 1> row;
    row << 1, x, y, x * x, x * y, y * y;
    a += w * row * row.transpose();
    const double z = f.normal.dot(d);
    b += w * z * row;
    squares += w * z * z, weights += w;
    ++count;
  });
  if (count < 3) return false;
  const int terms = count >= 18 ? 6 : 1;  // fewer points do not carry a curvature
  a.diagonal().array() += 1e-6 * a(0, 0);
  Eigen::Matrix<double, 6, 1> s = Eigen::Matrix<double, 6, 1>::Zero();
  const Eigen::LDLT<MatrixX> factor(a.topLeftCorner(terms, terms));
  s.head(terms) = factor.solve(b.head(terms));
  // scatter of the points about the fit, and what is left of it at the middle
  const double scatter2 = std::max(0.0, squares - s.dot(b)) / weights * count / std::max(1, count - terms);
  f.sigma_m = cell * std::sqrt(scatter2 * factor.solve(VectorX::Unit(terms, 0))[0]);
  f.middle += std::clamp(s[0], -1.0, 1.0) * cell * f.normal;
  f.normal = (f.normal - std::clamp(s[1], -1.0, 1.0) * u - std::clamp(s[2], -1.0, 1.0) * v).normalized();
  return true;
}

/// Area that each facet stands for: that of a disc over the number of facets in it.
void share_out_area(std::vector<Facet>& facets, double cell) {
  PointCloud middles;
  middles.points_m.resize(static_cast<Index>(facets.size()), 3);
  middles.normals.resize(static_cast<Index>(facets.size()), 3);
  for (std::size_t i = 0; i < facets.size(); ++i) {
    middles.points_m.row(i) = facets[i].middle.transpose();
    middles.normals.row(i) = facets[i].normal.transpose();
  }
  const double radius = 2 * cell;
  const Grid grid({middles}, radius);
  for (Facet& f : facets) {
    int count = 0;
    grid.around(f.middle, 1, [&](Index i) {
      count += (grid.point(i) - f.middle).squaredNorm() < radius * radius && grid.normal(i).dot(f.normal) > 0.3;
    });
    f.area_m2 = M_PI * radius * radius / std::max(1, count);
  }
}

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
  out.cell_m = options.cell_m > 0 ? options.cell_m : std::max(3 * sigma, diagonal / 120);

  Grid grid(clouds, out.cell_m);
  if (options.cell_m == 0)  // sparse points need wider cells
    while (double(points) < 6.0 * double(grid.bins().size()) && out.cell_m < 0.1 * diagonal)
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
  if (options.support) {
    const auto bottom = down_to(*options.support, facets, out.cell_m);
    for (const Facet& f : bottom) out.support_area_m2 += f.area_m2;
    facets.insert(facets.end(), bottom.begin(), bottom.end());
  }
  // equilateral triangles
  out.facets.vertices_m.resize(3 * static_cast<Index>(facets.size()), 3);
  out.facets.triangles.resize(static_cast<Index>(facets.size()), 3);
  for (Index i = 0; i < static_cast<Index>(facets.size()); ++i) {
    const Facet& f = facets[i];
    const auto [u, v] = tangents(f.normal);
    const double radius = std::sqrt(f.area_m2 / (0.75 * std::sqrt(3.0)));
    for (int k = 0; k < 3; ++k) {
      const double angle = 2 * M_PI * k / 3 + 1.7 * i;
      out.facets.vertices_m.row(3 * i + k) = (f.middle + radius * (std::cos(angle) * u + std::sin(angle) * v)).transpose();
    }
    out.facets.triangles.row(i) << 3 * i, 3 * i + 1, 3 * i + 2;
  }
  return out;
}

}  // namespace palpate::reconstruction
