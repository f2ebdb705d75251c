// SPDX-License-Identifier: Apache-2.0
// What a perfect depth camera would see: rays cast at surfaces and planes.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::lab {

/// Surfaces (base frame) and the half spaces behind planes. The trees must outlive the scene.
struct Scene {
  std::vector<const geometry::TriangleTree*> bodies;
  std::vector<Plane> planes;
};

struct PerfectView {
  DepthImage depth_m;        ///< 0 where the ray meets nothing
  DepthImage incidence_rad;  ///< between ray and surface normal
  MaskImage label;           ///< 0 nothing, 1 + k body k, 1 + bodies + k plane k
};

PerfectView cast_view(const Scene& scene, const Camera& camera, const Pose& T_base_camera);

/// Pose of a camera at `eye_m` that looks at `target_m` with its image's down direction as far down as possible.
Pose look_at(const Vec3& eye_m, const Vec3& target_m, const Vec3& up = Vec3::UnitZ());

/// Closed cylinder along z from 0 to length_m.
TriMesh cylinder(double radius_m, double length_m, int sides = 48);

}  // namespace palpate::lab
