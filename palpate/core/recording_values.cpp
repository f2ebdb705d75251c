// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/recording_values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/core/physical_range.hpp"

namespace palpate {
namespace {

class ValueChecker {
 public:
  void check(const Recording& recording) {
    tools_ = &recording.tools;
    any_size_ = recording.accept_size;
    spread("force_scale_std", recording.force_scale_std, ranges::share_std);
    spread("force_cross_talk_std", recording.force_cross_talk_std, ranges::share_std);
    spread("time_offset_std_s", recording.time_offset_std_s, ranges::clock_std);
    spread("density_kg_m3", recording.density_kg_m3);
    const double density = recording.density_kg_m3;
    if (std::isfinite(density) && (density > 30000 || (density > 0 && density < 5)))
      add("density_kg_m3", "is outside 5 to 30000 kg/m3; is it in g/cm3? Multiply by 1000");
    spread("density_std_kg_m3", recording.density_std_kg_m3);
    finite("environment.gravity_m_s2", recording.environment.gravity_m_s2);
    check(recording.rest);
    differ("tools", recording.tools);
    differ("pushes", recording.pushes);
    differ("regions", recording.regions);
    for (std::size_t i = 0; i < recording.supports.size(); ++i) check(recording.supports[i], "supports[" + std::to_string(i) + "].");
    for (std::size_t i = 0; i < recording.tools.size(); ++i) check(recording.tools[i], "tools[" + std::to_string(i) + "].");
    for (std::size_t p = 0; p < recording.pushes.size(); ++p) {
      const Push& push = recording.pushes[p];
      const std::string at = "pushes[" + std::to_string(p) + "].";
      spread(at + "force_tare_std_n", push.force_tare_std_n, ranges::force_std);
      spread(at + "travel_offset_std_m", push.travel_offset_std_m, ranges::length_std);
      spread(at + "torque_tare_std_nm", push.torque_tare_std_nm, ranges::torque_std);
      spread(at + "tip_std_m", push.tip_std_m, ranges::length_std);
      for (std::size_t s = 0; s < push.steps.size(); ++s) {
        const std::string step = at + "steps[" + std::to_string(s) + "].";
        check(push.steps[s], recording.tools, step);
        one_place(push, push.steps[s], recording.tools, step);
        if (s > 0 && push.steps[s].time_s != 0 && push.steps[s].time_s == push.steps[s - 1].time_s)
          add(step + "time_s", "is that of the step before; a step counts once");
        if (s > 0 && push.steps[s].time_s < push.steps[s - 1].time_s) add(step + "time_s", "goes back, from that of the step before; order steps by time");
      }
    }
  }

  void check(const Step& step, const std::vector<Tool>& tools, const std::string& at) {
    tools_ = &tools;
    finite(at + "time_s", step.time_s);
    if (step.T_base_tip) finite(at + "T_base_tip", step.T_base_tip->matrix());
    for (const double angle : step.joints_rad)
      if (!finite(at + "joints_rad", angle)) break;
    for (std::size_t l = 0; l < step.loads.size(); ++l) check(step.loads[l], at + "loads[" + std::to_string(l) + "].");
    for (std::size_t o = 0; o < step.observations.size(); ++o)
      std::visit([&](const auto& one) { check(one, at + "observations[" + std::to_string(o) + "]."); }, step.observations[o]);
  }

  std::vector<WrongValue> found() && { return std::move(found_); }

 private:
  void add(std::string where, std::string what) { found_.push_back({std::move(where), std::move(what)}); }

  bool finite(const std::string& where, double value) {
    if (!std::isfinite(value)) add(where, "is not a finite number");
    return std::isfinite(value);
  }
  template <typename Derived>
  bool finite(const std::string& where, const Eigen::MatrixBase<Derived>& values) {
    const bool fine = values.allFinite();
    if (!fine) add(where, "holds NaN or infinity");
    return fine;
  }
  bool spread(const std::string& where, double value) {
    const bool fine = finite(where, value) && value >= 0;
    if (value < 0) add(where, fmt::format("is negative, {}; it must be 0 or more", value));
    return fine;
  }
  void spread(const std::string& where, double value, const PhysicalRange& range) {
    if (spread(where, value)) within(where, value, range);
  }
  void size(const std::string& where, double value, const PhysicalRange& of_tools) {
    if (spread(where, value) && !any_size_) within(where, value, {0, of_tools.most, of_tools.unit, of_tools.slip});
  }
  bool sigma(const std::string& where, double value, const PhysicalRange& range) {
    if (value > 0 && std::isfinite(value)) return within(where, value, range);
    add(where, "must be a number above 0: the standard deviation of what was measured");
    return false;
  }
  bool within(const std::string& where, double value, const PhysicalRange& range) {
    const bool fine = value >= range.least && value <= range.most;
    const std::string unit = *range.unit == '\0' ? "" : std::string(" ") + range.unit;
    if (!fine)
      add(where, fmt::format("is {:g}{}, which cannot be: {:g} to {:g}{} is possible; {}", value, unit, range.least, range.most, unit, range.slip));
    return fine;
  }
  /// Unknowns and messages go by these names.
  template <typename Named>
  void differ(const std::string& list, const std::vector<Named>& all) {
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (!all[i].name.empty() && all[i].name == all[j].name) return add(fmt::format("{}[{}].name", list, i), fmt::format("'{}' is that of {}[{}] too; names must differ", all[i].name, list, j));
  }

  template <typename Indices>
  void indices(const std::string& where, const Indices& of, Eigen::Index count) {
    if (of.size() > 0 && (of.minCoeff() < 0 || of.maxCoeff() >= count))
      add(where, "names vertices from " + std::to_string(of.minCoeff()) + " to " + std::to_string(of.maxCoeff()) + ", there are " + std::to_string(count));
  }

  void check(const Rest& rest) {
    if (!rest.volume && !rest.surface && rest.views.empty()) add("rest", "has no shape; give a surface, a volume, or views of the object");
    if (rest.volume) {
      finite("rest.volume.nodes_m", rest.volume->nodes_m);
      indices("rest.volume.tetrahedra", rest.volume->tetrahedra, rest.volume->nodes_m.rows());
    }
    if (rest.surface) {
      if (rest.surface->triangles.rows() == 0) add("rest.surface.triangles", "is empty; give the shape of the object, or views of it");
      finite("rest.surface.vertices_m", rest.surface->vertices_m);
      indices("rest.surface.triangles", rest.surface->triangles, rest.surface->vertices_m.rows());
    }
    for (std::size_t v = 0; v < rest.views.size(); ++v) check(rest.views[v], "rest.views[" + std::to_string(v) + "].");
    spread("rest.surface_std_m", rest.surface_std_m, ranges::length_std);
  }

  void check(const Support& support, const std::string& at) {
    spread(at + "pose_std_m", support.pose_std_m, ranges::length_std);
    spread(at + "pose_std_rad", support.pose_std_rad, ranges::angle_std);
    spread(at + "spread_std_m", support.spread_std_m, ranges::length_std);
    spread(at + "compliance_m_per_n", support.compliance_m_per_n, ranges::compliance);
    spread(at + "compliance_std_m_per_n", support.compliance_std_m_per_n, ranges::compliance);
  }

  void check(const Tool& tool, const std::string& at) {
    size(at + "radius_m", tool.radius_m, ranges::tool_radius);
    spread(at + "radius_std_m", tool.radius_std_m, ranges::length_std);
    size(at + "length_m", tool.length_m, ranges::tool_length);
    spread(at + "friction_coefficient", tool.friction_coefficient, {0, ranges::friction.most, "", ranges::friction.slip});
    spread(at + "compliance_m_per_n", tool.compliance_m_per_n, ranges::compliance);
    spread(at + "compliance_std_m_per_n", tool.compliance_std_m_per_n, ranges::compliance);
  }

  void check(const Load& load, const std::string& at) {
    known(at + "tool", load.tool);
    if (!load.force_n && !load.travel_m) add(at + "force_n", "is not given, and travel_m neither; one of the two acts on the object");
    if (load.force_n && load.travel_m)
      add(at + "travel_m", "and force_n are both given; one is imposed, and what the other was is an observation (a ToolTravel or a Wrench)");
    if (load.force_n && finite(at + "force_n", *load.force_n) && load.force_n->norm() > 0) can_press(at + "force_n", load);
    if (load.travel_m) finite(at + "travel_m", *load.travel_m);
    spread(at + "force_std_n", load.force_std_n, ranges::force_std);
    spread(at + "force_relative_std", load.force_relative_std, ranges::share_std);
    spread(at + "contact_std_m", load.contact_std_m, ranges::length_std);
    finite(at + "force_rate_n_s", load.force_rate_n_s);
    finite(at + "contact_m", load.contact_m);
    if (finite(at + "direction", load.direction) && !(load.direction.norm() > 1e-9)) add(at + "direction", "has no length; it is the unit vector of the push");
  }

  /// A body that is moved starts from one place, along one line.
  void one_place(const Push& push, const Step& step, const std::vector<Tool>& tools, const std::string& at) {
    constexpr double same_m = 1e-4, of_radius = 0.05, same_rad = 0.02;
    for (std::size_t l = 0; l < step.loads.size(); ++l) {
      const Load& load = step.loads[l];
      const auto tool = std::find_if(tools.begin(), tools.end(), [&](const Tool& one) { return one.name == load.tool; });
      if (!load.travel_m || tool == tools.end() || tool->shape == ToolShape::vertices || tool->shape == ToolShape::platen) continue;
      const Load* first = nullptr;
      for (const Step& before : push.steps)
        for (const Load& one : before.loads)
          if (first == nullptr && one.travel_m && one.tool == load.tool) first = &one;
      const std::string place = at + "loads[" + std::to_string(l) + "].";
      const std::string cure = "than where push '" + push.name + "' moved '" + load.tool + "' first; a tool that is moved goes along one line a push: make another push of it";
      if ((load.contact_m - first->contact_m).norm() > std::max(same_m, of_radius * tool->radius_m)) add(place + "contact_m", "is elsewhere " + cure);
      if ((load.direction.normalized() - first->direction.normalized()).norm() > same_rad) add(place + "direction", "is another one " + cure);
    }
  }

  /// A force needs a patch that it is spread over; said here, and not once a mesh was made.
  void can_press(const std::string& where, const Load& load) {
    for (const Tool& tool : *tools_) {
      if (tool.name == load.tool && (tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc) && tool.radius_m == 0)
        add(where, "acts on '" + tool.name + "', whose radius_m is " + fmt::format("{:g}", tool.radius_m) + "; give the radius of what it presses, in metres");
      if (tool.name != load.tool || (tool.shape != ToolShape::platen && tool.shape != ToolShape::mesh)) continue;
      add(where, "acts on '" + tool.name + "', which has no patch that a force is spread over: give its motion (travel_m), and the force as what was observed (a wrench)" +
                     (tool.shape == ToolShape::mesh ? "; or describe the patch that it presses by a disc" : ""));
    }
  }

  void check(const DepthFrame& frame, const std::string& at) {
    finite(at + "time_s", frame.time_s);
    finite(at + "T_base_camera", frame.T_base_camera.matrix());
    spread(at + "pose_std_m", frame.pose_std_m, ranges::length_std);
    spread(at + "pose_std_rad", frame.pose_std_rad, ranges::angle_std);
    const Camera& camera = frame.camera;
    if (!(camera.fx_px > 0) || !(camera.fy_px > 0) || !std::isfinite(camera.fx_px + camera.fy_px + camera.cx_px + camera.cy_px))
      add(at + "camera", "fx_px and fy_px must be above 0, cx_px and cy_px finite");
    if (frame.noise.model == "constant" && !std::isnan(frame.noise.sigma_m)) sigma(at + "noise.sigma_m", frame.noise.sigma_m, ranges::length_sigma);
    spread(at + "noise.bias_std_m", frame.noise.bias_std_m, ranges::length_std);
    spread(at + "noise.shared_std_m", frame.noise.shared_std_m, ranges::length_std);
    const auto size_of = [](const auto& image) { return std::to_string(image.cols()) + " x " + std::to_string(image.rows()); };
    if (frame.depth_m.cols() != camera.width_px || frame.depth_m.rows() != camera.height_px)
      add(at + "depth_m", "is " + size_of(frame.depth_m) + " pixels, its camera has " + std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px));
    else if (frame.mask.size() > 0 && (frame.mask.cols() != frame.depth_m.cols() || frame.mask.rows() != frame.depth_m.rows()))
      add(at + "mask", "is " + size_of(frame.mask) + " pixels, the image " + size_of(frame.depth_m));
  }
  void check(const PointCloud& cloud, const std::string& at) {
    const Eigen::Index points = cloud.points_m.rows();
    if (points == 0) add(at + "points_m", "is empty; leave out a cloud that shows nothing");
    if (cloud.normals.rows() != 0 && cloud.normals.rows() != points)
      add(at + "normals", "has " + std::to_string(cloud.normals.rows()) + " rows for " + std::to_string(points) + " points");
    if (points > 0 && cloud.sigma_m.size() != 1 && cloud.sigma_m.size() != points)
      add(at + "sigma_m", "has " + std::to_string(cloud.sigma_m.size()) + " values; give one, or one a point (" + std::to_string(points) + ")");
    finite(at + "points_m", cloud.points_m);
    spread(at + "pose_std_m", cloud.pose_std_m, ranges::length_std);
    spread(at + "pose_std_rad", cloud.pose_std_rad, ranges::angle_std);
    for (const double one : cloud.sigma_m)
      if (!sigma(at + "sigma_m", one, ranges::length_sigma)) break;
  }
  void check(const Markers& markers, const std::string& at) {
    sigma(at + "sigma_m", markers.sigma_m, ranges::length_sigma);
    const auto names = static_cast<Eigen::Index>(markers.names.size()), rows = static_cast<Eigen::Index>(markers.observed_m.rows());
    if (markers.rest_m.rows() != rows || (names != 0 && names != rows))
      add(at + "observed_m", "has " + std::to_string(rows) + " rows, rest_m " + std::to_string(markers.rest_m.rows()) + " and names " + std::to_string(names) +
                                 "; each marker has one in each (names may be left out)");
  }
  void check(const ToolTravel& travel, const std::string& at) {
    if (!travel.tool.empty()) known(at + "tool", travel.tool);
    finite(at + "travel_m", travel.travel_m);
    sigma(at + "sigma_m", travel.sigma_m, ranges::length_sigma);
  }
  void check(const Wrench& wrench, const std::string& at) {
    if (!wrench.tool.empty()) known(at + "tool", wrench.tool);
    finite(at + "force_n", wrench.force_n);
    sigma(at + "force_sigma_n", wrench.force_sigma_n, ranges::force_sigma);
    if (!wrench.has_torque) return;
    finite(at + "torque_nm", wrench.torque_nm);
    sigma(at + "torque_sigma_nm", wrench.torque_sigma_nm, ranges::torque_sigma);
  }

  static std::string names_of(const std::vector<Tool>& tools) {
    std::string names;
    for (const Tool& tool : tools) names += (names.empty() ? "" : ", ") + tool.name;
    return names;
  }
  void known(const std::string& where, const std::string& name) {
    const auto is_it = [&](const Tool& tool) { return tool.name == name; };
    if (std::none_of(tools_->begin(), tools_->end(), is_it))
      add(where, fmt::format("'{}' is no tool of this recording; {}", name, tools_->empty() ? "it has none" : "they are " + names_of(*tools_)));
  }

  const std::vector<Tool>* tools_ = nullptr;
  bool any_size_ = false;
  std::vector<WrongValue> found_;
};

}  // namespace

std::vector<WrongValue> wrong_values(const Recording& recording) {
  ValueChecker checker;
  checker.check(recording);
  return std::move(checker).found();
}

std::vector<WrongValue> wrong_values(const Step& step, const std::vector<Tool>& tools, const std::string& place) {
  ValueChecker checker;
  checker.check(step, tools, place);
  return std::move(checker).found();
}

void demand_right_values(const std::vector<WrongValue>& wrong) {
  if (wrong.empty()) return;
  const std::string more = wrong.size() > 1 ? " (" + std::to_string(wrong.size() - 1) + " more are wrong)" : "";
  throw Error(wrong.front().what + more, wrong.front().where);
}

void demand_loads(const Recording& recording) {
  if (recording.rest.state == RestState::stress_free && recording.environment.gravity_m_s2.norm() > 0) return;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      for (const Load& load : step.loads)
        if ((load.force_n && load.force_n->norm() > 0) || load.travel_m.value_or(0) != 0) return;
  throw Error("no step has a force_n or travel_m other than zero, so nothing deforms the object: give what the robot pressed "
              "with, or the weight that acts on a stress-free shape (gravity_m_s2, density_kg_m3)", "pushes.steps.loads");
}

}  // namespace palpate
