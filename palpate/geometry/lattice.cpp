// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/lattice.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

namespace palpate::geometry {
namespace {

constexpr std::int64_t cell_units = 64;  // of one cube: five halvings of cubes and their middles stay whole numbers
constexpr std::int64_t offset = 1 << 20;

Eigen::Vector4d barycentric(const Vec3& p, const std::array<Vec3, 4>& x) {
  Mat3 m;
  m << x[1] - x[0], x[2] - x[0], x[3] - x[0];
  const Vec3 w = m.inverse() * (p - x[0]);
  return {1 - w.sum(), w.x(), w.y(), w.z()};
}

}  // namespace

SurfaceSamples sample_surface(const Solid& solid, int count) {
  const TriMesh& m = solid.surface();
  SurfaceSamples out;
  std::vector<double> cumulative(m.triangles.rows());
  double area = 0;
  const auto corner = [&](Index t, int k) { return Vec3(m.vertices_m.row(m.triangles(t, k)).transpose()); };
  for (Index t = 0; t < m.triangles.rows(); ++t) {
    area += 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm();
    cumulative[t] = area;
  }
  out.area_each_m2 = area / count;
  const Vec3 middle = 0.5 * (solid.min_m() + solid.max_m());
  out.evenly = 0;
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> u;
  std::size_t t = 0;
  for (int i = 0; i < count; ++i) {  // stratified: one sample a share of the area
    const double a = (i + u(rng)) * area / count;
    while (t + 1 < cumulative.size() && cumulative[t] < a) ++t;
    double v = u(rng), w = u(rng);
    if (v + w > 1) v = 1 - v, w = 1 - w;
    const auto id = static_cast<Index>(t);
    const Vec3 p = (1 - v - w) * corner(id, 0) + v * corner(id, 1) + w * corner(id, 2);
    const double share = solid.boundary_share(p, id);
    out.buried_m3 += (1 - share) * out.area_each_m2 / 3 * solid.normal(id).dot(p - middle);
    if (share == 0) continue;
    out.point.push_back(p);
    out.normal.push_back(solid.normal(id));
  }
  out.evenly = out.point.size();
  // small triangles of thin parts are easily missed by area alone
  const Index stride = std::max<Index>(1, static_cast<Index>(m.triangles.rows()) / count);
  for (Index id = 0; id < m.triangles.rows(); id += stride) {
    const Vec3 p = (corner(id, 0) + corner(id, 1) + corner(id, 2)) / 3;
    if (solid.boundary_share(p, id) == 0) continue;
    out.point.push_back(p);
    out.normal.push_back(solid.normal(id));
  }
  return out;
}

Index Lattice::vertex_at(const Cell& at) {
  const Key key = (Key(at[0] + offset) << 42) | (Key(at[1] + offset) << 21) | Key(at[2] + offset);
  const auto [it, fresh] = index_.try_emplace(key, static_cast<Index>(points_.size()));
  if (fresh) {
    const Vec3 p = origin_ + unit_m_ * Vec3(double(at[0]), double(at[1]), double(at[2]));
    cells_.push_back(at);
    points_.push_back(p);
    distances_.push_back(solid_.signed_distance(p));
    around_.emplace_back();
  }
  return it->second;
}

Index Lattice::add_tet(const Tet& t) {
  const auto id = static_cast<Index>(tets_.size());
  tets_.push_back(t);
  alive_.push_back(1);
  samples_.emplace_back();
  for (const Index v : t) around_[v].push_back(id);
  return id;
}

Lattice::Lattice(const Solid& solid, double cell_m) : solid_(solid), unit_m_(cell_m / double(cell_units)) {
  // an odd offset of the lattice keeps its planes off the planes of boxes and other man-made shapes
  const Vec3 extent = solid.max_m() - solid.min_m();
  std::array<int, 3> n;
  for (int k = 0; k < 3; ++k) {
    n[k] = static_cast<int>(std::floor(extent[k] / cell_m)) + 3;
    const double slack = n[k] * cell_m - extent[k];
    origin_[k] = solid.min_m()[k] - 0.5 * slack + (0.031 + 0.017 * k) * cell_m;
  }
  const auto corner = [&](int x, int y, int z) { return vertex_at({x * cell_units, y * cell_units, z * cell_units}); };
  const auto centre = [&](int x, int y, int z) {
    const auto half = cell_units / 2;
    return vertex_at({x * cell_units + half, y * cell_units + half, z * cell_units + half});
  };
  // around every face between two cubes: four tetrahedra of the two centres and one edge of the face
  std::array<int, 3> c;
  for (c[2] = 0; c[2] < n[2]; ++c[2])
    for (c[1] = 0; c[1] < n[1]; ++c[1])
      for (c[0] = 0; c[0] < n[0]; ++c[0])
        for (int axis = 0; axis < 3; ++axis) {
          if (c[axis] + 1 >= n[axis]) continue;
          std::array<int, 3> next = c;
          ++next[axis];
          const Index a = centre(c[0], c[1], c[2]), b = centre(next[0], next[1], next[2]);
          // all four lie within a cell of both centres
          if (std::min(distances_[a], distances_[b]) > 1.2 * cell_m) continue;
          const int u = (axis + 1) % 3, v = (axis + 2) % 3;
          std::array<Index, 4> ring;
          for (int k = 0; k < 4; ++k) {
            std::array<int, 3> p = next;
            p[u] += k == 1 || k == 2;
            p[v] += k >= 2;
            ring[k] = corner(p[0], p[1], p[2]);
          }
          for (int k = 0; k < 4; ++k) add_tet({a, b, ring[k], ring[(k + 1) % 4]});
        }
}

std::int64_t Lattice::edge2(Index a, Index b) const {
  std::int64_t s = 0;
  for (int k = 0; k < 3; ++k) s += (cells_[a][k] - cells_[b][k]) * (cells_[a][k] - cells_[b][k]);
  return s;
}

std::pair<int, int> Lattice::longest_edge(const Tet& t) const {
  std::pair<int, int> best{0, 1};
  std::int64_t longest = -1;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) {
      // an unrefined tetrahedron has two longest edges; the one between cube centres is bisected first
      const bool centres = cells_[t[i]][0] % cell_units != 0 && cells_[t[j]][0] % cell_units != 0;
      const std::int64_t l = 2 * edge2(t[i], t[j]) + centres;
      if (l > longest) longest = l, best = {i, j};
    }
  return best;
}

void Lattice::bisect(Index tet) {
  std::vector<Index> chain{tet};
  while (!chain.empty()) {
    const Index id = chain.back();
    if (!alive_[id]) {
      chain.pop_back();
      continue;
    }
    const auto [i, j] = longest_edge(tets_[id]);
    const Index a = tets_[id][i], b = tets_[id][j];
    std::vector<Index> around;
    Index first = -1;
    for (const Index t : around_[a]) {
      if (std::find(tets_[t].begin(), tets_[t].end(), b) == tets_[t].end()) continue;
      around.push_back(t);
      const auto [k, l] = longest_edge(tets_[t]);
      const auto edge = std::minmax(tets_[t][k], tets_[t][l]);
      if (edge != std::minmax(a, b)) first = t;
    }
    if (first >= 0) {
      chain.push_back(first);  // a neighbour must be bisected along its own longest edge before
    } else {
      split(a, b, around);
      chain.pop_back();
    }
  }
}

void Lattice::split(Index a, Index b, const std::vector<Index>& around) {
  Cell at;
  for (int k = 0; k < 3; ++k) at[k] = (cells_[a][k] + cells_[b][k]) / 2;
  const Index middle = vertex_at(at);
  for (const Index t : around) {
    alive_[t] = 0;
    const Tet old = tets_[t];
    for (const Index v : old) std::erase(around_[v], t);
    std::array<Index, 2> child;
    for (int side = 0; side < 2; ++side) {
      Tet half = old;
      *std::find(half.begin(), half.end(), side == 0 ? b : a) = middle;
      child[side] = add_tet(half);
    }
    if (sample_set_ == nullptr) continue;
    std::array<Vec3, 4> x;
    for (int k = 0; k < 4; ++k) x[k] = points_[old[k]];
    const auto ia = std::find(old.begin(), old.end(), a) - old.begin(),
               ib = std::find(old.begin(), old.end(), b) - old.begin();
    for (const Index s : samples_[t]) {
      const Eigen::Vector4d w = barycentric(sample_set_->point[s], x);
      samples_[child[w[ia] >= w[ib] ? 0 : 1]].push_back(s);
    }
    samples_[t] = {};
  }
}

bool Lattice::misses(Index tet) const {
  std::array<Vec3, 4> x;
  for (int k = 0; k < 4; ++k) x[k] = points_[tets_[tet][k]];
  const auto inside = std::count_if(tets_[tet].begin(), tets_[tet].end(), [&](Index v) { return distances_[v] < 0; });
  // a part that slips through between the lattice's points leaves only small distances behind: without a cut be stricter
  const double limit = inside == 0 || inside == 4 ? 0.25 * tolerance_m_ : tolerance_m_;
  for (const Index s : samples_[tet]) {
    const Eigen::Vector4d w = barycentric(sample_set_->point[s], x);
    double d = 0;
    for (int k = 0; k < 4; ++k) d += w[k] * distances_[tets_[tet][k]];
    if (std::abs(d) > limit) return true;
  }
  if (!solid_.watertight()) return false;  // over a hole the surface is nowhere near
  // the cut's own middle, which shows a gap that the lattice bridges
  Vec3 sum = Vec3::Zero();
  int n = 0;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) {
      const double a = distances_[tets_[tet][i]], b = distances_[tets_[tet][j]];
      if ((a < 0) == (b < 0)) continue;
      sum += x[i] + a / (a - b) * (x[j] - x[i]);
      ++n;
    }
  return n > 0 && solid_.closest(sum / n).squared_distance_m2 > tolerance_m_ * tolerance_m_;
}

bool Lattice::refine_to_surface(const SurfaceSamples& samples, double tolerance_m, double smallest_edge_m,
                                std::size_t most) {
  sample_set_ = &samples;
  tolerance_m_ = tolerance_m;
  // into the tetrahedra: the cubes of the lattice's corners are searched over their middles' four by three tetrahedra
  std::unordered_map<Key, std::vector<Index>> bins;
  const double cell = unit_m_ * double(cell_units);
  const auto bin = [&](const Vec3& p) {
    Key key = 0;
    for (int k = 0; k < 3; ++k) key = (key << 21) | Key(std::int64_t(std::floor((p[k] - origin_[k]) / cell)) + 64);
    return key;
  };
  for (Index t = 0; t < static_cast<Index>(tets_.size()); ++t) {
    if (!alive_[t]) continue;
    Box b;
    for (const Index v : tets_[t]) b.add(points_[v]);
    const double e = 1e-6 * cell;
    std::array<Key, 8> keys;
    for (int c = 0; c < 8; ++c) {
      Vec3 p;
      for (int k = 0; k < 3; ++k) p[k] = (c >> k) & 1 ? b.max[k] - e : b.min[k] + e;
      keys[c] = bin(p);
    }
    std::sort(keys.begin(), keys.end());
    const auto end = std::unique(keys.begin(), keys.end());
    for (auto key = keys.begin(); key != end; ++key) bins[*key].push_back(t);
  }
  for (Index s = 0; s < static_cast<Index>(samples.point.size()); ++s) {
    Index best = -1;
    double largest = -1e-6;
    for (const Index t : bins[bin(samples.point[s])]) {
      std::array<Vec3, 4> x;
      for (int k = 0; k < 4; ++k) x[k] = points_[tets_[t][k]];
      const double least = barycentric(samples.point[s], x).minCoeff();
      if (least > largest) largest = least, best = t;
      if (least >= 0) break;
    }
    if (best >= 0) samples_[best].push_back(s);
  }
  for (Index t = 0; t < static_cast<Index>(tets_.size()); ++t) {  // grows while it runs
    if (!alive_[t]) continue;
    const auto [i, j] = longest_edge(tets_[t]);
    if (0.5 * unit_m_ * std::sqrt(double(edge2(tets_[t][i], tets_[t][j]))) < smallest_edge_m) continue;
    if (!misses(t)) continue;
    if (points_.size() > most / 5) return false;  // five to six tetrahedra a point
    bisect(t);
  }
  sample_set_ = nullptr;
  for (auto& s : samples_) s.clear();
  return true;
}

void Lattice::refine_to_size(const std::function<double(const Vec3&)>& longest_edge_m) {
  for (Index t = 0; t < static_cast<Index>(tets_.size()); ++t) {
    while (alive_[t]) {
      const auto [i, j] = longest_edge(tets_[t]);
      const std::int64_t l2 = edge2(tets_[t][i], tets_[t][j]);
      Vec3 middle = Vec3::Zero();
      for (const Index v : tets_[t]) middle += 0.25 * points_[v];
      if (unit_m_ * std::sqrt(double(l2)) <= longest_edge_m(middle) || l2 <= 16) break;
      bisect(t);
    }
  }
}

std::vector<Lattice::Tet> Lattice::tetrahedra() const {
  std::vector<Tet> out;
  for (std::size_t t = 0; t < tets_.size(); ++t)
    if (alive_[t]) out.push_back(tets_[t]);
  return out;
}

}  // namespace palpate::geometry
