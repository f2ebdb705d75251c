// SPDX-License-Identifier: Apache-2.0
// From what was seen or given of an object at rest to something that can be simulated.
#pragma once

#include "palpate/core/recording.hpp"
#include "palpate/geometry/tetrahedralise.hpp"
#include "palpate/reconstruction/fuse_views.hpp"

namespace palpate::reconstruction {

struct BuildOptions {
  geometry::TetrahedraliseOptions mesh;  ///< of a surface that has to be filled
  bool align_views = true;  ///< correct the poses of views that have a prior spread (PointCloud::pose_std_*), all at once
  bool finer_feet = false;  ///< of views from all around: short edges where the object stands (geometry::finer_at_feet)
  bool fine_surface = false;  ///< of views: also make BuiltObject::fine_surface (half a second)
  /// Planes that platens press on: faces along them are laid flat as those on a support are; a platen moves what is in its plane.
  std::vector<Plane> pressed_faces = {};
};

/// What sensors saw of a surface's vertices.
struct SeenVertices {
  std::vector<char> seen;  ///< 1 where a sensor saw it
  /// How far the surface may be off along its normal, one standard deviation. Where nothing was seen: half of the distance to the
  /// nearest part that was, for the completion may be anywhere up to there.
  VectorX sigma_m;
};

struct BuiltObject {
  ObjectModel model;
  geometry::VolumeCheck check;         ///< of model.volume
  std::optional<double> volume_error;  ///< as in geometry::Tetrahedralisation; empty for a given volume
  double surface_rms_m = 0;            ///< between given surface and boundary of the volume
  double hausdorff_m = 0;
  SeenVertices of_surface;  ///< of model.surface; empty where it was given
  /// Watertight, finer than the boundary of the volume and nearer to what was seen (see fused_surface), and how the volume
  /// carries it along.
  TriMesh fine_surface;
  SurfaceEmbedding fine_embedding;
  SeenVertices of_fine_surface;
  /// What neighbouring places of the seen part are off by together, one standard deviation: what the views' poses leave once they
  /// were corrected by each other, and what flat faces of the volume are off the fused surface. Of views from all around; else 0.
  double slow_error_m = 0;
  double strip_m = 0;      ///< of views from all around: FusedViews::strip_m
  int symmetries = 0;      ///< of views from one side: FusedViews::symmetries
  bool around = false;     ///< of views: the object was seen from all sides, down to its support (FusedViews::around)
  std::vector<Pose>
      view_correction;  ///< applied to each view on the left before fusing; empty when poses were taken as known
};

/// Fills a surface and ties it to the volume. Boundary faces that run along a support's plane (plane, table, wall) are laid flat
/// on it, so that it holds whole faces; boxes get a tolerance of a tenth of the boundary's mean edge at least, because the
/// boundary follows the surface only that well.
/// @throws Error as geometry::tetrahedralise.
BuiltObject build_object(const TriMesh& surface, const std::vector<Support>& supports, const BuildOptions& options = {},
                         const OnProgress& progress = {});

/// Aligns views whose poses are not exactly known (see registration::align_views), fuses them (see fuse_views), what lies on
/// or behind the support left out, and fills them; the surface is the watertight boundary of the volume.
BuiltObject build_object(const std::vector<PointCloud>& views, const FuseOptions& fuse, const std::vector<Support>& supports,
                         const BuildOptions& options = {}, const OnProgress& progress = {});

/// Takes a volume as it is; its boundary is the surface. @throws Error when an element is inverted or has no volume.
BuiltObject build_object(const TetMesh& volume, const std::vector<Support>& supports);

}  // namespace palpate::reconstruction
