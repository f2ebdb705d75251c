// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/unseen_side.hpp"

#include <cmath>
#include <variant>

#include "palpate/geometry/ray_subset.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {

double unseen_share(const TriMesh& surface, const std::vector<char>& seen, const std::optional<Plane>& plane) {
  const double height = (surface.vertices_m.colwise().maxCoeff() - surface.vertices_m.colwise().minCoeff()).norm();
  double unseen = 0, all = 0;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(t, k))); };
    bool was_seen = false, on_plane = plane.has_value();
    for (int k = 0; k < 3; ++k) {
      was_seen = was_seen || seen[static_cast<std::size_t>(surface.triangles(t, k))] != 0;
      on_plane = on_plane && std::abs(plane->normal.dot(corner(k) - plane->point_m)) < 0.01 * height;
    }
    if (on_plane) continue;
    const double area = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    all += area;
    if (!was_seen) unseen += area;
  }
  return all > 0 ? unseen / all : 0;
}

void drop_unseen(const TriMesh& surface, const std::vector<char>& seen, const std::optional<Plane>& plane, Inputs& inputs) {
  // What was seen and what is guessed meet in a rim that is neither: rays within some facets of it have been 0.9 deviations off.
  constexpr double edges_of_rim = 3;
  const double size_m = (surface.vertices_m.colwise().maxCoeff() - surface.vertices_m.colwise().minCoeff()).norm();
  TriMesh guessed{surface.vertices_m, {}};
  std::vector<Index> unseen;
  double edge_m = 0;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    bool was_seen = false, on_plane = plane.has_value();
    for (int k = 0; k < 3; ++k) {
      const Vec3 a = surface.vertices_m.row(surface.triangles(t, k)), b = surface.vertices_m.row(surface.triangles(t, (k + 1) % 3));
      edge_m += (b - a).norm() / static_cast<double>(3 * surface.triangles.rows());
      was_seen = was_seen || seen[static_cast<std::size_t>(surface.triangles(t, k))] != 0;
      on_plane = on_plane && std::abs(plane->normal.dot(a - plane->point_m)) < 0.01 * size_m;
    }
    if (!was_seen && !on_plane) unseen.push_back(t);
  }
  if (unseen.empty()) return;
  guessed.triangles = surface.triangles(unseen, Eigen::all);
  const geometry::TriangleTree tree(surface), rim(guessed);
  const auto shown = [&](const Vec3& point_m) {
    if (rim.within(point_m, std::pow(edges_of_rim * edge_m, 2))) return false;
    const auto row = surface.triangles.row(tree.closest(point_m).triangle);
    return seen[static_cast<std::size_t>(row(0))] != 0 || seen[static_cast<std::size_t>(row(1))] != 0 ||
           seen[static_cast<std::size_t>(row(2))] != 0;
  };
  for (auto& step : inputs) {
    for (auto& input : step) {
      if (auto* frame = std::get_if<RayObservation>(&input)) {
        const RayCloud& all = frame->rays;
        std::vector<Index> kept;
        for (Index i = 0; i < all.range_m.size(); ++i)
          if (shown(Vec3(all.origins_m.row(i)) + all.range_m(i) * Vec3(all.directions.row(i)))) kept.push_back(i);
        frame->rays = geometry::rays_at(all, kept);
      }
    }
    std::erase_if(step, [](const auto& input) {
      const auto* frame = std::get_if<RayObservation>(&input);
      return frame != nullptr && frame->rays.range_m.size() == 0;
    });
  }
}

}  // namespace palpate::estimation
