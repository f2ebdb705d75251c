// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/names_of_unknowns.hpp"
#include "palpate/estimation/terms/surface_terms.hpp"

namespace palpate::estimation {
namespace {

template <class... Makers>
struct Table : Makers... {
  using Makers::operator()...;
};
template <class... Makers>
Table(Makers...) -> Table<Makers...>;

}  // namespace

std::unique_ptr<Term> make_term(const TermInput& input, const TermContext& context) {
  // One line a measurement term.
  const Table table{
      [&](const RayObservation& rays) { return make_ray_term(rays, context); },
      [&](const PointCloud& cloud) { return make_cloud_term(cloud, context); },
      [&](const Markers& markers) { return make_marker_term(markers, context); },
      [&](const ToolTravel& travel) { return make_travel_term(travel, context); },
      [&](const Wrench& wrench) { return make_wrench_term(wrench, context); },
  };
  return std::visit(table, input);
}

std::size_t load_of(const TermContext& context, const std::string& tool, const std::string& what) {
  const auto& loads = context.model.step(context.step).loads;
  if (tool.empty() && loads.size() == 1) return 0;
  for (std::size_t l = 0; l < loads.size(); ++l) {
    if (loads[l].tool == tool) return l;
  }
  throw Error(tool.empty() ? "several tools act in this step: say which one was measured (`tool`)"
                           : "no tool of this name acts in the step",
              context.model.step(context.step).source + " " + what + (tool.empty() ? "" : ".tool " + tool));
}

std::string step_suffix(const TermContext& context) {
  return "[" + context.model.push(context.step).name + ":" + std::to_string(context.model.index(context.step).step) + "]";
}

namespace {

int add_pose(Unknowns& unknowns, const std::string& what, const std::string& suffix, double pose_std_m, double pose_std_rad) {
  const int first = unknowns.size();
  for (const char* axis : {"_x", "_y", "_z"})
    unknowns.add({what + axis + suffix, "m", 0, pose_std_m, -1, 1, !(pose_std_m > 0)});
  for (const char* axis : {"_x", "_y", "_z"})
    unknowns.add({what + "_rotation" + axis + suffix, "rad", 0, pose_std_rad, -1, 1, !(pose_std_rad > 0)});
  return first;
}

}  // namespace

int add_frame_pose(const TermContext& context, double pose_std_m, double pose_std_rad) {
  if (!(pose_std_m > 0) && !(pose_std_rad > 0)) return -1;
  return add_pose(context.unknowns, of_frame(context.frame), step_suffix(context), pose_std_m, pose_std_rad);
}

int add_camera_pose(const TermContext& context, const std::string& camera, double pose_std_m, double pose_std_rad) {
  if (camera.empty() || (!(pose_std_m > 0) && !(pose_std_rad > 0))) return -1;
  const auto [at, fresh] = context.shared.try_emplace("camera[" + camera + "]", -1);
  if (fresh) at->second = add_pose(context.unknowns, "camera", "[" + camera + "]", pose_std_m, pose_std_rad);
  return at->second;
}

RigidMap frame_pose(const VectorX& unknowns, int pose, const Vec3& pivot_m) {
  RigidOffset frame;
  frame.pivot_m = pivot_m;
  if (pose >= 0) {
    frame.translation_m = unknowns.segment<3>(pose);
    frame.rotation_rad = unknowns.segment<3>(pose + 3);
  }
  return RigidMap(frame);
}

}  // namespace palpate::estimation
