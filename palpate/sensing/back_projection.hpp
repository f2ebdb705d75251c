// SPDX-License-Identifier: Apache-2.0
// From a depth image to measurements that a likelihood may trust: rays with a standard deviation, normals, and marks on the
// pixels that mix two surfaces. Pure functions of the frame.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

struct BackProjectionOptions {
  double min_depth_m = 0.05;         ///< nearer ones are invalid
  double max_depth_m = 10.0;         ///< farther ones are invalid
  int stride_px = 1;                 ///< keep every n-th row and column (all of them serve normals and edges)
  bool remove_edges = true;          ///< drop pixels at depth edges, where flying pixels live
  double edge_sigmas = 4.0;          ///< neighbours that differ by more than this many standard deviations from what the surface
                                     ///< around them says are an edge ...
  double edge_incidence_rad = 1.4;   ///< ... unless a surface seen at this angle to its normal explains the difference
  /// A pixel's weight, and whether it stays, are told by its neighbours and not by its own depth, a surface's fall is taken off
  /// before edges are judged, and a slope's own noise is allowed for: those that stay are right on average, which a likelihood
  /// needs. Otherwise more of those that mix two surfaces go, which shapes need.
  bool blind_to_own_noise = true;
  int edge_margin_px = 1;            ///< and this many pixels around an edge go too
  bool remove_hole_borders = false;  ///< drop pixels beside missing data as well (sensors that smear around holes)
  int normal_radius_px = 3;          ///< half width of the window that normals are fitted in
  int min_normal_pixels = 6;         ///< fewer neighbours on the same surface: no normal, the pixel is dropped
  double max_incidence_rad = 1.4;    ///< pixels seen at a more grazing angle are dropped
  bool smooth = false;  ///< ranges are those of the plane that the normal was fitted with: for shapes, not for a likelihood
};

/// @throws Error naming the option that is out of range.
void check(const BackProjectionOptions& options);

/// Where the camera saw something usable: 1 = invalid. Missing, not finite, out of range, masked by frame.mask, or (with
/// remove_edges) at a depth edge.
/// @throws Error when image, mask and camera differ in size, or the frame's noise is unknown.
MaskImage invalid_pixels(const DepthFrame& frame, const BackProjectionOptions& options = {});

/// Unit normals in the camera frame, facing the camera: one row a pixel (row-major), NaN where there is none. A plane is
/// linear in inverse depth over the undistorted image, so the fit is a 3 x 3 least-squares problem and exact on planes.
/// @param invalid  as from invalid_pixels
Points normals(const DepthFrame& frame, const MaskImage& invalid, const BackProjectionOptions& options = {});

/// The step that all depths of an image are whole multiples of (a millimetre, a tenth of one, ...), as integer formats have it;
/// 0 where there is none, or too few different depths to tell.
double depth_step_m(const DepthImage& depth_m);

/// Valid pixels as rays in the base frame, with the standard deviation along the ray from the sensor's noise model at that
/// depth and incidence, as a pixel's neighbours tell them, and from the rounding to whole steps (a step over the root of 12).
/// @param normals_base  if given: filled with one unit normal a ray (base frame, facing the camera)
/// @throws Error as invalid_pixels does.
RayCloud back_project(const DepthFrame& frame, const BackProjectionOptions& options = {}, Points* normals_base = nullptr);

/// End points of the rays with their normals; sigma_m is the rays' (isotropic where only the ray's is known).
PointCloud to_point_cloud(const RayCloud& rays, const Points& normals_base = Points(0, 3));

}  // namespace palpate::sensing
