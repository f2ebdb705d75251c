// SPDX-License-Identifier: Apache-2.0
#include "cli/resumed_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/io/recording_names.hpp"

namespace palpate::cli {
namespace {

constexpr double same_m = 1e-6;    // what a mesh file may round
constexpr double line_m = 0.003;   // an arm repeats to some tenths of a millimetre, and follows what it touches
constexpr double same_direction = 1e-6;

/// Compares what is there with what is before the robot now; the first difference ends it.
class Comparison {
 public:
  explicit Comparison(const std::filesystem::path& folder) : folder_(folder.string()) {}

  void same(const std::string& what, const std::string& there, const std::string& now) const {
    if (there == now) return;
    throw Error(fmt::format("cannot go on: its {} is {}, and this command has {}; give the arguments that it was begun with, or "
                            "choose another folder",
                            what, there.empty() ? "not given" : there, now.empty() ? "none" : now),
                folder_);
  }
  void same(const std::string& what, double there, double now) const {
    const bool close = std::abs(there - now) <= 1e-9 * std::max(std::abs(there), std::abs(now));
    if (!close) same(what, fmt::format("{}", there), fmt::format("{}", now));
  }
  void same(const std::string& what, const Vec3& there, const Vec3& now) const {
    if ((there - now).cwiseAbs().maxCoeff() > 1e-9) same(what, words(there), words(now));
  }
  void same_size(const std::string& what, std::size_t there, std::size_t now) const {
    same("number of " + what, std::to_string(there), std::to_string(now));
  }
  void same(const std::string& what, const Points& there, const Points& now) const {
    same_size("points of " + what, std::size_t(there.rows()), std::size_t(now.rows()));
    const double apart_m = there.rows() > 0 ? (there - now).cwiseAbs().maxCoeff() : 0;
    if (!(apart_m <= same_m)) differ(what, fmt::format("points of it are up to {:.3g} m elsewhere", apart_m));
  }
  template <typename Rows>
  void same_rows(const std::string& what, const Rows& there, const Rows& now) const {
    same_size(what, std::size_t(there.rows()), std::size_t(now.rows()));
    if (there.rows() != now.rows() || there.cols() != now.cols() || !(there.array() == now.array()).all())
      differ(what, "they join other points");
  }
  [[noreturn]] void differ(const std::string& what, const std::string& how) const {
    throw Error(fmt::format("cannot go on: its {} is not this command's: {}; give the arguments that it was begun with, or choose "
                            "another folder",
                            what, how),
                folder_);
  }
  static std::string words(const Vec3& v) { return fmt::format("({:.6g} {:.6g} {:.6g})", v.x(), v.y(), v.z()); }

 private:
  std::string folder_;
};

const char* kind_of(const Rest& rest) { return rest.volume ? "a volume mesh" : rest.surface ? "a surface mesh" : "views"; }

void compare_shape(const Comparison& as, const Rest& there, const Rest& now) {
  as.same("rest shape", kind_of(there), kind_of(now));
  as.same("rest state", io::name_of(io::rest_state_names, there.state), io::name_of(io::rest_state_names, now.state));
  if (there.volume) {
    as.same("rest shape", there.volume->nodes_m, now.volume->nodes_m);
    as.same_rows("rest shape's tetrahedra", there.volume->tetrahedra, now.volume->tetrahedra);
  } else if (there.surface) {
    as.same("rest shape", there.surface->vertices_m, now.surface->vertices_m);
    as.same_rows("rest shape's triangles", there.surface->triangles, now.surface->triangles);
  } else {
    as.same_size("views", there.views.size(), now.views.size());
  }
}

void compare_tool(const Comparison& as, const Tool& there, const Tool& now) {
  as.same("tool", there.name, now.name);
  const std::string tool = "tool " + there.name;
  as.same(tool + ": shape", io::name_of(io::tool_names, there.shape), io::name_of(io::tool_names, now.shape));
  as.same(tool + ": contact", io::name_of(io::contact_names, there.contact), io::name_of(io::contact_names, now.contact));
  as.same(tool + ": radius_m", there.radius_m, now.radius_m);
  as.same(tool + ": length_m", there.length_m, now.length_m);
  as.same(tool + ": compliance_m_per_n", there.compliance_m_per_n, now.compliance_m_per_n);
  as.same(tool + ": compliance_std_m_per_n", there.compliance_std_m_per_n, now.compliance_std_m_per_n);
  as.same(tool + ": friction_coefficient", there.friction_coefficient, now.friction_coefficient);
}

void compare_support(const Comparison& as, const Support& there, const Support& now, std::size_t number) {
  const std::string support = "support " + (there.name.empty() ? std::to_string(number) : there.name);
  as.same(support + ": name", there.name, now.name);
  as.same(support + ": kind", io::name_of(io::support_names, there.kind), io::name_of(io::support_names, now.kind));
  as.same(support + ": contact", io::name_of(io::contact_names, there.contact), io::name_of(io::contact_names, now.contact));
  as.same(support + ": friction_coefficient", there.friction_coefficient, now.friction_coefficient);
  as.same(support + ": compliance_m_per_n", there.compliance_m_per_n, now.compliance_m_per_n);
  as.same(support + ": compliance_std_m_per_n", there.compliance_std_m_per_n, now.compliance_std_m_per_n);
  as.same(support + ": point_m", there.plane.point_m, now.plane.point_m);
  as.same(support + ": normal", there.plane.normal, now.plane.normal);
  as.same(support + ": min_m", there.box_min_m, now.box_min_m);
  as.same(support + ": max_m", there.box_max_m, now.box_max_m);
  as.same_size(support + "'s nodes", there.vertices.size(), now.vertices.size());
  if (there.vertices != now.vertices) as.differ(support, "it holds other nodes");
}

void compare_robot(const Comparison& as, const Recording& there, const Recording& now) {
  as.same("robot", there.robot ? there.robot->name : std::string(), now.robot ? now.robot->name : std::string());
  if (!there.robot) return;  // joints have no names then
  as.same("robot's joints", fmt::format("{}", fmt::join(there.joint_names, ", ")), fmt::format("{}", fmt::join(now.joint_names, ", ")));
}

}  // namespace

void must_be_same_scene(const Recording& there, const Recording& now, bool by_views, const std::filesystem::path& folder) {
  const Comparison as(folder);
  as.same("object", there.name, now.name);
  if (!by_views) compare_shape(as, there.rest, now.rest);
  as.same("`supports: free`", there.free ? "said" : "not said", now.free ? "said" : "not said");
  as.same_size("supports", there.supports.size(), now.supports.size());
  for (std::size_t i = 0; i < there.supports.size(); ++i) compare_support(as, there.supports[i], now.supports[i], i + 1);
  as.same_size("tools", there.tools.size(), now.tools.size());
  for (std::size_t i = 0; i < there.tools.size(); ++i) compare_tool(as, there.tools[i], now.tools[i]);
  as.same_size("regions", there.regions.size(), now.regions.size());
  for (std::size_t i = 0; i < there.regions.size(); ++i) as.same("region", there.regions[i].name, now.regions[i].name);
  compare_robot(as, there, now);
  as.same("force_scale_std", there.force_scale_std, now.force_scale_std);
  as.same("force_cross_talk_std", there.force_cross_talk_std, now.force_cross_talk_std);
  as.same("model's material", there.model.material, now.model.material);
}

double not_before_s(const std::vector<Push>& pushes) {
  constexpr double pause_s = 1;
  return pushes.empty() || pushes.back().steps.empty() ? 0 : pushes.back().steps.back().time_s + pause_s;
}

void must_be_same_push(const Push& recorded, const acquisition::PushPlan& plan, const acquisition::PushOptions& protocol,
                       const std::filesystem::path& folder) {
  const Comparison as(folder);
  const auto along_the_line = [&](const Vec3& point_m, double least_m, double most_m) {
    const Vec3 from_plan_m = point_m - plan.contact_m;
    const double along_m = from_plan_m.dot(plan.direction);
    return (from_plan_m - along_m * plan.direction).norm() <= line_m && along_m >= least_m - line_m && along_m <= most_m + line_m;
  };
  for (const Step& step : recorded.steps) {
    if (step.loads.empty()) {  // before or after contact
      if (step.T_base_tip && (Vec3(step.T_base_tip->linear().col(2)) - plan.direction).norm() > 0.1)
        as.same(recorded.name + ": direction", Comparison::words(step.T_base_tip->linear().col(2)), Comparison::words(plan.direction));
      if (step.T_base_tip && !along_the_line(step.T_base_tip->translation(), -1, 1))
        as.same(recorded.name + ": place before the object", Comparison::words(step.T_base_tip->translation()),
                Comparison::words(plan.contact_m - protocol.start_distance_m * plan.direction));
      continue;
    }
    const Load& load = step.loads.front();
    as.same(recorded.name + ": tool", load.tool, plan.tool);
    if ((load.direction - plan.direction).norm() > same_direction)
      as.same(recorded.name + ": direction", Comparison::words(load.direction), Comparison::words(plan.direction));
    if (!along_the_line(load.contact_m, -protocol.start_distance_m, protocol.search_distance_m))
      as.same(recorded.name + ": contact", Comparison::words(load.contact_m), Comparison::words(plan.contact_m));
  }
}

}  // namespace palpate::cli
