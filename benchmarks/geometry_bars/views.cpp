// SPDX-License-Identifier: Apache-2.0
// Noisy depth views of whole objects become a watertight surface.
#include <fmt/core.h>

#include <cmath>
#include <cstdio>

#include "bars.hpp"
#include "palpate/geometry/surface_distance.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/reconstruction/build_object.hpp"
#include "palpate/reconstruction/fused_surface.hpp"
#include "palpate/registration/icp.hpp"
#include "palpate/registration/views.hpp"
#include "palpate/sensing/free_space.hpp"

namespace bars {
namespace {

/// `known`: exact poses; otherwise every view is turned and shifted by its prior, and the whole may stand anywhere.
bool row(const std::string& name, const geometry::TriangleTree& tree, int count, bool known) {
  constexpr double sigma = 0.0012, turn_std = 0.005, shift_std = 0.002;
  std::mt19937 rng(7);
  std::normal_distribution<double> g;
  std::vector<PointCloud> clouds;
  std::vector<DepthFrame> images;
  for (int k = 0; k < count; ++k) {
    const double a = 2 * M_PI * k / count;
    const Vec3 from(std::cos(a), std::sin(a), k % 2 ? 0.7 : -0.7);
    CameraView v = depth_view(tree, from, 0.45, 640, 480, 525, sigma, rng);
    if (!known) {
      const Vec3 turn = turn_std * Vec3(g(rng), g(rng), g(rng)), shift = shift_std * Vec3(g(rng), g(rng), g(rng));
      const Pose off(Eigen::Translation3d(shift) * Eigen::AngleAxisd(turn.norm(), turn.normalized()));
      apply(off, v.cloud);
      v.image.T_base_camera = off * v.image.T_base_camera;
      v.cloud.pose_std_rad = v.image.pose_std_rad = turn_std, v.cloud.pose_std_m = v.image.pose_std_m = shift_std;
    }
    clouds.push_back(std::move(v.cloud));
    images.push_back(std::move(v.image));
  }
  const Stopwatch watch;
  std::vector<PointCloud> aligned = clouds;
  if (!known) {
    const auto a = registration::align_views(clouds);
    for (std::size_t v = 0; v < aligned.size(); ++v) apply(a.correction[v], aligned[v]);
  }
  const auto fused = reconstruction::fuse_views(aligned);
  const sensing::FreeSpace free(images);
  reconstruction::SurfaceOptions carve;
  carve.free = free;
  TriMesh s = reconstruction::fused_surface(fused, carve);
  const double seconds = watch.seconds();
  reconstruction::BuildOptions o;
  o.mesh.tetrahedra = 12000;
  reconstruction::FuseOptions reconstruct;
  reconstruct.free = free;
  const Stopwatch tet_watch;
  const auto built = reconstruction::build_object(clouds, reconstruct, {}, o);
  const double tet_seconds = tet_watch.seconds();
  if (!known) {
    PointCloud c;
    c.points_m = s.vertices_m;
    const Pose T = registration::align(c, tree, Pose::Identity()).T_surface_cloud;
    s.vertices_m = ((s.vertices_m * T.linear().transpose()).rowwise() + T.translation().transpose()).eval();
  }
  const auto d = geometry::surface_distance(tree.mesh(), s);
  const bool closed = geometry::check_surface(s).watertight();
  const double limit = count >= 8 ? 0.00025 : 0.0004;
  const bool holds = closed && d.rms_m <= limit && (count < 8 || seconds <= 1.4);
  fmt::print("| {} | {} | {} | {} | {} | {:.2f} mm | {:.2f} mm | {:.2f} s | {:.2f} s | {} |\n", name, count,
             known ? "exact" : "2 mm, 0.3°", s.triangles.rows(), closed ? "yes" : "no", 1e3 * d.rms_m, 1e3 * d.hausdorff_m,
             seconds, tet_seconds, verdict(holds));
  std::fflush(stdout);
  return holds;
}

}  // namespace

bool views(const std::filesystem::path& meshes) {
  fmt::print(
      "\nViews from all around (640 x 480, 525 pixels focal length, 0.45 m, noise 1.2 mm along the ray) of objects of 0.25 "
      "m before a wall; "
      "CPU from the clouds to the surface, and to 12 000 tetrahedra\n\n"
      "| object | views | poses | triangles | watertight | rms | Hausdorff | CPU | tetrahedra | holds |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  bool holds = true;
  for (const int count : {8, 4})
    for (const char* name : {"armadillo_lowres", "bunny_manifold", "koala_lowres", "spot_crane", "teddy_autoknit"}) {
      const auto file = meshes / (std::string(name) + ".obj");
      if (!std::filesystem::exists(file)) continue;
      const geometry::TriangleTree tree(scaled(io::read_tri_mesh(file), 0.25));
      holds = row(name, tree, count, true) && holds;
      holds = row(name, tree, count, false) && holds;
    }
  return holds;
}

}  // namespace bars
