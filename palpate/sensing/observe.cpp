// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/observe.hpp"

namespace palpate::sensing {

RayCloud observe(const DepthFrame& frame, const Environment& environment, const ObserveOptions& options,
                 Points* normals_base) {
  return back_project(with_mask(frame, mask_planes(frame, environment.planes, options.planes)), options.back_projection,
                      normals_base);
}

}  // namespace palpate::sensing
