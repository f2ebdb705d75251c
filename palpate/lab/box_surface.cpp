// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/box_surface.hpp"

#include <array>
#include <map>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::lab {

TriMesh box_surface(const Vec3& min_m, const Vec3& max_m, int cells) {
  if (cells < 1) throw Error("must be at least 1", "cells");
  if (!((max_m - min_m).minCoeff() > 0)) throw Error("must be above min_m", "max_m");
  std::map<std::array<int, 3>, Index> name;
  std::vector<Vec3> vertices;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [it, fresh] = name.emplace(at, Index(vertices.size()));
    if (fresh)
      vertices.push_back(min_m + (max_m - min_m).cwiseProduct(Vec3(at[0], at[1], at[2])) / cells);
    return it->second;
  };
  TriMesh mesh;
  mesh.triangles.resize(Eigen::Index(12) * cells * cells, 3);
  Eigen::Index triangle = 0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const bool far : {false, true})
      for (int j = 0; j < cells; ++j)
        for (int i = 0; i < cells; ++i) {
          const auto corner = [&](int along, int across) {
            std::array<int, 3> at{};
            at[axis] = far ? cells : 0;
            at[(axis + 1) % 3] = i + along;
            at[(axis + 2) % 3] = j + across;
            return vertex(at);
          };
          const Index a = corner(0, 0), b = corner(1, 0), c = corner(0, 1), d = corner(1, 1);
          if (far) {
            mesh.triangles.row(triangle++) << a, b, d;
            mesh.triangles.row(triangle++) << a, d, c;
          } else {
            mesh.triangles.row(triangle++) << a, d, b;
            mesh.triangles.row(triangle++) << a, c, d;
          }
        }
  mesh.vertices_m.resize(Eigen::Index(vertices.size()), 3);
  for (std::size_t v = 0; v < vertices.size(); ++v) mesh.vertices_m.row(Eigen::Index(v)) = vertices[v];
  return mesh;
}

}  // namespace palpate::lab
