// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/nearest_vertices.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <string>
#include <utility>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::geometry {
namespace {

/// Vertices may move by this share of the usual distance to their neighbours before the tree is built anew: beyond it too few
/// answers can be kept (a tree costs about as much as the questions of one placement).
constexpr double share_of_spacing = 0.05;

// Collects the nearest vertex where they are now, and the two nearest where they were.
struct NearestNow {
  using DistanceType = double;
  using IndexType = Index;

  const Points& now_m;
  const Vec3& point_m;
  double moved_m;
  Index vertex = -1;
  double squared_m2 = std::numeric_limits<double>::infinity();
  struct Before {
    Index vertex = -1;
    double squared_m2 = std::numeric_limits<double>::infinity();
  };
  Before first{}, second{};
  double reach_m2 = std::numeric_limits<double>::infinity();

  bool addPoint(double before_m2, Index candidate) {
    if (before_m2 < first.squared_m2) {
      second = first;
      first = {candidate, before_m2};
    } else if (before_m2 < second.squared_m2) {
      second = {candidate, before_m2};
    }
    const double now_m2 = (now_m.row(candidate).transpose() - point_m).squaredNorm();
    if (now_m2 < squared_m2 || (now_m2 == squared_m2 && candidate < vertex)) {
      squared_m2 = now_m2;
      vertex = candidate;
    }
    // Farther ones can be neither the nearest now nor the second nearest before.
    const double now_or_before_m = std::max(std::sqrt(squared_m2) + moved_m, std::sqrt(second.squared_m2));
    reach_m2 = now_or_before_m * now_or_before_m * (1 + 1e-9);
    return true;
  }
  double worstDist() const { return reach_m2; }
  bool full() const { return vertex >= 0; }
  std::size_t size() const { return vertex >= 0 ? 1 : 0; }
  void sort() {}
};

void check(const Points& vertices_m) {
  if (!vertices_m.allFinite()) throw Error("a vertex is not finite", "NearestVertices");
}

}  // namespace

struct NearestVertices::Impl {
  // What nanoflann asks of a set of points.
  struct Placed {
    Points at_m;
    std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(at_m.rows()); }
    double kdtree_get_pt(std::size_t vertex, std::size_t axis) const {
      return at_m(static_cast<Index>(vertex), static_cast<Index>(axis));
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };

  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Placed>, Placed, 3, Index>;

  Placed placed;
  Points now_m;
  std::unique_ptr<Tree> tree;
  double moved_m = 0, may_move_m = 0;
  int built = -1;

  void build() {
    placed.at_m = now_m;
    tree = std::make_unique<Tree>(3, placed, nanoflann::KDTreeSingleIndexAdaptorParams(10));
    tree->buildIndex();
    moved_m = 0;
    ++built;
  }

  NearestNow search(const Vec3& point_m) const {
    NearestNow result{.now_m = now_m, .point_m = point_m, .moved_m = moved_m};
    tree->findNeighbors(result, point_m.data(), {});
    return result;
  }

  // To the nearest other vertex, of a few vertices: the middle one.
  double spacing_m() const {
    constexpr Index asked = 101;
    const Index stride = std::max<Index>(1, static_cast<Index>(now_m.rows()) / asked);
    std::vector<double> all;
    for (Index v = 0; v < now_m.rows(); v += stride) all.push_back(std::sqrt(search(now_m.row(v).transpose()).second.squared_m2));
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2), all.end());
    return all[all.size() / 2];
  }
};

NearestVertices::NearestVertices(Points vertices_m) : impl_(std::make_unique<Impl>()) {
  if (vertices_m.rows() == 0) throw Error("needs at least one vertex", "NearestVertices");
  check(vertices_m);
  impl_->now_m = std::move(vertices_m);
  impl_->build();
  impl_->may_move_m = share_of_spacing * impl_->spacing_m();
}

NearestVertices::~NearestVertices() = default;
NearestVertices::NearestVertices(NearestVertices&&) noexcept = default;
NearestVertices& NearestVertices::operator=(NearestVertices&&) noexcept = default;

void NearestVertices::move(const Points& vertices_m) {
  if (vertices_m.rows() != impl_->now_m.rows())
    throw Error("needs " + std::to_string(impl_->now_m.rows()) + " vertices, got " + std::to_string(vertices_m.rows()), "NearestVertices");
  check(vertices_m);
  impl_->now_m = vertices_m;
  impl_->moved_m = std::sqrt((vertices_m - impl_->placed.at_m).rowwise().squaredNorm().maxCoeff());
  if (impl_->moved_m > impl_->may_move_m) impl_->build();
}

NearestVertices::Found NearestVertices::nearest(const Vec3& point_m, Memory& memory) const {
  if (!point_m.allFinite()) return {-1, std::numeric_limits<double>::quiet_NaN()};
  if (memory.tree == impl_->built) {
    const double now_m2 = (impl_->now_m.row(memory.vertex).transpose() - point_m).squaredNorm();
    const double left_m = memory.others_m - (point_m - memory.asked_m).norm() - impl_->moved_m;
    if (left_m > 0 && now_m2 <= left_m * left_m) return {memory.vertex, now_m2};
  }
  const NearestNow found = impl_->search(point_m);
  const double others_m2 = found.first.vertex == found.vertex ? found.second.squared_m2 : found.first.squared_m2;
  memory = {found.vertex, point_m, std::sqrt(others_m2), impl_->built};
  return {found.vertex, found.squared_m2};
}

const Points& NearestVertices::vertices_m() const { return impl_->now_m; }

}  // namespace palpate::geometry
