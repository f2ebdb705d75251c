// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/recording.hpp"
#include "palpate/sensing/back_projection.hpp"
#include "palpate/sensing/plane_mask.hpp"

namespace palpate::sensing {

struct ObserveOptions {
  BackProjectionOptions back_projection;
  PlaneMaskOptions planes;
};

/// What a frame says about the object: its rays without the recorded mask's pixels, without tables and walls of the
/// environment, without depth edges.
/// @throws Error as back_project and mask_planes do.
RayCloud observe(const DepthFrame& frame, const Environment& environment, const ObserveOptions& options = {},
                 Points* normals_base = nullptr);

}  // namespace palpate::sensing
