// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/graded_block.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::lab {
namespace {

// Distances from 0 to `length`: `uniform` first, then growing cells that end exactly at `length`.
std::vector<double> graded(std::vector<double> uniform, double length, double cell, const GradedBlockOptions& options) {
  const double start = uniform.back(), rest = length - start;
  if (rest <= 1e-12) return uniform;
  std::vector<double> steps;
  double sum = 0;
  while (sum < rest) {
    const double to_edge = options.edge_cell_m + (options.growth - 1) * std::max(0.0, rest - sum);
    cell = std::min({cell * options.growth, options.largest_cell_m, to_edge});
    steps.push_back(cell);
    sum += cell;
  }
  double at = start;
  for (const double step : steps) uniform.push_back(at += step * rest / sum);
  uniform.back() = length;
  return uniform;
}

// Signed offsets from the contact's centre to both walls (one side may be empty: a plane of symmetry).
std::vector<double> both_sides(double behind, double ahead, const GradedBlockOptions& options) {
  std::vector<double> core;
  for (int k = 0; k <= options.cells_in_radius; ++k) core.push_back(options.contact_radius_m * k / options.cells_in_radius);
  const double cell = options.contact_radius_m / options.cells_in_radius;
  std::vector<double> line;
  if (behind > 1e-12) {
    line = graded(core, behind, cell, options);
    std::reverse(line.begin(), line.end());
    for (double& x : line) x = -x;
    line.pop_back();
  }
  if (ahead > 1e-12) {
    const std::vector<double> right = graded(core, ahead, cell, options);
    line.insert(line.end(), right.begin(), right.end());
  } else {
    line.push_back(0);
  }
  return line;
}

}  // namespace

TetMesh graded_block(const GradedBlockOptions& o) {
  const auto bad = [](const char* field, const char* rule) {
    throw Error(rule, std::string("GradedBlockOptions.") + field);
  };
  if (o.cells_in_radius < 1) bad("cells_in_radius", "must be at least 1");
  if (!(o.growth >= 1 && o.growth <= 3)) bad("growth", "must be between 1 and 3");
  if (!(o.largest_cell_m > 0)) bad("largest_cell_m", "must be positive");
  if (!(o.edge_cell_m > 0)) bad("edge_cell_m", "must be positive");
  if (!(o.contact_radius_m > 0)) bad("contact_radius_m", "must be positive");
  if (!((o.max_m - o.min_m).minCoeff() > 0)) bad("max_m", "must be above min_m");
  if (std::abs(o.contact_m.z() - o.max_m.z()) > 1e-9) bad("contact_m", "must lie on the top face");
  std::array<double, 4> walls{};  // -x +x -y +y
  for (int k = 0; k < 2; ++k) {
    walls[std::size_t(2 * k)] = o.contact_m(k) - o.min_m(k);
    walls[std::size_t(2 * k + 1)] = o.max_m(k) - o.contact_m(k);
  }
  for (const double wall : walls)
    if (wall > 1e-12 && wall <= o.contact_radius_m * 1.05) bad("contact_m", "must keep its radius away from the walls");
  if (std::all_of(walls.begin(), walls.end(), [](double wall) { return wall <= 1e-12; })) bad("contact_m", "is outside");

  const std::vector<double> xs = both_sides(walls[0], walls[1], o), ys = both_sides(walls[2], walls[3], o);
  std::vector<double> depths =
      graded({0.0}, o.max_m.z() - o.min_m.z(), o.contact_radius_m / o.cells_in_radius / o.growth, o);
  std::reverse(depths.begin(), depths.end());  // z rises with the index

  const auto nx = Index(xs.size()), ny = Index(ys.size()), nz = Index(depths.size());
  const auto node = [&](Index i, Index j, Index k) { return (k * ny + j) * nx + i; };
  TetMesh mesh;
  mesh.nodes_m.resize(nx * ny * nz, 3);
  const double a = o.contact_radius_m;
  for (Index j = 0; j < ny; ++j)
    for (Index i = 0; i < nx; ++i) {
      const Vec2 p(xs[std::size_t(i)], ys[std::size_t(j)]);
      // Squares around the contact's axis become circles up to its rim and turn back into the block's outline at the walls.
      const double square = p.cwiseAbs().maxCoeff();
      double to_wall = 0;
      for (int k = 0; k < 2; ++k) {
        const double wall = walls[std::size_t(2 * k + (p(k) > 0))];
        if (std::abs(p(k)) > a) to_wall = std::max(to_wall, (std::abs(p(k)) - a) / (wall - a));
      }
      Vec2 moved = p;
      if (square > 0) moved = (1 - to_wall) * (square / p.norm()) * p + to_wall * p;
      for (Index k = 0; k < nz; ++k)
        mesh.nodes_m.row(node(i, j, k)) << o.contact_m.x() + moved.x(), o.contact_m.y() + moved.y(),
            o.max_m.z() - depths[std::size_t(k)];
    }

  // Kuhn's six tetrahedra share the cell's diagonal that leads away from the axis (and down): mirrored cells fit together.
  constexpr std::array<std::array<int, 3>, 6> orders{{{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
  mesh.tetrahedra.resize(Eigen::Index(6) * (nx - 1) * (ny - 1) * (nz - 1), 4);
  Eigen::Index t = 0;
  for (Index k = 0; k + 1 < nz; ++k)
    for (Index j = 0; j + 1 < ny; ++j)
      for (Index i = 0; i + 1 < nx; ++i) {
        const bool mirror_x = xs[std::size_t(i + 1)] <= 0, mirror_y = ys[std::size_t(j + 1)] <= 0;
        for (const auto& order : orders) {
          std::array<Index, 3> at{0, 0, 0};  // in the mirrored cell: 0 = near the axis (and up), 1 = away
          std::array<Index, 4> corner{};
          for (int c = 0; c < 4; ++c) {
            corner[std::size_t(c)] =
                node(mirror_x ? i + 1 - at[0] : i + at[0], mirror_y ? j + 1 - at[1] : j + at[1], k + 1 - at[2]);
            if (c < 3) at[std::size_t(order[std::size_t(c)])] = 1;
          }
          const auto p = [&](int c) { return Vec3(mesh.nodes_m.row(corner[std::size_t(c)])); };
          if ((p(1) - p(0)).cross(p(2) - p(0)).dot(p(3) - p(0)) < 0) std::swap(corner[2], corner[3]);
          mesh.tetrahedra.row(t++) << corner[0], corner[1], corner[2], corner[3];
        }
      }
  return mesh;
}

std::vector<Index> contact_nodes(const TetMesh& mesh, const GradedBlockOptions& options) {
  std::vector<Index> nodes;
  for (Eigen::Index n = 0; n < mesh.nodes_m.rows(); ++n) {
    const Vec3 offset = Vec3(mesh.nodes_m.row(n)) - options.contact_m;
    if (std::abs(offset.z()) < 1e-9 && offset.head<2>().norm() < options.contact_radius_m * (1 + 1e-9))
      nodes.push_back(Index(n));
  }
  return nodes;
}

}  // namespace palpate::lab
