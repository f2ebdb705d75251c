// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/solid.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "palpate/core/error.hpp"
#include "palpate/geometry/hole_covers.hpp"

namespace palpate::geometry {
namespace {

struct Side {
  Index low, high, triangle;
  bool ascending;
};

std::vector<Side> sorted_sides(const Triangles& t) {
  std::vector<Side> s;
  s.reserve(3 * t.rows());
  for (Index i = 0; i < t.rows(); ++i)
    for (int k = 0; k < 3; ++k) {
      const Index a = t(i, k), b = t(i, (k + 1) % 3);
      s.push_back({std::min(a, b), std::max(a, b), i, a < b});
    }
  std::sort(s.begin(), s.end(), [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  return s;
}

/// Drops what parts have in common, copies (in either orientation) and triangles without area.
TriMesh cleaned(const TriMesh& mesh) {
  TriMesh out = weld(mesh);
  const std::vector<char> again = copies(out.triangles), shared = shared_faces(out.triangles);
  Index kept = 0;
  for (Index i = 0; i < out.triangles.rows(); ++i) {
    const std::array<Index, 3> key{out.triangles(i, 0), out.triangles(i, 1), out.triangles(i, 2)};
    const Vec3 a = out.vertices_m.row(key[0]).transpose(), b = out.vertices_m.row(key[1]).transpose(),
               c = out.vertices_m.row(key[2]).transpose();
    const double longest2 = std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
    if (!((b - a).cross(c - a).norm() > 1e-12 * longest2)) continue;
    if (again[i] || shared[i]) continue;
    out.triangles.row(kept++) = Eigen::Matrix<Index, 1, 3>(out.triangles.row(i));
  }
  out.triangles.conservativeResize(kept, 3);
  return out;
}

double signed_volume(const TriMesh& m) {
  const Eigen::RowVector3d middle = m.vertices_m.colwise().mean();
  double v = 0;
  for (Index i = 0; i < m.triangles.rows(); ++i) {
    const Vec3 a = (m.vertices_m.row(m.triangles(i, 0)) - middle).transpose(),
               b = (m.vertices_m.row(m.triangles(i, 1)) - middle).transpose(),
               c = (m.vertices_m.row(m.triangles(i, 2)) - middle).transpose();
    v += a.dot(b.cross(c)) / 6;
  }
  return v;
}

/// Votes of rays from both sides of some triangles of a patch; positive: oriented outward.
int outward_votes(const TriangleTree& tree, const std::vector<Index>& patch, double offset, std::mt19937& rng) {
  const TriMesh& m = tree.mesh();
  std::normal_distribution<double> g;
  const auto count = std::min<std::size_t>(4, patch.size());
  const int rays = count == 1 ? 14 : 8;
  int votes = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Index t = patch[i * patch.size() / count];
    const Vec3 a = m.vertices_m.row(m.triangles(t, 0)).transpose(), b = m.vertices_m.row(m.triangles(t, 1)).transpose(),
               c = m.vertices_m.row(m.triangles(t, 2)).transpose();
    const Vec3 n = (b - a).cross(c - a).normalized(), middle = (a + b + c) / 3;
    for (int r = 0; r < rays; ++r) {
      Vec3 d(g(rng), g(rng), g(rng));
      for (const int side : {1, -1}) {
        // each ray starts on its side and leaves the triangle behind
        if (side * d.dot(n) < 0) d = -d;
        const bool within = tree.crossings(middle + side * offset * n, d) % 2 == 1;
        votes += within == (side < 0) ? 1 : -1;
      }
    }
  }
  return votes;
}

/// Every edge is run along as often in one direction as in the other: the winding number is then a whole number everywhere,
/// though more than two triangles may meet at an edge (as a lid does with a triangle beside it).
bool closed(const std::vector<Side>& sides) {
  for (std::size_t i = 0; i < sides.size();) {
    int balance = 0;
    std::size_t j = i;
    for (; j < sides.size() && sides[j].low == sides[i].low && sides[j].high == sides[i].high; ++j)
      balance += sides[j].ascending ? 1 : -1;
    if (balance != 0) return false;
    i = j;
  }
  return !sides.empty();
}

/// A closed part that faces inward is the wall of a cavity where another part surrounds it. Elsewhere it was written inside out, and
/// would be carved away.
Index turn_parts(TriMesh& mesh, const std::vector<std::vector<Index>>& patches) {
  constexpr std::size_t most_asked = 200;
  Index turned = 0;
  for (const auto& patch : patches) {
    TriMesh part{mesh.vertices_m, mesh.triangles(patch, Eigen::all)};
    if (signed_volume(part) >= 0 || !closed(sorted_sides(part.triangles))) continue;
    std::vector<char> own(static_cast<std::size_t>(mesh.triangles.rows()), 0);
    for (const Index i : patch) own[static_cast<std::size_t>(i)] = 1;
    std::vector<Index> rest;
    for (Index i = 0; i < mesh.triangles.rows(); ++i)
      if (own[static_cast<std::size_t>(i)] == 0) rest.push_back(i);
    const WindingNumber around(TriMesh{mesh.vertices_m, mesh.triangles(rest, Eigen::all)});
    const std::size_t asked = std::min(most_asked, patch.size());
    std::size_t surrounded = 0;
    for (std::size_t k = 0; k < asked; ++k) {
      const auto corners = mesh.triangles.row(patch[k * patch.size() / asked]);
      const Vec3 middle = (mesh.vertices_m.row(corners(0)) + mesh.vertices_m.row(corners(1)) + mesh.vertices_m.row(corners(2))).transpose() / 3;
      surrounded += around(middle) > 0.5 ? 1 : 0;
    }
    if (surrounded == asked) continue;
    for (const Index i : patch) std::swap(mesh.triangles(i, 1), mesh.triangles(i, 2));
    turned += static_cast<Index>(patch.size());
  }
  return turned;
}

void close_holes(OrientedSurface& s, const std::vector<std::array<Index, 3>>& open) {
  HoleCovers covers = cover_holes(s.mesh, open);
  const auto first = s.mesh.triangles.rows();
  s.mesh.triangles.conservativeResize(first + static_cast<Eigen::Index>(covers.triangles.size()), 3);
  for (std::size_t i = 0; i < covers.triangles.size(); ++i)
    s.mesh.triangles.row(first + static_cast<Eigen::Index>(i)) = covers.triangles[i];
  s.cover_width_m = std::move(covers.width_m);
  s.closed = closed(sorted_sides(s.mesh.triangles));
}

}  // namespace

OrientedSurface orient(const TriMesh& mesh) {
  OrientedSurface out;
  out.mesh = cleaned(mesh);
  Triangles& t = out.mesh.triangles;
  const auto n = static_cast<Index>(t.rows());
  out.dropped = static_cast<Index>(mesh.triangles.rows()) - n;
  if (n == 0) return out;

  const auto sides = sorted_sides(t);
  struct Neighbour {
    Index triangle;
    bool same_way;  ///< both run along the edge in the same direction: one of them is flipped
  };
  std::vector<std::array<Neighbour, 3>> neighbours(n, {Neighbour{-1, false}, {-1, false}, {-1, false}});
  std::vector<int> count(n, 0);
  Index inconsistent = 0;
  std::vector<std::array<Index, 3>> open;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t j = i;
    while (j < sides.size() && sides[j].low == sides[i].low && sides[j].high == sides[i].high) ++j;
    if (j - i == 1) open.push_back({sides[i].low, sides[i].high, sides[i].triangle});
    if (j - i == 2) {
      const bool same = sides[i].ascending == sides[i + 1].ascending;
      inconsistent += same;
      neighbours[sides[i].triangle][count[sides[i].triangle]++] = {sides[i + 1].triangle, same};
      neighbours[sides[i + 1].triangle][count[sides[i + 1].triangle]++] = {sides[i].triangle, same};
    }
    i = j;
  }
  std::vector<int> flip(n, -1);
  std::vector<std::vector<Index>> patches;
  for (Index seed = 0; seed < n; ++seed) {
    if (flip[seed] >= 0) continue;
    flip[seed] = 0;
    std::vector<Index> patch{seed};
    for (std::size_t i = 0; i < patch.size(); ++i)
      for (int k = 0; k < count[patch[i]]; ++k) {
        const auto [other, same] = neighbours[patch[i]][k];
        if (flip[other] >= 0) continue;
        flip[other] = same ? 1 - flip[patch[i]] : flip[patch[i]];
        patch.push_back(other);
      }
    patches.push_back(std::move(patch));
  }
  out.patches = static_cast<Index>(patches.size());
  const auto turn = [&](Index i) { std::swap(t(i, 1), t(i, 2)); };
  if (inconsistent == 0) {
    if (signed_volume(out.mesh) < 0) {
      for (Index i = 0; i < n; ++i) turn(i);
      out.flipped = n;
    }
    if (out.closed = closed(sides); !out.closed) close_holes(out, open);
    else if (patches.size() > 1) out.flipped += turn_parts(out.mesh, patches);
    return out;
  }
  for (Index i = 0; i < n; ++i)
    if (flip[i] == 1) turn(i);
  const double diagonal = (out.mesh.vertices_m.colwise().maxCoeff() - out.mesh.vertices_m.colwise().minCoeff()).norm();
  const TriangleTree tree(out.mesh);
  std::mt19937 rng(20100);
  for (const auto& patch : patches) {
    const bool outward = outward_votes(tree, patch, 1e-6 * diagonal, rng) >= 0;
    for (const Index i : patch) {
      if (!outward) turn(i);
      out.flipped += (flip[i] == 1) != !outward;
    }
  }
  close_holes(out, open);
  return out;
}

namespace {
OrientedSurface checked(OrientedSurface s) {
  if (s.mesh.triangles.rows() == 0)
    throw Error("no triangle with an area is left after removing copies; there is no surface to build on", "surface");
  return s;
}
}  // namespace

Solid::Solid(const TriMesh& soup)
    : oriented_(checked(orient(soup))), tree_(std::move(oriented_.mesh)), winding_(tree_.mesh(), tree_.bvh()) {
  const TriMesh& m = tree_.mesh();
  normals_.resize(m.triangles.rows(), 3);
  min_m_.setConstant(std::numeric_limits<double>::infinity());
  max_m_ = -min_m_;
  for (Index i = 0; i < m.triangles.rows(); ++i) {
    const Vec3 a = m.vertices_m.row(m.triangles(i, 0)).transpose(), b = m.vertices_m.row(m.triangles(i, 1)).transpose(),
               c = m.vertices_m.row(m.triangles(i, 2)).transpose();
    const Vec3 n = (b - a).cross(c - a);
    normals_.row(i) = n.normalized().transpose();
    area_m2_ += 0.5 * n.norm();
    min_m_ = min_m_.cwiseMin(a).cwiseMin(b).cwiseMin(c);
    max_m_ = max_m_.cwiseMax(a).cwiseMax(b).cwiseMax(c);
  }
  diagonal_m_ = (max_m_ - min_m_).norm();
  watertight_ = oriented_.closed;
  volume_m3_ = signed_volume(m);
}

double Solid::signed_distance(const Vec3& p) const {
  const double d = std::sqrt(tree_.closest(p).squared_distance_m2);
  return inside(p) ? -d : d;
}

double Solid::leaves(const Vec3& from, const Vec3& to) const {
  // one crossing is the answer; none (a hole) or several are settled by the winding number
  if (const auto first = tree_.cast(from, to - from, 1.0)) {
    if (const auto last = tree_.cast(to, from - to, 1.0); last && first->range_m + last->range_m > 1 - 1e-9)
      return first->range_m;
  }
  double a = 0, b = 1;
  for (int i = 0; i < 12; ++i) {
    const double middle = 0.5 * (a + b);
    (inside(from + middle * (to - from)) ? a : b) = middle;
  }
  return 0.5 * (a + b);
}

double Solid::boundary_share(const Vec3& p, Index triangle) const {
  const double mean = winding_.without(p, triangle);
  if (!watertight_ || std::abs(mean - 0.5) < 0.25) return mean > 0 && mean < 1 ? 1 : 0;
  // hidden, or a triangle in the same plane adds one half to either side: the sides themselves tell
  const double step = 1e-5 * diagonal_m_;
  const double behind = winding_(p - step * normal(triangle)), before = winding_(p + step * normal(triangle));
  return behind > 0.5 && before < 0.5 ? 1 / std::max(1.0, std::round(behind - before)) : 0;
}

}  // namespace palpate::geometry
