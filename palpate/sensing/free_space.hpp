// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::sensing {

struct FreeSpaceOptions {
  double sigmas = 4;       ///< so many standard deviations of depth and pose before and beside what was seen are not called free
  double margin_m = 0.003; ///< nor is this
  /// That the object stands on: where a pixel and its neighbours together see this plane, free space reaches down to it, and the
  /// noise of a single depth does not count. Nothing: every pixel for itself.
  std::optional<Plane> support = {};
};

/// Places that cameras looked through: nothing stood there.
class FreeSpace {
 public:
  /// @param frames  poses and planes in the base frame
  /// @throws Error as back_project does.
  explicit FreeSpace(const std::vector<DepthFrame>& frames, const FreeSpaceOptions& options = {});

  /// True where a camera measured something farther away in this direction, on the pixel and on those around it that have data;
  /// pixels that are masked or have no depth say nothing.
  bool operator()(const Vec3& point_base_m) const;

 private:
  struct View {
    Camera camera;
    Pose T_camera_base;
    DepthImage free_m;  // depth up to which a pixel and its neighbours are free; 0: nothing is known
  };
  std::vector<View> views_;
};

}  // namespace palpate::sensing
