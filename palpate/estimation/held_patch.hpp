// SPDX-License-Identifier: Apache-2.0
// What a support that gives way holds: the object turns about its middle.
#pragma once

#include <utility>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::estimation {

/// Middle of what a support holds, and mean of |r|^2 I - r r' about it: by area where whole faces are held, else by node.
struct HeldPatch {
  Vec3 middle_m = Vec3::Zero();
  Mat3 turning_m2 = Mat3::Zero();

  HeldPatch(const TetMesh& mesh, const Support& support) {
    const std::vector<Index> nodes = fem::support_nodes(mesh, support);
    std::vector<char> held(static_cast<std::size_t>(mesh.nodes_m.rows()), 0);
    for (const Index node : nodes) held[static_cast<std::size_t>(node)] = 1;
    std::vector<std::pair<Vec3, double>> points;  // of an integral that is exact for squares
    const Triangles faces = fem::boundary_triangles(mesh);
    for (Index t = 0; t < faces.rows(); ++t) {
      const auto corner = [&](int k) { return Vec3(mesh.nodes_m.row(faces(t, k % 3))); };
      const auto is_held = [&](int k) { return held[static_cast<std::size_t>(faces(t, k))] != 0; };
      if (!is_held(0) || !is_held(1) || !is_held(2)) continue;
      const double third_m2 = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm() / 6;
      for (int k = 0; k < 3; ++k) points.emplace_back(0.5 * (corner(k) + corner(k + 1)), third_m2);
    }
    if (points.empty())
      for (const Index node : nodes) points.emplace_back(mesh.nodes_m.row(node), 1);
    double sum = 0;
    for (const auto& [at_m, weight] : points) sum += weight, middle_m += weight * at_m;
    middle_m /= sum;
    for (const auto& [at_m, weight] : points) {
      const Vec3 r = at_m - middle_m;
      turning_m2 += weight / sum * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
    }
  }
};

}  // namespace palpate::estimation
