// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/build_object.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "palpate/core/error.hpp"
#include "palpate/core/point_cloud.hpp"
#include "palpate/geometry/embedding.hpp"
#include "palpate/geometry/stand_on.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/geometry/union_find.hpp"
#include "palpate/reconstruction/facets.hpp"
#include "palpate/reconstruction/finer_at_supports.hpp"
#include "palpate/reconstruction/foreign_points.hpp"
#include "palpate/reconstruction/fused_surface.hpp"
#include "palpate/registration/views.hpp"

namespace palpate::reconstruction {
namespace {

double mean_edge(const TriMesh& m) {
  double sum = 0;
  for (Index i = 0; i < m.triangles.rows(); ++i)
    for (int k = 0; k < 3; ++k)
      sum += (m.vertices_m.row(m.triangles(i, k)) - m.vertices_m.row(m.triangles(i, (k + 1) % 3))).norm();
  return m.triangles.rows() > 0 ? sum / double(3 * m.triangles.rows()) : 0;
}

bool is_plane(SupportKind kind) {
  return kind == SupportKind::plane || kind == SupportKind::table || kind == SupportKind::wall;
}

bool found_by_place(SupportKind kind) {
  return kind == SupportKind::plane || kind == SupportKind::box || kind == SupportKind::table || kind == SupportKind::wall;
}

void add_warnings(ObjectModel& model, const std::vector<geometry::Finding>& findings) {
  for (const auto& f : findings) model.warnings.push_back(f.message);
}

double mean_sigma(const PointCloud& c) { return c.sigma_m.size() > 0 ? c.sigma_m.mean() : 0; }

/// Leaves out points on the support and behind it: within three deviations of the noise, at least a thousandth of the
/// cloud's size.
void drop_support(std::vector<PointCloud>& clouds, const Plane& plane) {
  for (PointCloud& c : clouds) {
    const auto n = static_cast<Index>(c.points_m.rows());
    if (n == 0) continue;
    const double size = (c.points_m.colwise().maxCoeff() - c.points_m.colwise().minCoeff()).norm();
    const double limit = std::max(3 * mean_sigma(c), 1e-3 * size);
    const bool normals = c.normals.rows() == n;
    std::vector<Index> stay;
    for (Index i = 0; i < n; ++i) {
      const double height = plane.normal.dot(Vec3(c.points_m.row(i).transpose()) - plane.point_m);
      // a flank close above the plane belongs to the object: only what also faces like the plane is taken for it
      const bool flat = !normals || plane.normal.dot(c.normals.row(i).transpose()) > 0.8;
      if (!(height < -limit || (height < limit && flat))) stay.push_back(i);
    }
    c = chosen_points(c, stay);
  }
}

void turn(PointCloud& c, const Pose& T) {
  c.points_m = ((c.points_m * T.linear().transpose()).rowwise() + T.translation().transpose()).eval();
  c.normals = (c.normals * T.linear().transpose()).eval();
}

/// Leaves out parts that hang together neither with the largest one nor with a support's plane: nothing holds them.
/// @returns their share of the volume
double drop_floating(const std::vector<Support>& supports, TetMesh& volume) {
  geometry::UnionFind parts(volume.nodes_m.rows());
  for (Index t = 0; t < volume.tetrahedra.rows(); ++t)
    for (int k = 1; k < 4; ++k) parts.join(volume.tetrahedra(t, 0), volume.tetrahedra(t, k));
  std::map<Index, double> size;
  double all = 0;
  for (Index t = 0; t < volume.tetrahedra.rows(); ++t) {
    const auto node = [&](int k) { return Vec3(volume.nodes_m.row(volume.tetrahedra(t, k))); };
    const double v = (node(1) - node(0)).cross(node(2) - node(0)).dot(node(3) - node(0)) / 6;
    size[parts.root(volume.tetrahedra(t, 0))] += v;
    all += v;
  }
  if (size.size() < 2) return 0;
  std::set<Index> kept{std::max_element(size.begin(), size.end(), [](const auto& a, const auto& b) { return a.second < b.second; })->first};
  for (const Support& s : supports)
    for (Index i = 0; is_plane(s.kind) && i < volume.nodes_m.rows(); ++i)
      if (std::abs(s.plane.normal.dot(Vec3(volume.nodes_m.row(i)) - s.plane.point_m)) < 1e-9) kept.insert(parts.root(i));
  std::vector<Index> place(static_cast<std::size_t>(volume.nodes_m.rows()), -1);
  Index nodes = 0, tets = 0;
  double left = 0;
  for (Index t = 0; t < volume.tetrahedra.rows(); ++t) {
    if (!kept.contains(parts.root(volume.tetrahedra(t, 0)))) continue;
    for (int k = 0; k < 4; ++k) place[volume.tetrahedra(t, k)] = 0;
    volume.tetrahedra.row(tets++) = volume.tetrahedra.row(t).eval();
  }
  for (const Index r : kept) left += size.contains(r) ? size[r] : 0;
  for (Index i = 0; i < volume.nodes_m.rows(); ++i) {
    if (place[i] < 0) continue;
    volume.nodes_m.row(nodes) = volume.nodes_m.row(i).eval();
    place[i] = nodes++;
  }
  volume.nodes_m.conservativeResize(nodes, 3);
  volume.tetrahedra.conservativeResize(tets, 4);
  for (Index t = 0; t < tets; ++t)
    for (int k = 0; k < 4; ++k) volume.tetrahedra(t, k) = place[volume.tetrahedra(t, k)];
  return 1 - left / all;
}

SeenVertices seen_vertices(const Points& vertices_m, const FusedViews& fused, const geometry::TriangleTree& to_seen) {
  SeenVertices out;
  out.sigma_m.resize(vertices_m.rows());
  out.seen.resize(static_cast<std::size_t>(vertices_m.rows()));
  for (Index i = 0; i < vertices_m.rows(); ++i) {
    const auto c = to_seen.closest(vertices_m.row(i).transpose());
    const double far = std::sqrt(c.squared_distance_m2);
    // facets lie loosely beside each other: within a cell of one the surface was seen
    out.seen[static_cast<std::size_t>(i)] = far < fused.cell_m;
    out.sigma_m[i] = std::hypot(fused.sigma_m[c.triangle], far < fused.cell_m ? 0 : 0.5 * far);
  }
  return out;
}

/// Of the surface's area, where no corner of a triangle was seen.
double unseen_share(const BuiltObject& object) {
  const TriMesh& surface = object.model.surface;
  double unseen = 0, all = 0;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const double area = area_of(surface, t).norm();
    all += area;
    const auto was_seen = [&](int k) { return object.of_surface.seen[static_cast<std::size_t>(surface.triangles(t, k))] != 0; };
    if (!was_seen(0) && !was_seen(1) && !was_seen(2)) unseen += area;
  }
  return all > 0 ? unseen / all : 0;
}

/// What the views' poses may still be off by, rms over their directions and places on the object.
double left_by_poses_m(const registration::ViewsResult& aligned, const std::vector<PointCloud>& clouds) {
  double square_m2 = 0;
  for (std::size_t v = 0; v < clouds.size(); ++v) {
    const auto at = 6 * static_cast<Index>(v);
    const double wide_m2 = (clouds[v].points_m.rowwise() - aligned.centre_m[v].transpose()).rowwise().squaredNorm().mean();
    square_m2 += aligned.covariance.block<3, 3>(at + 3, at + 3).trace() / 3;
    square_m2 += aligned.covariance.block<3, 3>(at, at).trace() / 3 * wide_m2 * 2 / 3;  // of a lever, what is across it
  }
  return std::sqrt(square_m2 / static_cast<double>(clouds.size()));
}

/// How far the faces of the volume lie from the surface that it fills, one standard deviation as of its middle half: most of it, not
/// its sharp edges.
double faces_off_m(const TriMesh& skin, const TriMesh& boundary) {
  const geometry::TriangleTree faces(boundary);
  std::vector<double> off_m;
  for (Index v = 0; v < skin.vertices_m.rows(); ++v) off_m.push_back(std::sqrt(faces.closest(skin.vertices_m.row(v)).squared_distance_m2));
  if (off_m.empty()) return 0;
  const auto middle = off_m.begin() + static_cast<std::ptrdiff_t>(off_m.size() / 2);
  std::nth_element(off_m.begin(), middle, off_m.end());
  return 1.48 * *middle;
}

constexpr double good_enough = 0.3;  // tet_quality: 17 degrees

/// Of a surface where it stands: given to its outline, an outline that noise moved, or loose facets.
enum class Foot { given, found, loose };

BuiltObject fill(const TriMesh& surface, Foot foot, const std::vector<Support>& supports, const BuildOptions& options,
                 const OnProgress& progress) {
  for (const Support& s : supports)
    if (!s.vertices.empty())
      throw Error(
          "names nodes, but the volume is made from a surface and its nodes are not known beforehand; name a plane, a "
          "box, a table or a wall instead",
          "support " + s.name);
  auto filled = geometry::tetrahedralise(surface, options.mesh, progress);
  BuiltObject out;
  out.model.surface = surface;
  out.model.volume = std::move(filled.mesh);
  const auto stand = [&](const Plane& plane) {
    if (foot == Foot::loose) geometry::lay_on(plane, out.model.volume);
    else geometry::stand_on(plane, surface, out.model.volume, foot == Foot::found ? good_enough : 0);
  };
  for (const Support& s : supports) {
    if (!is_plane(s.kind)) continue;
    stand(s.plane);
  }
  for (const Plane& plane : options.pressed_faces) {
    stand(plane);
  }
  out.model.embedding = geometry::embed(surface.vertices_m, out.model.volume);
  out.model.supports = supports;
  out.model.unseen_share = filled.unseen_share;
  add_warnings(out.model, filled.warnings);
  const double edge = mean_edge(geometry::boundary_surface(out.model.volume).surface);
  for (Support& s : out.model.supports) {
    // Where good elements leave nodes a hair above the plane, less than a surface from views is known to, they stand on it.
    if (is_plane(s.kind)) s.tolerance_m = std::max(s.tolerance_m, (foot == Foot::found ? 0.03 : 1e-3) * edge);
    else if (found_by_place(s.kind)) s.tolerance_m = std::max(s.tolerance_m, 0.1 * edge);
  }
  out.check = geometry::check_volume(out.model.volume);
  out.volume_error = filled.volume_error;
  out.surface_rms_m = filled.surface_rms_m;
  out.hausdorff_m = filled.hausdorff_m;
  return out;
}

}  // namespace

BuiltObject build_object(const TriMesh& surface, const std::vector<Support>& supports, const BuildOptions& options,
                         const OnProgress& progress) {
  return fill(surface, Foot::given, supports, options, progress);
}

BuiltObject build_object(const std::vector<PointCloud>& views, const FuseOptions& fuse, const std::vector<Support>& supports,
                         const BuildOptions& options, const OnProgress& progress) {
  std::vector<PointCloud> clouds = views;
  const bool uncertain =
      std::any_of(views.begin(), views.end(), [](const PointCloud& c) { return c.pose_std_m > 0 || c.pose_std_rad > 0; });
  std::vector<std::string> warnings;
  std::vector<Pose> correction;
  double by_poses_m = 0;
  if (fuse.support) drop_support(clouds, *fuse.support);
  if (const ForeignPoints foreign = drop_foreign(clouds, fuse.touched); foreign.share > 0)
    warnings.push_back(std::to_string(static_cast<int>(100 * foreign.share + 0.5)) + " % of what the views show stands about " +
                       std::to_string(static_cast<int>(1e3 * foreign.nearest_m + 0.5)) +
                       " mm beside the object, and was left out of its shape");
  if (options.align_views && uncertain) {
    std::vector<std::size_t> filled;
    std::vector<PointCloud> moving;
    for (std::size_t v = 0; v < clouds.size(); ++v)
      if (clouds[v].points_m.rows() > 0) filled.push_back(v), moving.push_back(clouds[v]);
    if (moving.size() > 1) {
      const auto aligned = registration::align_views(moving);
      if (aligned.converged) by_poses_m = left_by_poses_m(aligned, moving);
      correction.assign(clouds.size(), Pose::Identity());
      for (std::size_t k = 0; k < filled.size(); ++k) {
        correction[filled[k]] = aligned.correction[k];
        turn(clouds[filled[k]], aligned.correction[k]);
      }
      if (!aligned.converged) warnings.push_back("the views' poses could not be corrected: " + aligned.reason);
    }
  }
  const FusedViews fused = fuse_views(clouds, fuse);
  SurfaceOptions fine;
  fine.free = fuse.free, fine.support = fuse.support;
  TriMesh skin;
  if (fused.inside) skin = fused_surface(fused, fine);
  BuildOptions filling = options;
  if (fused.inside && options.finer_feet)
    for (const auto& near : finer_at_supports(supports, skin)) filling.mesh.finer.push_back(near);
  BuiltObject out = fill(fused.inside ? skin : fused.facets, fused.inside ? Foot::found : Foot::loose, supports, filling, progress);
  const double floating = drop_floating(supports, out.model.volume);
  if (floating > 0)
    warnings.push_back(std::to_string(static_cast<int>(100 * floating + 0.5)) +
                                 " % of the volume floats beside the rest and was left out");
  if (floating > 0) out.check = geometry::check_volume(out.model.volume);
  out.model.surface = geometry::boundary_surface(out.model.volume).surface;
  out.model.embedding = geometry::embed(out.model.surface.vertices_m, out.model.volume);
  out.around = fused.around;
  out.strip_m = fused.strip_m;
  out.symmetries = fused.symmetries;
  TriMesh seen = fused.facets;
  seen.triangles.conservativeResize(fused.seen, 3);
  const geometry::TriangleTree to_seen(seen);
  out.of_surface = seen_vertices(out.model.surface.vertices_m, fused, to_seen);
  if (fused.inside) out.slow_error_m = std::hypot(by_poses_m, faces_off_m(skin, out.model.surface));
  if (options.fine_surface) {
    const geometry::TriangleTree boundary(out.model.surface);
    if (floating > 0)
      fine.belongs = [&](const Vec3& p) { return boundary.within(p, std::pow(2 * fused.cell_m, 2)); };
    out.fine_surface = fused.inside && floating == 0 ? std::move(skin) : fused_surface(fused, fine);
    out.fine_embedding = geometry::embed(out.fine_surface.vertices_m, out.model.volume);
    out.of_fine_surface = seen_vertices(out.fine_surface.vertices_m, fused, to_seen);
  }
  out.view_correction = std::move(correction);
  if (fused.inside) {
    out.model.unseen_share = unseen_share(out);
  } else {  // the plane's share was not seen either
    const double all = fused.seen_area_m2 + fused.support_area_m2;
    out.model.unseen_share += (1 - out.model.unseen_share) * (all > 0 ? fused.support_area_m2 / all : 0);
  }
  out.model.warnings = std::move(warnings);  // facets are open by nature; what they say of holes is said by the share
  add_warnings(out.model, out.check.findings);
  if (out.model.unseen_share > 0.05)
    out.model.warnings.push_back(std::to_string(static_cast<int>(100 * out.model.unseen_share + 0.5)) +
                                 " % of the surface was not seen and is completed");
  return out;
}

BuiltObject build_object(const TetMesh& volume, const std::vector<Support>& supports) {
  BuiltObject out;
  out.check = geometry::check_volume(volume);
  for (const auto& f : out.check.findings)
    if (f.fatal) throw Error(f.message + "; repair the mesh, or give the surface and let it be filled", "rest volume");
  out.model.volume = volume;
  out.model.surface = geometry::boundary_surface(volume).surface;
  out.model.embedding = geometry::embed(out.model.surface.vertices_m, volume);
  out.model.supports = supports;
  add_warnings(out.model, out.check.findings);
  return out;
}

}  // namespace palpate::reconstruction
