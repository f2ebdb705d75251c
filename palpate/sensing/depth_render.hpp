// SPDX-License-Identifier: Apache-2.0
// Depth image of triangles by z-buffer: what a camera would see of a body whose model and pose are known.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// One rigid body in the scene; the mesh must outlive the call.
struct PosedMesh {
  const TriMesh* mesh = nullptr;
  Pose T_base_mesh = Pose::Identity();
  double near_m = 1e-3;  ///< depth from which on it shows
};

/// Depth along the optical axis at every pixel centre, 0 where nothing is seen; both sides of a triangle show. Triangles
/// that reach behind the camera are clipped. With a distorted camera vertices are projected exactly and edges taken as
/// straight.
/// @throws Error as check(camera) does.
DepthImage render_depth(const std::vector<PosedMesh>& bodies, const Camera& camera, const Pose& T_base_camera);

struct RenderMaskOptions {
  double depth_margin_m = 0.005;   ///< constant part of the tolerance between measured and rendered depth
  double depth_sigmas = 4.0;       ///< plus this many standard deviations of the sensor at that depth
  double lateral_margin_m = 0.0;   ///< error of the body's pose across the view: its outline is widened by it
  double lateral_margin_px = 1.0;  ///< and by this, for pixels that mix body and background
};

/// @throws Error naming the option that is out of range.
void check(const RenderMaskOptions& options);

/// Pixels that show the rendered body or what it hides from view: 1 where a measurement lies at or behind the rendered
/// depth, less the margins. A pixel in front of the body (something covers it) stays valid, and so does one without data.
/// @throws Error when the images differ in size.
MaskImage mask_rendered(const DepthFrame& frame, DepthImage rendered_m, const RenderMaskOptions& options = {});

}  // namespace palpate::sensing
