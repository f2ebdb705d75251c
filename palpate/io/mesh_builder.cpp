// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/mesh_builder.hpp"

#include "palpate/core/error.hpp"

namespace palpate::io {

void MeshBuilder::polygon(const std::vector<Index>& corners) {
  for (std::size_t i = 2; i < corners.size(); ++i) triangle(corners[0], corners[i - 1], corners[i]);
}

void MeshBuilder::tetrahedron(const Index* nodes, int count) {
  std::vector<Index>& list = count == 10 ? tets10_ : tets4_;
  list.insert(list.end(), nodes, nodes + count);
}

MeshData MeshBuilder::build(const std::string& name) {
  if (!tets4_.empty() && !tets10_.empty()) {
    throw Error("mixes linear and quadratic tetrahedra; write one kind only", name);
  }
  MeshData mesh;
  mesh.points_m = Eigen::Map<const Points>(coordinates_.data(), static_cast<Eigen::Index>(coordinates_.size() / 3), 3);
  mesh.triangles = Eigen::Map<const Triangles>(triangles_.data(), static_cast<Eigen::Index>(triangles_.size() / 3), 3);
  const std::vector<Index>& tets = tets10_.empty() ? tets4_ : tets10_;
  const Eigen::Index columns = tets10_.empty() ? 4 : 10;
  mesh.tetrahedra = Eigen::Map<const Tetrahedra>(tets.data(), static_cast<Eigen::Index>(tets.size()) / columns, columns);
  return mesh;
}

}  // namespace palpate::io
