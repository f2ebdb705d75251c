// SPDX-License-Identifier: Apache-2.0
// What the sensors of every step saw, without what is not the object.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "palpate/estimation/grazing.hpp"
#include "palpate/identify.hpp"
#include "palpate/sensing/arm_mask.hpp"
#include "palpate/sensing/back_projection.hpp"
#include "palpate/sensing/cloud_mask.hpp"
#include "palpate/sensing/lens_scatter.hpp"
#include "palpate/sensing/masked_points.hpp"
#include "palpate/sensing/plane_mask.hpp"

namespace palpate {
namespace {

constexpr Index masked_a_step = 1500;  // points under the masks that are kept for figures
constexpr double rays_a_frame = 6000;  // beyond that, noise is not what limits E: neighbouring pixels err together

/// Every n-th row and column of an image, so that some thousand rays are left.
RayCloud thinned_rays(const DepthFrame& frame) {
  sensing::BackProjectionOptions options;
  RayCloud rays = sensing::back_project(frame, options);
  options.stride_px = static_cast<int>(std::floor(std::sqrt(static_cast<double>(rays.range_m.size()) / rays_a_frame)));
  return options.stride_px > 1 ? sensing::back_project(frame, options) : rays;
}

/// The object's surroundings: its rest shape and half its size around, where there is a shape.
std::pair<Vec3, Vec3> surroundings(const Recording& recording) {
  const Points* rest_m = recording.rest.surface  ? &recording.rest.surface->vertices_m
                         : recording.rest.volume ? &recording.rest.volume->nodes_m
                                                 : nullptr;
  if (rest_m == nullptr || rest_m->rows() == 0) return {Vec3::Constant(-1e3), Vec3::Constant(1e3)};
  const Vec3 low = rest_m->colwise().minCoeff(), high = rest_m->colwise().maxCoeff();
  const Vec3 margin = Vec3::Constant(0.5 * (high - low).maxCoeff());
  return {low - margin, high + margin};
}

/// Tables and walls, of the room and those that hold the object.
std::vector<Plane> half_spaces(const Recording& recording) {
  std::vector<Plane> planes = recording.environment.planes;
  for (const Support& support : recording.supports)
    if (support.kind == SupportKind::table || support.kind == SupportKind::wall) planes.push_back(support.plane);
  return planes;
}

/// Names of the frames' cameras, told by their intrinsics: one that stands at a place, or one that is carried around. "" for a
/// camera of one frame.
std::vector<std::string> cameras_of(const std::vector<const DepthFrame*>& frames) {
  const auto same_place = [&](const DepthFrame& a, const DepthFrame& b) {
    return a.camera == b.camera && a.T_base_camera.matrix().isApprox(b.T_base_camera.matrix(), 1e-9);
  };
  std::vector<bool> stands;
  for (const DepthFrame* one : frames)
    stands.push_back(std::count_if(frames.begin(), frames.end(), [&](const DepthFrame* other) { return same_place(*one, *other); }) > 1);
  std::vector<std::string> names;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    std::size_t first = frames.size(), count = 0;
    for (std::size_t j = 0; j < frames.size(); ++j) {
      const bool belongs = stands[i] ? same_place(*frames[i], *frames[j]) : !stands[j] && frames[i]->camera == frames[j]->camera;
      if (belongs && ++count == 1) first = j;
    }
    names.push_back(count > 1 ? std::to_string(first) : "");
  }
  return names;
}

/// How many clouds of the recording are the first of their step, the second, ...
std::vector<int> clouds_at(const Recording& recording) {
  std::vector<int> count;
  for (const auto& push : recording.pushes) {
    for (const auto& step : push.steps) {
      std::size_t at = 0;
      for (const auto& observation : step.observations) {
        if (!std::holds_alternative<PointCloud>(observation)) continue;
        if (count.size() == at) count.push_back(0);
        ++count[at++];
      }
    }
  }
  return count;
}

}  // namespace

estimation::Inputs observe(const Recording& recording, std::vector<Points>* masked_m) {
  estimation::Inputs inputs;
  std::vector<const DepthFrame*> frames;
  for (const auto& push : recording.pushes)
    for (const auto& step : push.steps)
      for (const auto& observation : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&observation)) frames.push_back(frame);
  const std::vector<std::string> cameras = cameras_of(frames);
  const std::vector<int> clouds = clouds_at(recording);
  std::size_t frame_number = 0;
  const auto [low_m, high_m] = surroundings(recording);
  const std::vector<Plane> planes = half_spaces(recording);
  if (masked_m != nullptr) masked_m->clear();
  const sensing::ArmMask arm(recording);
  for (const auto& push : recording.pushes) {
    for (const auto& step : push.steps) {
      auto& terms = inputs.emplace_back();
      if (masked_m != nullptr) masked_m->emplace_back(0, 3);
      std::size_t cloud_number = 0;
      for (const auto& observation : step.observations) {
        if (const auto* frame = std::get_if<DepthFrame>(&observation)) {
          const auto masked = sensing::with_mask(arm.without_arm(*frame, push, step), sensing::mask_planes(*frame, recording.environment.planes));
          if (masked_m != nullptr && masked_m->back().rows() == 0) {
            masked_m->back() = sensing::masked_points(masked, low_m, high_m, masked_a_step);
          }
          terms.push_back(estimation::RayObservation{thinned_rays(masked), frame->pose_std_m, frame->pose_std_rad,
                                                     frame->noise.bias_std_m, sensing::lens_scatter(*frame), cameras[frame_number++],
                                                     frame->T_base_camera.linear(),
                                                     estimation::outline_margin_px / std::min(frame->camera.fx_px, frame->camera.fy_px)});
        } else if (const auto* cloud = std::get_if<PointCloud>(&observation)) {
          PointCloud of_object = sensing::points_of_object(arm.without_arm(*cloud, push, step), planes, low_m, high_m);
          // Where a cloud does not say whose it is, the first one of every step is taken for one camera's, the second for another's.
          if (!of_object.camera.empty())
            of_object.camera = "clouds of " + of_object.camera;
          else if (clouds[cloud_number] > 1)
            of_object.camera = "clouds " + std::to_string(cloud_number);
          ++cloud_number;
          terms.push_back(std::move(of_object));
        } else if (const auto* markers = std::get_if<Markers>(&observation)) {
          terms.push_back(*markers);
        } else if (const auto* travel = std::get_if<ToolTravel>(&observation)) {
          terms.push_back(*travel);
        } else if (const auto* wrench = std::get_if<Wrench>(&observation)) {
          terms.push_back(*wrench);
        }
      }
    }
  }
  return inputs;
}

}  // namespace palpate
