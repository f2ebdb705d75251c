// SPDX-License-Identifier: Apache-2.0
#include "cli/info_stated.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "palpate/core/quantity.hpp"
#include "palpate/io/recording_names.hpp"

namespace palpate::cli {
namespace {

using nlohmann::json;

/// Least and greatest of each number that has a name.
class Ranges {
 public:
  void add(const std::string& name, double value) {
    if (value != value) return;
    const auto [at, is_new] = all_.try_emplace(name, value, value);
    if (!is_new) at->second = {std::min(at->second.first, value), std::max(at->second.second, value)};
  }
  json list() const {
    json result = json::object();
    for (const auto& [name, range] : all_) result[name] = json::array({range.first, range.second});
    return result;
  }

 private:
  std::map<std::string, std::pair<double, double>> all_;
};

struct Images {
  const DepthFrame* like = nullptr;
  std::size_t count = 0;
  std::set<std::vector<double>> places;
};

std::vector<double> pose_numbers(const Pose& pose) { return {pose.matrix().data(), pose.matrix().data() + 16}; }

json cameras_of(const Recording& recording) {
  std::vector<Images> all;
  const auto look = [&](const DepthFrame& frame) {
    auto at = std::find_if(all.begin(), all.end(), [&](const Images& one) {
      return one.like->camera == frame.camera && one.like->noise == frame.noise && one.like->pose_std_m == frame.pose_std_m &&
             one.like->pose_std_rad == frame.pose_std_rad;
    });
    if (at == all.end()) at = all.insert(all.end(), {&frame, 0, {}});
    ++at->count;
    at->places.insert(pose_numbers(frame.T_base_camera));
  };
  for (const DepthFrame& frame : recording.rest.views) look(frame);
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one)) look(*frame);
  json result = json::array();
  for (const Images& one : all) {
    const DepthNoise& noise = one.like->noise;
    const bool has_sigma = noise.sigma_m == noise.sigma_m;
    result.push_back({{"images", one.count},
                      {"places", one.places.size()},
                      {"width_px", one.like->camera.width_px},
                      {"height_px", one.like->camera.height_px},
                      {"noise_model", noise.model},
                      {"noise_sigma_m", has_sigma ? json(noise.sigma_m) : json(nullptr)},
                      {"bias_std_m", noise.bias_std_m},
                      {"pose_std_m", one.like->pose_std_m},
                      {"pose_std_rad", one.like->pose_std_rad}});
  }
  return result;
}

/// What each observation and load states, and the names of the markers.
class Stated {
 public:
  explicit Stated(const Recording& recording) {
    ranges_.add("force_scale_std", recording.force_scale_std);
    ranges_.add("force_cross_talk_std", recording.force_cross_talk_std);
    ranges_.add("time_offset_std_s", recording.time_offset_std_s);
    ranges_.add("surface_std_m", recording.rest.surface_std_m);
    for (const Push& push : recording.pushes)
      for (const Step& step : push.steps) {
        for (const Load& load : step.loads) add(push, load);
        for (const Observation& one : step.observations) std::visit([&](const auto& what) { add(push, what); }, one);
      }
  }

  json ranges() const { return ranges_.list(); }
  json clouds() const { return clouds_; }
  json markers() const { return markers_; }

 private:
  void add(const Push& push, const Load& load) {
    if (load.force_n) {
      ranges_.add("force_std_n", load.force_std_n);
      if (load.force_relative_std > 0) ranges_.add("force_relative_std", load.force_relative_std);
      ranges_.add("force_tare_std_n", push.force_tare_std_n);
    }
    if (load.contact_m.norm() > 0) ranges_.add("contact_std_m", load.contact_std_m);
  }

  void add(const Push&, const DepthFrame&) {}

  void add(const Push&, const PointCloud& cloud) {
    ++clouds_;
    if (cloud.sigma_m.size() > 0)
      for (const double sigma_m : {cloud.sigma_m.minCoeff(), cloud.sigma_m.maxCoeff()}) ranges_.add("cloud_sigma_m", sigma_m);
    ranges_.add("cloud_pose_std_m", cloud.pose_std_m);
    ranges_.add("cloud_pose_std_rad", cloud.pose_std_rad);
  }

  void add(const Push&, const Markers& markers) {
    for (const std::string& name : markers.names)
      if (std::find(markers_.begin(), markers_.end(), name) == markers_.end()) markers_.push_back(name);
    ranges_.add("marker_sigma_m", markers.sigma_m);
    ranges_.add("marker_rest_std_m", markers.rest_std_m);
  }

  void add(const Push& push, const ToolTravel& travel) {
    ranges_.add("travel_sigma_m", travel.sigma_m);
    ranges_.add("travel_offset_std_m", push.travel_offset_std_m);
  }

  void add(const Push& push, const Wrench& wrench) {
    ranges_.add("observed_force_sigma_n", wrench.force_sigma_n);
    ranges_.add("force_tare_std_n", push.force_tare_std_n);
    if (!wrench.has_torque) return;
    ranges_.add("torque_sigma_nm", wrench.torque_sigma_nm);
    ranges_.add("torque_tare_std_nm", push.torque_tare_std_nm);
    ranges_.add("tip_std_m", push.tip_std_m);
  }

  Ranges ranges_;
  std::size_t clouds_ = 0;
  std::vector<std::string> markers_;
};

/// As `quantity` writes it, shares in per cent, 0 as what it means.
std::string in_words(double value, const std::string& unit) {
  if (value == 0) return "exact";
  if (unit == "share") return fmt::format("{:.3g} %", 100 * value);
  if (unit == "rad") return fmt::format("{:.2g} degrees", value * 180 / EIGEN_PI);
  return quantity(value, unit);
}

std::string in_words(const json& range, const std::string& unit) {
  const std::string least = in_words(range[0].get<double>(), unit), most = in_words(range[1].get<double>(), unit);
  return least == most ? least : least + " to " + most;
}

std::string pose_in_words(const json& of) {
  const double turn_rad = of["pose_std_rad"], away_m = of["pose_std_m"];
  if (away_m == 0 && turn_rad == 0) return "pose exact";
  return fmt::format("pose {} and {}", in_words(away_m, "m"), in_words(turn_rad, "rad"));
}

/// "label      what a, what b", of what the recording has; nothing where it has none.
void tell_line(Session& session, const char* label, const json& stated, const std::vector<std::tuple<const char*, const char*, const char*>>& parts) {
  std::string line;
  for (const auto& [key, what, unit] : parts)
    if (stated.contains(key)) line += fmt::format("{}{} {}", line.empty() ? "" : ", ", what, in_words(stated[key], unit));
  if (!line.empty()) session.say(fmt::format("{:<11}{}", label, line));
}

}  // namespace

json stated_of(const Recording& recording) {
  const Stated stated(recording);
  json result = {{"cameras", cameras_of(recording)}, {"clouds", stated.clouds()}, {"markers", stated.markers()}, {"stated", stated.ranges()}};
  result["regions"] = json::array();
  for (const Region& region : recording.regions)
    result["regions"].push_back({{"name", region.name}, {"kind", io::name_of(io::region_names, region.select)}});
  return result;
}

void tell_stated(Session& session, const json& all) {
  for (const json& camera : all["cameras"]) {
    std::string noise = camera["noise_model"];
    if (!camera["noise_sigma_m"].is_null()) noise += " " + in_words(camera["noise_sigma_m"].get<double>(), "m");
    session.say(fmt::format("camera     {} x {} pixels, {} image{} from {} place{}, noise {}, {}", camera["width_px"].get<int>(),
                            camera["height_px"].get<int>(), camera["images"].get<std::size_t>(), camera["images"] == 1 ? "" : "s",
                            camera["places"].get<std::size_t>(), camera["places"] == 1 ? "" : "s", noise, pose_in_words(camera)));
  }
  if (!all["regions"].empty()) {
    std::vector<std::string> names;
    for (const json& region : all["regions"]) names.push_back(fmt::format("{} ({})", region["name"].get<std::string>(), region["kind"].get<std::string>()));
    session.say(fmt::format("regions    {}", fmt::join(names, ", ")));
  }
  const json& stated = all["stated"];
  if (!all["markers"].empty())
    tell_line(session, "markers", stated, {{"marker_sigma_m", "seen to", "m"}, {"marker_rest_std_m", "at rest", "m"}});
  // What is stated of errors, one line a sensor: what was forgotten stands there as exact.
  tell_line(session, "known to", stated,
            {{"force_std_n", "force", "N"},
             {"force_relative_std", "of the force", "share"},
             {"observed_force_sigma_n", "observed force", "N"},
             {"force_tare_std_n", "its zero", "N"},
             {"force_scale_std", "its scale", "share"},
             {"force_cross_talk_std", "its cross-talk", "share"},
             {"torque_sigma_nm", "torque", "N m"}});
  tell_line(session, "", stated,
            {{"travel_sigma_m", "travel", "m"}, {"travel_offset_std_m", "its zero", "m"}, {"contact_std_m", "contact point", "m"}, {"tip_std_m", "tip", "m"}});
  tell_line(session, "", stated,
            {{"surface_std_m", "rest surface", "m"},
             {"cloud_sigma_m", "clouds' points", "m"},
             {"cloud_pose_std_m", "clouds' pose", "m"},
             {"time_offset_std_s", "clocks", "s"}});
}

}  // namespace palpate::cli
