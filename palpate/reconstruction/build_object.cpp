// SPDX-License-Identifier: Apache-2.0
#include "palpate/reconstruction/build_object.hpp"

#include "palpate/core/error.hpp"
#include "palpate/geometry/embedding.hpp"

namespace palpate::reconstruction {
namespace {

double mean_edge(const TriMesh& m) {
  double sum = 0;
  for (Index i = 0; i < m.triangles.rows(); ++i)
    for (int k = 0; k < 3; ++k)
      sum += (m.vertices_m.row(m.triangles(i, k)) - m.vertices_m.row(m.triangles(i, (k + 1) % 3))).norm();
  return m.triangles.rows() > 0 ? sum / double(3 * m.triangles.rows()) : 0;
}

bool found_by_place(SupportKind kind) {
  return kind == SupportKind::plane || kind == SupportKind::box || kind == SupportKind::table || kind == SupportKind::wall;
}

void add_warnings(ObjectModel& model, const std::vector<geometry::Finding>& findings) {
  for (const auto& f : findings) model.warnings.push_back(f.message);
}

}  // namespace

BuiltObject build_object(const TriMesh& surface, const std::vector<Support>& supports, const BuildOptions& options,
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
  out.model.embedding = geometry::embed(surface.vertices_m, out.model.volume);
  out.model.supports = supports;
  out.model.unseen_share = filled.unseen_share;
  add_warnings(out.model, filled.warnings);
  const double edge = mean_edge(geometry::boundary_surface(out.model.volume).surface);
  for (Support& s : out.model.supports)
    if (found_by_place(s.kind)) s.tolerance_m = std::max(s.tolerance_m, 0.1 * edge);
  out.check = std::move(filled.check);
  out.volume_error = filled.volume_error;
  out.surface_rms_m = filled.surface_rms_m;
  out.hausdorff_m = filled.hausdorff_m;
  return out;
}

BuiltObject build_object(const std::vector<PointCloud>& views, const FuseOptions& fuse, const std::vector<Support>& supports,
                         const BuildOptions& options, const OnProgress& progress) {
  const FusedViews fused = fuse_views(views, fuse);
  BuiltObject out = build_object(fused.facets, supports, options, progress);
  out.model.surface = geometry::boundary_surface(out.model.volume).surface;
  out.model.embedding = geometry::embed(out.model.surface.vertices_m, out.model.volume);
  // the plane's share was not seen either
  const double all = fused.seen_area_m2 + fused.support_area_m2;
  out.model.unseen_share += (1 - out.model.unseen_share) * (all > 0 ? fused.support_area_m2 / all : 0);
  out.model.warnings.clear();  // facets are open by nature; what they say of holes is said by the share
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
