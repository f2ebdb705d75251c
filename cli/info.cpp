// SPDX-License-Identifier: Apache-2.0
// `palpate info RECORDING`: what is in a recording, in units, and what is wrong with it.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>

#include "cli/bag_recording.hpp"
#include "cli/info_bag.hpp"
#include "cli/info_stated.hpp"
#include "cli/material_names.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/quantity.hpp"
#include "palpate/io/message_source.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/recording_names.hpp"
#include "palpate/recording_oddities.hpp"
#include "palpate/sensing/static_scatter.hpp"

namespace palpate::cli {
namespace {

using nlohmann::json;

struct Range {
  double least = std::numeric_limits<double>::infinity(), most = -std::numeric_limits<double>::infinity();
  void add(double value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
  bool empty() const { return least > most; }
  json list() const { return empty() ? json(nullptr) : json::array({least, most}); }
};

json vector(const Vec3& value) { return json::array({value.x(), value.y(), value.z()}); }

json object_of(const Recording& recording) {
  const Rest& rest = recording.rest;
  json object;
  object["rest_state"] = io::name_of(io::rest_state_names, rest.state);
  object["kind"] = rest.volume ? "volume_mesh" : rest.surface ? "surface_mesh" : "views";
  object["views"] = rest.views.size();
  if (!rest.volume && !rest.surface) return object;
  const Points& nodes = rest.volume ? rest.volume->nodes_m : rest.surface->vertices_m;
  object["nodes"] = nodes.rows();
  object["size_m"] = vector(Vec3(nodes.colwise().maxCoeff() - nodes.colwise().minCoeff()));
  if (rest.surface) object["triangles"] = rest.surface->triangles.rows();
  if (rest.observed_triangles) object["observed_triangles"] = rest.observed_triangles->rows();
  if (!rest.volume) return object;
  object["tetrahedra"] = rest.volume->tetrahedra.rows();
  object["element"] = rest.volume->tetrahedra.cols() == 10 ? "tet10" : "tet4";
  double volume = 0;
  for (Eigen::Index i = 0; i < rest.volume->tetrahedra.rows(); ++i) {
    const auto corner = [&](Eigen::Index k) { return Vec3(nodes.row(rest.volume->tetrahedra(i, k))); };
    volume += (corner(1) - corner(0)).cross(corner(2) - corner(0)).dot(corner(3) - corner(0)) / 6;
  }
  object["volume_m3"] = volume;
  return object;
}

json push_of(const Push& push) {
  std::map<std::string, std::size_t> seen = {{"depth", 0}, {"cloud", 0}, {"markers", 0}, {"travel", 0}, {"wrench", 0}};
  Range force, travel, observed_force, observed_travel, time;
  std::size_t points = 0, unloaded = 0, unloading = 0;
  for (const Step& step : push.steps) {
    time.add(step.time_s);
    bool acts = false;
    for (const Load& load : step.loads) {
      if (load.force_n) force.add(load.force_n->norm());
      if (load.travel_m) travel.add(*load.travel_m);
      acts |= (load.force_n && load.force_n->norm() > 0) || (load.travel_m && *load.travel_m != 0);
    }
    unloaded += acts ? 0 : 1;
    unloading += step.unloading ? 1 : 0;
    for (const Observation& observation : step.observations) {
      if (const auto* cloud = std::get_if<PointCloud>(&observation)) {
        ++seen["cloud"];
        points += static_cast<std::size_t>(cloud->points_m.rows());
      } else if (const auto* frame = std::get_if<DepthFrame>(&observation)) {
        ++seen["depth"];
        points += static_cast<std::size_t>((frame->depth_m.array() > 0).count());
      } else if (const auto* one = std::get_if<ToolTravel>(&observation)) {
        ++seen["travel"];
        observed_travel.add(one->travel_m);
      } else if (const auto* wrench = std::get_if<Wrench>(&observation)) {
        ++seen["wrench"];
        observed_force.add(wrench->force_n.norm());
      } else {
        ++seen["markers"];
      }
    }
  }
  return {{"name", push.name},
          {"site", push.site},
          {"steps", push.steps.size()},
          {"unloaded_steps", unloaded},
          {"unloading_steps", unloading},
          {"time_s", time.list()},
          {"observations", seen},
          {"points", points},
          {"force_n", force.list()},
          {"travel_m", travel.list()},
          {"observed_force_n", observed_force.list()},
          {"observed_travel_m", observed_travel.list()}};
}

json described(const Recording& recording, const std::vector<io::Problem>& problems) {
  json result;
  result["format"] = "palpate-info/1";
  result["name"] = recording.name;
  result["description"] = recording.description;
  result["object"] = object_of(recording);
  result["density_kg_m3"] = recording.density_kg_m3 > 0 ? json(recording.density_kg_m3) : json(nullptr);
  result["density_std_kg_m3"] = recording.density_std_kg_m3;
  result["gravity_m_s2"] = vector(recording.environment.gravity_m_s2);
  result["free"] = recording.free;
  result["supports"] = json::array();
  for (const Support& support : recording.supports) {
    json one = {{"name", support.name},
                {"kind", io::name_of(io::support_names, support.kind)},
                {"contact", io::name_of(io::contact_names, support.contact)},
                {"pose_std_m", support.pose_std_m},
                {"pose_std_rad", support.pose_std_rad}};
    if (support.select == NodeSelection::vertices) one["vertices"] = support.vertices.size();
    result["supports"].push_back(one);
  }
  result["tools"] = json::array();
  for (const Tool& tool : recording.tools) {
    json one = {{"name", tool.name},
                {"shape", io::name_of(io::tool_names, tool.shape)},
                {"contact", io::name_of(io::contact_names, tool.contact)}};
    if (tool.radius_m > 0) one["radius_m"] = tool.radius_m;
    if (tool.shape == ToolShape::vertices) one["vertices"] = tool.vertices.size();
    result["tools"].push_back(one);
  }
  result["robot"] = recording.robot ? json(recording.robot->name) : json(nullptr);
  const ModelDefaults& model = recording.model;
  result["model"] = {{"mesh", model.mesh},
                     {"element", model.element},
                     {"refine", model.refine},
                     {"material", model.material},
                     {"poisson_range", json::array({model.poisson_lower, model.poisson_upper})},
                     {"poisson_by_region", model.poisson_by_region},
                     {"poisson_fixed", model.poisson_fixed ? json(*model.poisson_fixed) : json(nullptr)}};
  result["force_scale_std"] = recording.force_scale_std;
  result["force_cross_talk_std"] = recording.force_cross_talk_std;
  result["time_offset_std_s"] = recording.time_offset_std_s;
  result.update(stated_of(recording));
  result["pushes"] = json::array();
  for (const Push& push : recording.pushes) result["pushes"].push_back(push_of(push));
  result["files"] = recording.input_hashes.size();
  result["problems"] = json::array();
  for (const io::Problem& problem : problems)
    result["problems"].push_back({{"where", problem.where}, {"message", problem.what}});
  result["warnings"] = recording.warnings;
  return result;
}

std::string range_text(const json& range, double factor, const char* unit) {
  const double least = range[0].get<double>() * factor, most = range[1].get<double>() * factor;
  return least == most ? fmt::format("{:.4g} {}", least, unit) : fmt::format("{:.4g} to {:.4g} {}", least, most, unit);
}

void tell_push(Session& session, const json& push) {
  std::string line = fmt::format("  {}: {} step{}", push["name"].get<std::string>(), push["steps"].get<std::size_t>(),
                                 push["steps"] == 1 ? "" : "s");
  if (!push["site"].get<std::string>().empty()) line += " at " + push["site"].get<std::string>();
  if (push["unloaded_steps"] > 0) line += fmt::format(", {} without a load", push["unloaded_steps"].get<std::size_t>());
  if (push["unloading_steps"] > 0) line += fmt::format(", {} while unloading", push["unloading_steps"].get<std::size_t>());
  if (!push["force_n"].is_null()) line += ", force " + range_text(push["force_n"], 1, "N");
  if (!push["travel_m"].is_null()) line += ", travel " + range_text(push["travel_m"], 1e3, "mm");
  std::string seen;
  for (const auto& [kind, count] : push["observations"].items()) {
    if (count > 0) seen += fmt::format("{}{} {}", seen.empty() ? "" : ", ", count.get<std::size_t>(), kind);
  }
  line += seen.empty() ? "; nothing observed" : "; observed: " + seen;
  if (push["points"] > 0) line += fmt::format(" ({} points)", push["points"].get<std::size_t>());
  if (!push["observed_force_n"].is_null()) line += ", force " + range_text(push["observed_force_n"], 1, "N");
  if (!push["observed_travel_m"].is_null()) line += ", travel " + range_text(push["observed_travel_m"], 1e3, "mm");
  session.say(line);
}

void tell(Session& session, const Recording& recording, const json& all) {
  session.say(fmt::format("recording  {}", recording.name));
  if (!recording.description.empty()) session.say("           " + recording.description);
  const json& object = all["object"];
  std::string line = "object     ";
  if (object.contains("tetrahedra")) {
    line += fmt::format("{} tetrahedra ({}), {} nodes", object["tetrahedra"].get<std::size_t>(),
                        object["element"].get<std::string>(), object["nodes"].get<std::size_t>());
  } else if (object.contains("triangles")) {
    line += fmt::format("surface of {} triangles, {} vertices", object["triangles"].get<std::size_t>(),
                        object["nodes"].get<std::size_t>());
  } else {
    line += fmt::format("{} views", object["views"].get<std::size_t>());
  }
  if (object.contains("size_m")) {
    const json& size = object["size_m"];
    line += fmt::format(", {:.4g} x {:.4g} x {:.4g} mm", 1e3 * size[0].get<double>(), 1e3 * size[1].get<double>(),
                        1e3 * size[2].get<double>());
  }
  if (object.contains("volume_m3")) line += fmt::format(", {:.4g} cm3", 1e6 * object["volume_m3"].get<double>());
  std::string state = object["rest_state"];
  std::replace(state.begin(), state.end(), '_', ' ');
  session.say(line + ", " + state);
  if (recording.density_kg_m3 > 0) {
    session.say(fmt::format("density    {:.4g} +- {:.2g} kg/m3", recording.density_kg_m3, recording.density_std_kg_m3));
  }
  const Vec3& g = recording.environment.gravity_m_s2;
  session.say(g.norm() > 0 ? fmt::format("gravity    [{:.3g}, {:.3g}, {:.3g}] m/s2", g.x(), g.y(), g.z())
                           : "gravity    none");
  if (recording.free) session.say("held by    nothing (free)");
  for (const json& support : all["supports"]) {
    std::string how = fmt::format("held by    {} ({}, {})", support["name"].get<std::string>(),
                                  support["kind"].get<std::string>(), support["contact"].get<std::string>());
    if (support.contains("vertices")) how += fmt::format(", {} vertices", support["vertices"].get<std::size_t>());
    if (support["kind"] == "clamp") {
      how += fmt::format(", pose known to {:.3g} mm and {:.3g} degrees", 1e3 * support["pose_std_m"].get<double>(),
                         support["pose_std_rad"].get<double>() * 180 / M_PI);
    }
    session.say(how);
  }
  for (const json& tool : all["tools"]) {
    std::string what = fmt::format("tool       {} ({}, {})", tool["name"].get<std::string>(),
                                   tool["shape"].get<std::string>(), tool["contact"].get<std::string>());
    if (tool.contains("radius_m")) what += fmt::format(", radius {:.3g} mm", 1e3 * tool["radius_m"].get<double>());
    if (tool.contains("vertices")) what += fmt::format(", {} vertices", tool["vertices"].get<std::size_t>());
    session.say(what);
  }
  if (recording.robot)
    session.say(fmt::format("robot      {}, {} joints recorded", recording.robot->name, recording.joint_names.size()));
  const ModelDefaults& model = recording.model;
  session.say(fmt::format("model      {}, mesh {}, element {}, refinement {}, Poisson ratio {}{}", model.material, model.mesh,
                          model.element, model.refine,
                          model.poisson_fixed
                              ? fmt::format("{:.4g}", *model.poisson_fixed)
                              : fmt::format("in [{:.4g}, {:.4g}]", model.poisson_lower, model.poisson_upper),
                          model.poisson_by_region && !model.poisson_fixed ? ", each region its own" : ""));
  tell_stated(session, all);
  session.say(fmt::format("pushes     {}", recording.pushes.size()));
  for (const json& push : all["pushes"]) tell_push(session, push);
}

/// What a wrong sigma does to the intervals is seen before anything is fitted.
void tell_scatter(Session& session, const Recording& recording, json& all) {
  all["static_scatter"] = json::array();
  for (const sensing::StaticScatter& one : sensing::static_scatter(recording)) {
    all["static_scatter"].push_back({{"what", one.what},
                                     {"unit", one.unit},
                                     {"repeats", one.repeats},
                                     {"differences", one.differences},
                                     {"measured", one.measured},
                                     {"stated", one.stated},
                                     {"doubtful", one.doubtful()}});
    const std::string measured = quantity(one.measured, one.unit), stated = quantity(one.stated, one.unit);
    session.say(fmt::format("noise      {}: {} rms, measured from {} unloaded {}; stated {}", one.what, measured, one.repeats,
                            one.what == "depth" ? "frames" : "readings", stated));
    if (one.doubtful())
      session.warn(fmt::format("{}: unloaded repeats scatter by {}, {:.2g} times the stated {}: intervals would be {}; state what the "
                               "sensor does (unless object, arm or light changed between them)",
                               one.what, measured, one.ratio, stated, one.ratio > 1 ? "too narrow" : "too wide"));
  }
}

struct Arguments {
  std::filesystem::path recording, mapping;
};

int look(Session& session, const Arguments& given) {
  json all;
  if (io::is_bag(given.recording)) {
    const std::filesystem::path mapping = given.mapping.empty() ? mapping_of(given.recording) : given.mapping;
    const json bag = look_into_bag(session, given.recording, mapping);
    if (mapping.empty()) {
      session.result(bag);
      return exit_done;
    }
    all["bag"] = bag;
  }
  std::vector<acquisition::ClockOffset> clocks;
  Recording recording = load_recording_unchecked(session, given.recording, given.mapping, &clocks);
  warn_of_oddities(recording);
  std::vector<io::Problem> problems = io::check_recording(recording);
  if (const auto wrong = wrong_material(recording.model.material)) problems.push_back({"model.material", *wrong});
  all.update(described(recording, problems));
  all["clocks"] = json::array();
  for (const acquisition::ClockOffset& clock : clocks)
    all["clocks"].push_back({{"sensor", clock.sensor},
                             {"offset_s", clock.offset_s},
                             {"std_s", clock.std_s},
                             {"correlation", clock.correlation},
                             {"usable", clock.usable},
                             {"taken_off_s", acquisition::believed_offset_s(clock)},
                             {"left_std_s", acquisition::left_std_s(clock)}});
  tell(session, recording, all);
  if (problems.empty()) tell_scatter(session, recording, all);
  for (const std::string& warning : recording.warnings) session.warn(warning);
  for (const io::Problem& problem : problems) session.announce(fmt::format("wrong: {}: {}", problem.where, problem.what));
  const std::size_t left_out = all.contains("bag") ? all["bag"]["left_out"].size() : 0;
  if (problems.empty())
    session.say(left_out == 0 ? recording.warnings.empty() ? "nothing is wrong with it" : "it can be used as it is; mind the warnings"
                              : fmt::format("nothing is wrong with what the mapping names; {} left out",
                                            left_out == 1 ? "1 topic of use is" : fmt::format("{} topics of use are", left_out)));
  session.result(all);
  return problems.empty() ? exit_done : exit_input;
}

}  // namespace

Run verbs::info(CLI::App& app) {
  auto given = std::make_shared<Arguments>();
  app.add_option("recording", given->recording, "folder of the recording, or a bag: MCAP, rosbag2 (a folder or .db3), ROS 1")->required();
  app.add_option("--mapping", given->mapping, "what a bag's topics mean (default: mapping.yaml beside it)");
  return [given](Session& session) { return look(session, *given); };
}

}  // namespace palpate::cli
