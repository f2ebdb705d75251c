// SPDX-License-Identifier: Apache-2.0
// Inside of tetrahedralise: a tetrahedral mesh that can be changed locally without ever becoming inverted or non-manifold.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::geometry {

class TetEditor {
 public:
  using Tet = std::array<Index, 4>;
  using Tri = std::array<Index, 3>;

  TetEditor(std::vector<Vec3> points, const std::vector<Tet>& tets);

  std::vector<Vec3> x;
  std::vector<char> boundary;   ///< vertex lies on the boundary; the operations keep that as it is
  std::vector<double> size_m;   ///< wished edge length at a vertex
  std::vector<double> drift_m;  ///< how far merges may have cut the surface short at a vertex, summed up
  double coarse_m = 0;          ///< edge length of thick parts: refined ones need not be truer than half as true as these
  std::vector<Tet> tets;
  std::vector<char> alive;
  std::vector<double> quality;
  std::vector<std::vector<Index>> star;  ///< vertex -> its tetrahedra

  Index count() const { return count_; }
  double volume_m3() const;
  /// Makes the mean of the edges at a vertex its wished length, and forgets what merges cut off.
  void measure_sizes();
  double quality_of(const Tet& t) const;
  double star_quality(Index v) const;
  /// Smallest quality of the star with v at another place; stops early when it falls to `enough` or below.
  double star_quality_at(Index v, const Vec3& at, double enough) const;
  void move(Index v, const Vec3& at);

  std::vector<Index> edge_tets(Index a, Index b) const;
  std::vector<Index> neighbours(Index v) const;
  /// Boundary triangles at v, outward, v first.
  std::vector<Tri> boundary_triangles(Index v) const;
  std::vector<Tri> all_boundary_triangles() const;
  Vec3 boundary_normal(Index v) const;

  /// Judges new boundary triangles before they are made: true = near enough to the true surface.
  using Accept = std::function<bool(const std::vector<Tri>& before, const std::vector<Tri>& after)>;

  /// Merges `gone` into `kept` at kept's place, if the result stays manifold and its smallest quality exceeds `above`.
  /// `most_drift_m`: how much repeated merges may cut off the boundary.
  bool collapse(Index gone, Index kept, double above, const Accept& accept, double most_drift_m = 1e300);
  /// Replaces the tetrahedra around an edge by the best triangulation of its ring (Shewchuk 2002), interior or boundary.
  bool remove_edge(Index a, Index b, const Accept& accept);
  /// Two tetrahedra at a face become three around the edge between their far corners.
  bool remove_face(Index tet, int opposite);
  /// Splits an edge in the middle.
  Index split_edge(Index a, Index b);
  /// Takes split_edge(a, b) back, which made v; nothing but v's place may have changed since.
  void unsplit_edge(Index v, Index a, Index b);

  /// Pieces joined by faces; of a tetrahedron its piece (-1: removed), and the pieces' volumes.
  struct Pieces {
    std::vector<Index> of;
    std::vector<double> volume_m3;
  };
  Pieces pieces() const;
  void remove_tet(Index t) { remove(t); }

  /// Distance from the surface that `share` of the wished edge length allows.
  double allowed_m(double share, double size) const { return share * std::max(size, 0.5 * coarse_m); }

  TetMesh compact(std::vector<Index>* vertex_of = nullptr) const;

 private:
  Index add(const Tet& t);
  void remove(Index t);
  /// Takes a tetrahedron with two boundary faces off the boundary.
  bool peel(Index tet, Index a, Index b, const Accept& accept);
  bool link_condition(Index a, Index b, const std::vector<Index>& ring) const;
  bool is_boundary_face(Index a, Index b, Index c) const;
  bool joined(Index a, Index b) const;
  Index count_ = 0;
  std::vector<Index> free_;
};

}  // namespace palpate::geometry
