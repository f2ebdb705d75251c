// SPDX-License-Identifier: Apache-2.0
// What the geometry bars share: CPU time, noise, and depth views of a mesh.
#pragma once

#include <ctime>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace bars {

using namespace palpate;

/// CPU seconds of this process.
class Stopwatch {
 public:
  double seconds() const { return double(std::clock() - start_) / CLOCKS_PER_SEC; }

 private:
  std::clock_t start_ = std::clock();
};

inline const char* verdict(bool holds) { return holds ? "yes" : "**no**"; }

/// Meshes (OBJ) of the folder by name; empty when there is no folder.
std::vector<std::filesystem::path> mesh_files(const std::filesystem::path& folder);

/// The mesh with its longest side of the bounding box made `size_m`, about its middle.
TriMesh scaled(TriMesh mesh, double size_m);

struct CameraView {
  PointCloud cloud;  ///< in the object's frame; normals are those of the triangles hit
  VectorX cosine;    ///< between ray and normal: noise along the ray counts that much along the normal
  DepthFrame image;  ///< the same, before a wall `wall_m` away
};

constexpr double wall_m = 2;

/// What a depth camera sees at a distance in a direction, with noise along the ray; every `stride`-th row and column.
CameraView depth_view(const geometry::TriangleTree& tree, const Vec3& from, double distance_m, int width_px, int height_px,
                      double focal_px, double sigma_m, std::mt19937& rng, int stride = 1);

Pose random_motion(double angle_rad, double shift_m, std::mt19937& rng);
void apply(const Pose& T, PointCloud& cloud);

// the tables; false where a bar is missed
bool tetrahedra(const std::filesystem::path& meshes);
bool damaged(const std::filesystem::path& meshes);
bool unseen();
bool closest(const std::filesystem::path& meshes);
bool icp(const std::filesystem::path& meshes, int seeds);
bool views(const std::filesystem::path& meshes);

/// CPU seconds and pose of Open3D's point-to-plane ICP of the cloud against samples of the mesh with their exact normals;
/// negative where this program was built without it.
double open3d_icp(const PointCloud& cloud, const TriMesh& mesh, const Pose& start, Pose& found);

}  // namespace bars
