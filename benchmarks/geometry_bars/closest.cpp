// SPDX-License-Identifier: Apache-2.0
// Closest point on a mesh of 69 630 triangles, and the same after a deformation with refitted boxes.
#include <fmt/core.h>

#include <cmath>

#include "bars.hpp"
#include "palpate/io/mesh_file.hpp"

namespace bars {

bool closest(const std::filesystem::path& meshes) {
  const auto file = meshes / "bunny_stanford.obj";
  if (!std::filesystem::exists(file)) {
    fmt::print("\nClosest point: no {}\n", file.string());
    return true;
  }
  const TriMesh mesh = scaled(io::read_tri_mesh(file), 0.25);
  const double diagonal = (mesh.vertices_m.colwise().maxCoeff() - mesh.vertices_m.colwise().minCoeff()).norm();
  constexpr int count = 200000;
  std::mt19937 rng(1);
  std::uniform_int_distribution<Index> pick(0, static_cast<Index>(mesh.triangles.rows()) - 1);
  std::normal_distribution<double> noise(0, 0.003 * diagonal);
  Points queries(count, 3);
  for (Index i = 0; i < count; ++i)
    queries.row(i) =
        mesh.vertices_m.row(mesh.triangles(pick(rng), i % 3)) + Eigen::RowVector3d(noise(rng), noise(rng), noise(rng));
  geometry::TriangleTree tree(mesh);
  const auto rate = [&] {
    double best = 0, sum = 0;
    for (int repeat = 0; repeat < 3; ++repeat) {
      const Stopwatch watch;
      for (Index i = 0; i < count; ++i) sum += tree.closest(queries.row(i).transpose()).squared_distance_m2;
      best = std::max(best, count / watch.seconds());
    }
    return sum > 0 ? best : 0;
  };
  const double fresh = rate();
  // pressed from above by a tenth of its height
  TriMesh pressed = mesh;
  const double top = mesh.vertices_m.col(2).maxCoeff();
  for (Index i = 0; i < pressed.vertices_m.rows(); ++i) {
    const double r2 = pressed.vertices_m.row(i).head<2>().squaredNorm() / (0.04 * diagonal * diagonal);
    pressed.vertices_m(i, 2) -= 0.1 * (pressed.vertices_m(i, 2) + top) * std::exp(-r2);
  }
  const Stopwatch refit_watch;
  tree.refit(pressed.vertices_m);
  const double refit_s = refit_watch.seconds();
  const Stopwatch build_watch;
  const geometry::TriangleTree rebuilt(pressed);
  const double build_s = build_watch.seconds();
  double largest = 0;
  for (Index i = 0; i < count; i += 10) {
    const Vec3 p = queries.row(i).transpose();
    largest = std::max(largest, std::abs(std::sqrt(tree.closest(p).squared_distance_m2) -
                                         std::sqrt(rebuilt.closest(p).squared_distance_m2)));
  }
  const double after = rate();
  const bool holds = fresh >= 1e6 && largest <= 1e-12 * diagonal;
  fmt::print(
      "\nClosest point near the surface (0.3 % of the diagonal an axis, random order), {} triangles\n\n"
      "| million queries a second | after refit | build | refit | refit against rebuilt | holds "
      "|\n|---|---|---|---|---|---|\n"
      "| {:.2f} | {:.2f} | {:.0f} ms | {:.1f} ms | {:.0e} m | {} |\n",
      mesh.triangles.rows(), fresh / 1e6, after / 1e6, 1e3 * build_s, 1e3 * refit_s, largest, verdict(holds));
  return holds;
}

}  // namespace bars
