// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/lattice_cut.hpp"

#include <algorithm>
#include <unordered_map>

namespace palpate::geometry {
namespace {

using Tet = TetEditor::Tet;

/// Three tetrahedra of a prism (triangles v0 v1 v2 and v3 v4 v5 above them); every quadrilateral is cut from its smallest
/// index, so that neighbours agree (Dompierre et al. 1999).
void add_prism(std::array<Index, 6> v, std::vector<Tet>& out) {
  static constexpr std::array<std::array<int, 6>, 6> turns{{{0, 1, 2, 3, 4, 5},
                                                            {1, 2, 0, 4, 5, 3},
                                                            {2, 0, 1, 5, 3, 4},
                                                            {3, 5, 4, 0, 2, 1},
                                                            {4, 3, 5, 1, 0, 2},
                                                            {5, 4, 3, 2, 1, 0}}};
  const auto first = std::min_element(v.begin(), v.end()) - v.begin();
  std::array<Index, 6> w;
  for (int k = 0; k < 6; ++k) w[k] = v[turns[first][k]];
  if (std::min(w[1], w[5]) < std::min(w[2], w[4])) {
    out.insert(out.end(), {{w[0], w[1], w[2], w[5]}, {w[0], w[1], w[5], w[4]}, {w[0], w[4], w[5], w[3]}});
  } else {
    out.insert(out.end(), {{w[0], w[1], w[2], w[4]}, {w[0], w[4], w[2], w[5]}, {w[0], w[4], w[5], w[3]}});
  }
}

}  // namespace

TetEditor cut_lattice(const Lattice& lattice, const Solid& solid) {
  const auto& p = lattice.points();
  const auto& d = lattice.distances();
  const std::vector<Tet> all = lattice.tetrahedra();
  std::vector<Vec3> x;
  std::vector<Index> vertex_of(p.size(), -1);
  std::vector<double> edge_sum(p.size(), 0);
  std::vector<int> edge_count(p.size(), 0);
  for (const Tet& t : all)
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        if (i != j) edge_sum[t[i]] += (p[t[i]] - p[t[j]]).norm(), ++edge_count[t[i]];
  std::vector<double> size;
  // inside points first: cuts of quadrilaterals then start at lattice points
  for (std::size_t v = 0; v < p.size(); ++v)
    if (d[v] < 0 && edge_count[v] > 0) {
      vertex_of[v] = static_cast<Index>(x.size());
      x.push_back(p[v]);
      size.push_back(edge_sum[v] / edge_count[v]);
    }
  std::unordered_map<std::uint64_t, Index> cuts;
  const auto cut = [&](Index in, Index outside) {
    const auto [it, fresh] =
        cuts.try_emplace((std::uint64_t(in) << 32) | std::uint64_t(outside), static_cast<Index>(x.size()));
    if (fresh) {
      // not quite to the ends: elements without volume could not be improved
      const double s = std::clamp(solid.leaves(p[in], p[outside]), 0.03, 0.97);
      x.push_back(p[in] + s * (p[outside] - p[in]));
      size.push_back((p[outside] - p[in]).norm());
    }
    return it->second;
  };
  std::vector<Tet> tets;
  for (const Tet& t : all) {
    std::array<Index, 4> in, out;
    int n = 0, m = 0;
    for (const Index v : t) (d[v] < 0 ? in[n++] : out[m++]) = v;
    const auto local = [&](int i) { return vertex_of[in[i]]; };
    if (n == 4) {
      tets.push_back({local(0), local(1), local(2), local(3)});
    } else if (n == 3) {
      add_prism({local(0), local(1), local(2), cut(in[0], out[0]), cut(in[1], out[0]), cut(in[2], out[0])}, tets);
    } else if (n == 2) {
      add_prism({local(0), cut(in[0], out[0]), cut(in[0], out[1]), local(1), cut(in[1], out[0]), cut(in[1], out[1])}, tets);
    } else if (n == 1) {
      tets.push_back({local(0), cut(in[0], out[0]), cut(in[0], out[1]), cut(in[0], out[2])});
    }
  }
  for (Tet& t : tets)
    if ((x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]) < 0) std::swap(t[2], t[3]);
  TetEditor editor(std::move(x), tets);
  editor.size_m = std::move(size);
  return editor;
}

}  // namespace palpate::geometry
