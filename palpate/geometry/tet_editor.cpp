// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/tet_editor.hpp"

#include <algorithm>

#include "palpate/geometry/tet_quality.hpp"
#include "palpate/geometry/triangle_distance.hpp"

namespace palpate::geometry {
namespace {

constexpr std::array<std::array<int, 3>, 4> faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

bool has(const TetEditor::Tet& t, Index v) { return t[0] == v || t[1] == v || t[2] == v || t[3] == v; }
int place(const TetEditor::Tet& t, Index v) { return static_cast<int>(std::find(t.begin(), t.end(), v) - t.begin()); }

using Pair = std::pair<Index, Index>;
Pair ordered(Index a, Index b) { return {std::min(a, b), std::max(a, b)}; }

template <class T>
void sort_unique(std::vector<T>& v) {
  std::sort(v.begin(), v.end());
  v.erase(std::unique(v.begin(), v.end()), v.end());
}

}  // namespace

TetEditor::TetEditor(std::vector<Vec3> points, const std::vector<Tet>& list) : x(std::move(points)) {
  boundary.assign(x.size(), 0);
  size_m.assign(x.size(), 0);
  drift_m.assign(x.size(), 0);
  star.resize(x.size());
  for (const Tet& t : list) add(t);
  for (const Tri& t : all_boundary_triangles())
    for (const Index v : t) boundary[v] = 1;
}

double TetEditor::volume_m3() const {
  double six = 0;
  for (std::size_t i = 0; i < tets.size(); ++i) {
    if (!alive[i]) continue;
    const Vec3& a = x[tets[i][0]];
    six += (x[tets[i][1]] - a).cross(x[tets[i][2]] - a).dot(x[tets[i][3]] - a);
  }
  return six / 6;
}

void TetEditor::measure_sizes() {
  for (std::size_t v = 0; v < x.size(); ++v) {
    if (star[v].empty()) continue;
    const auto around = neighbours(static_cast<Index>(v));
    double sum = 0;
    for (const Index w : around) sum += (x[v] - x[w]).norm();
    size_m[v] = sum / double(around.size());
    drift_m[v] = 0;
  }
}

double TetEditor::quality_of(const Tet& t) const { return tet_quality(x[t[0]], x[t[1]], x[t[2]], x[t[3]]); }

Index TetEditor::add(const Tet& t) {
  Index id;
  if (free_.empty()) {
    id = static_cast<Index>(tets.size());
    tets.push_back(t);
    alive.push_back(1);
    quality.push_back(0);
  } else {
    id = free_.back();
    free_.pop_back();
    tets[id] = t;
    alive[id] = 1;
  }
  quality[id] = quality_of(t);
  for (const Index v : t) star[v].push_back(id);
  ++count_;
  return id;
}

void TetEditor::remove(Index t) {
  alive[t] = 0;
  for (const Index v : tets[t]) {
    auto& s = star[v];
    *std::find(s.begin(), s.end(), t) = s.back();
    s.pop_back();
  }
  free_.push_back(t);
  --count_;
}

double TetEditor::star_quality(Index v) const {
  double q = 1;
  for (const Index t : star[v]) q = std::min(q, quality[t]);
  return q;
}

double TetEditor::star_quality_at(Index v, const Vec3& at, double enough) const {
  double q = 1;
  for (const Index id : star[v]) {
    const Tet& t = tets[id];
    q = std::min(q, tet_quality(t[0] == v ? at : x[t[0]], t[1] == v ? at : x[t[1]], t[2] == v ? at : x[t[2]],
                                t[3] == v ? at : x[t[3]]));
    if (q <= enough) return q;
  }
  return q;
}

void TetEditor::move(Index v, const Vec3& at) {
  x[v] = at;
  for (const Index t : star[v]) quality[t] = quality_of(tets[t]);
}

std::vector<Index> TetEditor::edge_tets(Index a, Index b) const {
  std::vector<Index> out;
  for (const Index t : star[a])
    if (has(tets[t], b)) out.push_back(t);
  return out;
}

std::vector<Index> TetEditor::neighbours(Index v) const {
  std::vector<Index> out;
  out.reserve(4 * star[v].size());
  for (const Index t : star[v])
    for (const Index w : tets[t])
      if (w != v) out.push_back(w);
  sort_unique(out);
  return out;
}

bool TetEditor::is_boundary_face(Index a, Index b, Index c) const {
  int n = 0;
  for (const Index t : star[a]) n += has(tets[t], b) && has(tets[t], c);
  return n == 1;
}

std::vector<TetEditor::Tri> TetEditor::boundary_triangles(Index v) const {
  std::vector<Tri> out;
  if (!boundary[v]) return out;
  for (const Index id : star[v]) {
    const Tet& t = tets[id];
    const int at = place(t, v);
    for (int k = 0; k < 4; ++k) {
      if (k == at) continue;
      Tri f{t[faces[k][0]], t[faces[k][1]], t[faces[k][2]]};
      if (!boundary[f[0]] || !boundary[f[1]] || !boundary[f[2]] || !is_boundary_face(f[0], f[1], f[2])) continue;
      while (f[0] != v) std::rotate(f.begin(), f.begin() + 1, f.end());
      out.push_back(f);
    }
  }
  return out;
}

std::vector<TetEditor::Tri> TetEditor::all_boundary_triangles() const {
  struct Face {
    Tri key, tri;
  };
  std::vector<Face> all;
  all.reserve(4 * count_);
  for (std::size_t i = 0; i < tets.size(); ++i) {
    if (!alive[i]) continue;
    for (const auto& f : faces) {
      const Tri tri{tets[i][f[0]], tets[i][f[1]], tets[i][f[2]]};
      Tri key = tri;
      std::sort(key.begin(), key.end());
      all.push_back({key, tri});
    }
  }
  std::sort(all.begin(), all.end(), [](const Face& a, const Face& b) { return a.key < b.key; });
  std::vector<Tri> out;
  for (std::size_t i = 0; i < all.size();) {
    std::size_t j = i;
    while (j < all.size() && all[j].key == all[i].key) ++j;
    if (j - i == 1) out.push_back(all[i].tri);
    i = j;
  }
  return out;
}

Vec3 TetEditor::boundary_normal(Index v) const {
  Vec3 n = Vec3::Zero();
  for (const Tri& t : boundary_triangles(v)) n += (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
  const double l = n.norm();
  return l > 0 ? Vec3(n / l) : Vec3(Vec3::Zero());
}

bool TetEditor::joined(Index a, Index b) const {
  return std::any_of(star[a].begin(), star[a].end(), [&](Index t) { return has(tets[t], b); });
}

bool TetEditor::link_condition(Index a, Index b, const std::vector<Index>& ring) const {
  // Dey, Edelsbrunner, Guha, Nekhayev 1999, with the outside as one more vertex that is joined to every boundary face
  std::vector<Index> ring_vertices;
  std::vector<Pair> ring_edges;
  for (const Index id : ring) {
    Index u = -1, v = -1;
    for (const Index w : tets[id])
      if (w != a && w != b) (u < 0 ? u : v) = w;
    ring_vertices.insert(ring_vertices.end(), {u, v});
    ring_edges.push_back(ordered(u, v));
  }
  sort_unique(ring_vertices);
  const auto na = neighbours(a), nb = neighbours(b);
  std::vector<Index> common;
  std::set_intersection(na.begin(), na.end(), nb.begin(), nb.end(), std::back_inserter(common));
  if (common != ring_vertices) return false;
  const auto link_edges = [&](Index v) {
    std::vector<Pair> e;
    e.reserve(3 * star[v].size());
    for (const Index id : star[v]) {
      std::array<Index, 3> o;
      int n = 0;
      for (const Index w : tets[id])
        if (w != v) o[n++] = w;
      for (const auto& [p, q] : {Pair{o[0], o[1]}, {o[1], o[2]}, {o[2], o[0]}})
        if (std::binary_search(common.begin(), common.end(), p) && std::binary_search(common.begin(), common.end(), q))
          e.push_back(ordered(p, q));
    }
    sort_unique(e);
    return e;
  };
  const auto ea = link_edges(a), eb = link_edges(b);
  std::vector<Pair> both;
  std::set_intersection(ea.begin(), ea.end(), eb.begin(), eb.end(), std::back_inserter(both));
  sort_unique(ring_edges);
  if (both != ring_edges) return false;
  if (!boundary[a] || !boundary[b]) return true;
  // both on the boundary: so must be their edge, and they may share no more boundary neighbours than its two triangles have
  std::vector<Index> ba, bb;
  std::vector<Pair> la, lb;
  for (const Tri& t : boundary_triangles(a)) ba.insert(ba.end(), {t[1], t[2]}), la.push_back(ordered(t[1], t[2]));
  for (const Tri& t : boundary_triangles(b)) bb.insert(bb.end(), {t[1], t[2]}), lb.push_back(ordered(t[1], t[2]));
  sort_unique(ba), sort_unique(bb), sort_unique(la), sort_unique(lb);
  if (!std::binary_search(ba.begin(), ba.end(), b)) return false;
  std::vector<Index> shared;
  std::set_intersection(ba.begin(), ba.end(), bb.begin(), bb.end(), std::back_inserter(shared));
  if (shared.size() != 2) return false;
  std::vector<Pair> shared_edges;
  std::set_intersection(la.begin(), la.end(), lb.begin(), lb.end(), std::back_inserter(shared_edges));
  return shared_edges.empty();
}

bool TetEditor::collapse(Index gone, Index kept, double above, const Accept& accept, double most_drift_m) {
  if (boundary[gone] && !boundary[kept]) return false;
  std::vector<Index> ring;
  std::vector<Tet> fresh;
  for (const Index id : star[gone]) {
    if (has(tets[id], kept)) {
      ring.push_back(id);
      continue;
    }
    Tet t = tets[id];
    t[place(t, gone)] = kept;
    if (quality_of(t) <= above) return false;
    fresh.push_back(t);
  }
  if (ring.empty() || fresh.empty() || !link_condition(gone, kept, ring)) return false;
  if (boundary[gone]) {
    const auto before = boundary_triangles(gone);
    std::vector<Tri> after;
    for (Tri t : before) {
      if (t[1] == kept || t[2] == kept) continue;
      t[0] = kept;
      after.push_back(t);
    }
    double nearest = std::numeric_limits<double>::infinity();
    for (const Tri& t : after)
      nearest = std::min(nearest, std::sqrt(squared_distance_to_triangle(x[gone], x[t[0]], x[t[1]], x[t[2]])));
    // a thin tip must not be eaten up by many small bites
    const double drift = std::max(drift_m[kept], drift_m[gone] + nearest);
    if (drift > most_drift_m) return false;
    if (accept && !accept(before, after)) return false;
    drift_m[kept] = drift;
  }
  const std::vector<Index> old = star[gone];
  for (const Index id : old) remove(id);
  for (const Tet& t : fresh) add(t);
  return true;
}

bool TetEditor::remove_edge(Index a, Index b, const Accept& accept) {
  constexpr int most = 9;
  const std::vector<Index> around = edge_tets(a, b);
  const int n = static_cast<int>(around.size());
  if (n < 1 || n > most) return false;
  if (n == 1) return peel(around[0], a, b, accept);
  double old = 1;
  // ring[i] -> ring[i + 1] runs so that (a, b, ring[i], ring[i + 1]) is positive
  std::array<Pair, most> links;
  for (int i = 0; i < n; ++i) {
    old = std::min(old, quality[around[i]]);
    const Tet& t = tets[around[i]];
    const int ia = place(t, a), ib = place(t, b);
    int p = -1, q = -1;
    for (int k = 0; k < 4; ++k)
      if (k != ia && k != ib) (p < 0 ? p : q) = k;
    // even permutation of (ia, ib, p, q) keeps the sign
    const std::array<int, 4> order{ia, ib, p, q};
    int inversions = 0;
    for (int u = 0; u < 4; ++u)
      for (int v = u + 1; v < 4; ++v) inversions += order[u] > order[v];
    links[i] = inversions % 2 == 0 ? Pair{t[p], t[q]} : Pair{t[q], t[p]};
  }
  std::vector<Index> ring;
  Index start = links[0].first;
  bool open = false;
  for (int i = 0; i < n; ++i) {  // an open chain starts where nothing leads to
    bool reached = false;
    for (int j = 0; j < n; ++j) reached |= links[j].second == links[i].first;
    if (!reached) start = links[i].first, open = true;
  }
  ring.push_back(start);
  for (int i = 0; i < n; ++i) {
    int next = -1;
    for (int j = 0; j < n; ++j)
      if (links[j].first == ring.back()) next = j;
    if (next < 0) return false;  // several fans around the edge
    ring.push_back(links[next].second);
  }
  if (!open) {
    if (ring.back() != ring.front()) return false;
    ring.pop_back();
  }
  const int m = static_cast<int>(ring.size());
  if (m < 3 || (open && m != n + 1)) return false;
  if (open && joined(ring.front(), ring.back())) return false;
  // best[i][j]: best triangulation of the polygon ring[i..j] (Klincsek 1980)
  double best[most + 1][most + 1];
  int cut[most + 1][most + 1];
  const auto pair_quality = [&](int i, int k, int j) {
    const double lower = tet_quality(x[a], x[ring[i]], x[ring[k]], x[ring[j]]);
    if (lower <= old) return lower;
    return std::min(lower, tet_quality(x[b], x[ring[i]], x[ring[j]], x[ring[k]]));
  };
  for (int i = m - 2; i >= 0; --i)
    for (int j = i + 1; j < m; ++j) {
      if (j == i + 1) {
        best[i][j] = 1;
        continue;
      }
      best[i][j] = -2;
      cut[i][j] = -1;
      for (int k = i + 1; k < j; ++k) {
        double q = std::min(best[i][k], best[k][j]);
        if (q <= best[i][j] || q <= old) continue;
        q = std::min(q, pair_quality(i, k, j));
        if (q > best[i][j]) best[i][j] = q, cut[i][j] = k;
      }
    }
  if (best[0][m - 1] <= old + 1e-9) return false;
  if (open && accept) {
    const Index f = ring.front(), l = ring.back();
    const std::vector<Tri> before{{b, a, f}, {a, b, l}}, after{{a, f, l}, {b, l, f}};
    if (!accept(before, after)) return false;
  }
  std::vector<std::array<int, 2>> pending{{0, m - 1}};
  std::vector<std::array<int, 3>> chosen;
  while (!pending.empty()) {
    const auto [i, j] = pending.back();
    pending.pop_back();
    if (j < i + 2) continue;
    // where a thin part overlaps itself these two may be joined elsewhere: two fans at one edge would be no manifold
    if (!(i == 0 && j == m - 1) && joined(ring[i], ring[j])) return false;
    chosen.push_back({i, cut[i][j], j});
    pending.push_back({i, cut[i][j]});
    pending.push_back({cut[i][j], j});
  }
  for (const Index id : around) remove(id);
  for (const auto& [i, k, j] : chosen) {
    add({a, ring[i], ring[k], ring[j]});
    add({b, ring[i], ring[j], ring[k]});
  }
  return true;
}

bool TetEditor::peel(Index id, Index a, Index b, const Accept& accept) {
  // both faces at the edge are boundary; the far edge and the two other faces become boundary and must not be so yet
  const Tet t = tets[id];
  const int ia = place(t, a), ib = place(t, b);
  const Tri fa{t[faces[ia][0]], t[faces[ia][1]], t[faces[ia][2]]}, fb{t[faces[ib][0]], t[faces[ib][1]], t[faces[ib][2]]};
  if (is_boundary_face(fa[0], fa[1], fa[2]) || is_boundary_face(fb[0], fb[1], fb[2])) return false;
  Index p = -1, q = -1;
  for (const Index v : t)
    if (v != a && v != b) (p < 0 ? p : q) = v;
  if (!boundary[p] || !boundary[q]) return false;
  for (const Tri& f : boundary_triangles(p))
    if (f[1] == q || f[2] == q) return false;
  std::vector<Tri> before, after;
  for (const int k : {place(t, p), place(t, q)}) before.push_back({t[faces[k][0]], t[faces[k][1]], t[faces[k][2]]});
  for (const Tri& f : {fa, fb}) after.push_back({f[0], f[2], f[1]});
  if (accept && !accept(before, after)) return false;
  remove(id);
  return true;
}

bool TetEditor::remove_face(Index tet, int opposite) {
  const Tet t = tets[tet];
  const Index d = t[opposite];
  const Tri f{t[faces[opposite][0]], t[faces[opposite][1]], t[faces[opposite][2]]};  // outward from d
  Index other = -1;
  for (const Index id : star[f[0]])
    if (id != tet && has(tets[id], f[1]) && has(tets[id], f[2])) other = id;
  if (other < 0) return false;
  Index e = -1;
  for (const Index v : tets[other])
    if (v != f[0] && v != f[1] && v != f[2]) e = v;
  if (joined(d, e)) return false;
  const double old = std::min(quality[tet], quality[other]);
  std::array<Tet, 3> fresh;
  for (int k = 0; k < 3; ++k) {
    fresh[k] = {d, f[k], f[(k + 1) % 3], e};
    if (quality_of(fresh[k]) <= old + 1e-9) return false;
  }
  remove(tet);
  remove(other);
  for (const Tet& n : fresh) add(n);
  return true;
}

Index TetEditor::split_edge(Index a, Index b) {
  const auto around = edge_tets(a, b);
  // on the boundary when some face at the edge is
  bool outer = false;
  if (boundary[a] && boundary[b])
    for (const Tri& t : boundary_triangles(a)) outer |= t[1] == b || t[2] == b;
  const auto v = static_cast<Index>(x.size());
  x.push_back(0.5 * (x[a] + x[b]));
  boundary.push_back(outer);
  size_m.push_back(0.5 * (size_m[a] + size_m[b]));
  drift_m.push_back(0);
  star.emplace_back();
  for (const Index id : around) {
    Tet p = tets[id], q = p;
    p[place(p, b)] = v;
    q[place(q, a)] = v;
    remove(id);
    add(p);
    add(q);
  }
  return v;
}

void TetEditor::unsplit_edge(Index v, Index a, Index b) {
  std::vector<Tet> whole;
  for (const Index id : star[v])
    if (has(tets[id], a)) {
      whole.push_back(tets[id]);
      whole.back()[place(whole.back(), v)] = b;
    }
  while (!star[v].empty()) remove(star[v].back());
  for (const Tet& t : whole) add(t);
}

TetEditor::Pieces TetEditor::pieces() const {
  Pieces out;
  out.of.assign(tets.size(), -1);
  for (Index seed = 0; seed < static_cast<Index>(tets.size()); ++seed) {
    if (!alive[seed] || out.of[seed] >= 0) continue;
    const auto id = static_cast<Index>(out.volume_m3.size());
    out.volume_m3.push_back(0);
    std::vector<Index> pending{seed};
    out.of[seed] = id;
    while (!pending.empty()) {
      const Tet& t = tets[pending.back()];
      pending.pop_back();
      out.volume_m3.back() += (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]) / 6;
      for (const auto& f : faces)
        for (const Index n : star[t[f[0]]])
          if (out.of[n] < 0 && has(tets[n], t[f[1]]) && has(tets[n], t[f[2]])) {
            out.of[n] = id;
            pending.push_back(n);
          }
    }
  }
  return out;
}

TetMesh TetEditor::compact(std::vector<Index>* vertex_of) const {
  TetMesh out;
  std::vector<Index> to(x.size(), -1);
  Index n = 0;
  for (std::size_t v = 0; v < x.size(); ++v)
    if (!star[v].empty()) to[v] = n++;
  out.nodes_m.resize(n, 3);
  for (std::size_t v = 0; v < x.size(); ++v)
    if (to[v] >= 0) out.nodes_m.row(to[v]) = x[v].transpose();
  out.tetrahedra.resize(count_, 4);
  Index row = 0;
  for (std::size_t t = 0; t < tets.size(); ++t) {
    if (!alive[t]) continue;
    for (int k = 0; k < 4; ++k) out.tetrahedra(row, k) = to[tets[t][k]];
    ++row;
  }
  if (vertex_of != nullptr) *vertex_of = std::move(to);
  return out;
}

}  // namespace palpate::geometry
