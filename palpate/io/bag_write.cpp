// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_write.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "palpate/core/error.hpp"
#include "palpate/core/recording_values.hpp"
#include "palpate/io/bag_folder.hpp"
#include "palpate/io/bag_frames.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/recording_writer.hpp"
#include "palpate/io/ros_messages.hpp"
#include "palpate/io/urdf.hpp"
#include "palpate/io/yaml_text.hpp"

namespace palpate::io {
namespace {

namespace fs = std::filesystem;
constexpr std::int64_t second_ns = 1'000'000'000;
constexpr std::int64_t sample_gap_ns = second_ns / 50;  // between the two samples of a force

/// What a mapping says alike of all its images.
struct BagCamera {
  DepthFrame like;
  std::string topics, frame;
  bool has_mask = false;
};

bool same_device(const DepthFrame& a, const DepthFrame& b) { return a.camera == b.camera && a.noise == b.noise; }
bool same_camera(const DepthFrame& a, const DepthFrame& b) {
  return same_device(a, b) && a.pose_std_m == b.pose_std_m && a.pose_std_rad == b.pose_std_rad;
}

std::vector<const DepthFrame*> images_of(const Step& step) {
  std::vector<const DepthFrame*> images;
  for (const Observation& one : step.observations)
    if (const auto* image = std::get_if<DepthFrame>(&one)) images.push_back(image);
  return images;
}

/// Joints of some steps only would leave the others' links nowhere.
std::vector<std::string> joints_of_all_steps(const Recording& recording) {
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      if (step.joints_rad.size() != recording.joint_names.size()) return {};
  return recording.joint_names;
}

/// How well its pose is known may change from image to image, as of a camera on the hand: it is one device all the same, unless
/// two of a kind look on at once.
bool looks_alone(const Recording& recording) {
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps) {
      const std::vector<const DepthFrame*> images = images_of(step);
      for (std::size_t a = 0; a < images.size(); ++a)
        for (std::size_t b = 0; b < a; ++b)
          if (same_device(*images[a], *images[b])) return false;
    }
  return true;
}

std::string place_of(const Step& step) { return "write_bag: step at " + std::to_string(step.time_s) + " s"; }

[[noreturn]] void refuse(const std::string& what, const Step& step) { throw Error(what + "; write a folder instead", place_of(step)); }

class BagWriter {
 public:
  explicit BagWriter(const Recording& recording)
      : recording_(recording), frames_(recording.robot, joints_of_all_steps(recording)), looks_alone_(looks_alone(recording)) {
    survey_cameras();
  }

  void write(const fs::path& folder) {
    if (recording_.robot)
      put("/robot_description", "std_msgs/msg/String", time_ns_, encode(urdf_for_viewers(*recording_.robot, folder)));
    if (!is_any_loaded()) put_free_air();
    for (const Push& push : recording_.pushes) add_push(push);
    const std::string head = "format: palpate-mapping/1\n" + object_text(recording_, folder);
    write_file(folder / "mapping.yaml", head + mapping_text());
    frames_.put_rest(bag_);
    bag_.write(folder);
  }

 private:
  // A mapping names the topics of force and tip, and those must be there: pushes that never pressed have one reading before them.
  void put_free_air() {
    Pose tip = Pose::Identity();
    std::vector<double> joints_rad;
    for (const Push& push : recording_.pushes)
      for (const Step& step : push.steps)
        if (step.T_base_tip) tip = *step.T_base_tip, joints_rad = step.joints_rad;
    put("/wrench", "geometry_msgs/msg/WrenchStamped", time_ns_, encode(RosWrench{header(frames_.base()), Vec3::Zero(), Vec3::Zero()}));
    frames_.robot_at(time_ns_, joints_rad, tip, bag_);
  }
  bool is_any_loaded() const {
    for (const Push& push : recording_.pushes)
      if (std::any_of(push.steps.begin(), push.steps.end(), [](const Step& step) { return !step.loads.empty(); })) return true;
    return false;
  }
  void put(const std::string& topic, const std::string& type, std::int64_t time_ns, const std::string& data) {
    bag_.put(topic, type, time_ns, data);
  }

  void add_push(const Push& push) {
    if (push.steps.empty()) return;
    const std::int64_t start_ns = time_ns_ + second_ns;
    const double first_s = push.steps.front().time_s;
    const Load* first = nullptr;
    for (const Step& step : push.steps)
      if (first == nullptr && !step.loads.empty()) first = &step.loads.front();
    std::vector<double> travel_sigma_m;
    std::size_t loaded = 0;
    const Step* before = nullptr;
    for (const Step& step : push.steps) {
      if (before != nullptr && !(step.time_s > before->time_s))
        throw Error("does not follow the step before in time; give each step of a push a later one", place_of(step) + ": time_s");
      before = &step;
      time_ns_ = start_ns + static_cast<std::int64_t>(std::llround((step.time_s - first_s) * 1e9));
      std::string mark = push.name;
      if (mark.find(';') != std::string::npos) refuse("the name of push '" + push.name + "' holds a semicolon", step);
      mark += step.loads.empty() ? "; unloaded" : "; loaded";
      if (step.unloading) mark += "; unloading";
      if (step.slipped) mark += "; slipped";
      put("/palpate/marks", "std_msgs/msg/String", time_ns_, encode(mark));
      if (!step.joints_rad.empty())
        put("/joint_states", "sensor_msgs/msg/JointState", time_ns_,
            encode(RosJointState{header(""), recording_.joint_names, step.joints_rad}));
      std::optional<Pose> T_base_tip = step.T_base_tip;
      for (const Observation& observation : step.observations)
        if (const auto* travel = std::get_if<ToolTravel>(&observation)) {
          if (first == nullptr || step.loads.empty()) refuse("a travel without a load has no direction", step);
          travel_sigma_m.push_back(travel->sigma_m);
          T_base_tip = tip_at(*first, travel->travel_m, step.T_base_tip);
        }
      frames_.robot_at(time_ns_, step.joints_rad, T_base_tip, bag_);
      std::vector<std::size_t> seen;
      for (const Observation& observation : step.observations) {
        if (const auto* frame = std::get_if<DepthFrame>(&observation)) {
          const std::size_t camera = put_image(*frame);
          if (std::find(seen.begin(), seen.end(), camera) != seen.end()) refuse("a camera has two images in one step", step);
          seen.push_back(camera);
        } else if (const auto* cloud = std::get_if<PointCloud>(&observation)) {
          put_cloud(*cloud, step);
        } else if (std::holds_alternative<ToolTravel>(observation)) {
          continue;  // the tip's place says it
        } else if (const auto* wrench = std::get_if<Wrench>(&observation); wrench && wrench->has_torque && !step.loads.empty()) {
          continue;  // the load's own torque, of which a reader of steps makes nothing
        } else {
          refuse("markers and wrench observations have no topic", step);
        }
      }
      if (!step.loads.empty()) {
        put_force(step, *first, T_base_tip);
        ++loaded;
      }
    }
    if (!travel_sigma_m.empty() && travel_sigma_m.size() != loaded)
      refuse("some loaded steps have a travel and others have none", push.steps.front());
    YamlLine line;
    line.word("name", push.name);
    if (!push.site.empty()) line.word("site", push.site);
    if (first != nullptr) {
      line.word("tool", first->tool).vector("contact_m", first->contact_m).vector("direction", unit_direction(first->direction));
      line.number_unless(0, "force_relative_std", first->force_relative_std)
          .number_unless(0, "contact_std_m", first->contact_std_m);
    }
    line.number_unless(0, "force_tare_std_n", push.force_tare_std_n)
        .number_unless(0, "travel_offset_std_m", push.travel_offset_std_m);
    if (!travel_sigma_m.empty()) line.put("travel_sigma_m", yaml_list(travel_sigma_m.data(), travel_sigma_m.size()));
    pushes_ += "    - " + line.str() + "\n";
  }

  RosHeader header(const std::string& frame) const { return {time_ns_, frame}; }

  void put_force(const Step& step, const Load& first, const std::optional<Pose>& T_base_tip) {
    const Load& load = step.loads.front();
    if (step.loads.size() != 1) refuse("has several loads", step);
    if (!load.force_n) refuse("the travel is imposed, not the force", step);
    if (!load.force_rate_n_s.isZero(0)) refuse("the force was changing (force_rate_n_s); a bag of steps holds settled ones", step);
    if (load.tool != first.tool || load.contact_m != first.contact_m || load.direction != first.direction ||
        load.force_relative_std != first.force_relative_std || load.contact_std_m != first.contact_std_m)
      refuse("tool, contact, direction or priors of the load differ from those of the push's first load", step);
    const Vec3 aside = Vec3::Constant(load.force_std_n);
    const Vec3 acts_m = T_base_tip ? Vec3(T_base_tip->translation()) : load.contact_m;
    for (const double side : {1.0, -1.0}) {
      if (load.force_std_n == 0 && side > 0) continue;
      const std::int64_t at = time_ns_ - (side > 0 ? sample_gap_ns : 0);
      const Vec3 force_n = *load.force_n + side * aside;
      put("/wrench", "geometry_msgs/msg/WrenchStamped", at, encode(RosWrench{{at, frames_.base()}, force_n, acts_m.cross(force_n)}));
    }
  }

  /// The tip that has gone that far: the recorded one where it says the same.
  static Pose tip_at(const Load& load, double travel_m, const std::optional<Pose>& recorded) {
    const Vec3 direction = unit_direction(load.direction);
    Pose pose = Pose::Identity();
    if (recorded)
      pose = *recorded;
    else
      pose.linear() = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), direction).toRotationMatrix();
    if (!recorded) pose.translation() = load.contact_m;
    const double short_m = travel_m - direction.dot(pose.translation() - load.contact_m);
    if (std::abs(short_m) > 1e-12) pose.translation() += short_m * direction;
    return pose;
  }

  void survey_cameras() {
    std::map<std::string, std::optional<Pose>> stands;  // by frame; empty: it moves
    for (const Push& push : recording_.pushes)
      for (const Step& step : push.steps)
        for (const DepthFrame* image : images_of(step)) {
          demand_depth_sigma(image->noise, place_of(step));
          const auto [place, is_new] = stands.emplace(cameras_[camera_of(*image)].frame, image->T_base_camera);
          if (place->second && place->second->matrix() != image->T_base_camera.matrix()) place->second.reset();
        }
    for (const auto& [frame, pose] : stands)
      if (pose)
        frames_.camera_stands(frame, *pose);
      else
        frames_.camera_moves(frame);
  }

  std::size_t camera_of(const DepthFrame& frame) {
    std::size_t camera = 0;
    while (camera < cameras_.size() && !same_camera(cameras_[camera].like, frame)) ++camera;
    if (camera == cameras_.size()) {
      std::size_t device = 0;
      while (device < camera && !(looks_alone_ && same_device(cameras_[device].like, frame))) ++device;
      cameras_.push_back({frame, camera == 0 ? "/camera" : fmt::format("/camera_{}", camera + 1), frames_.camera(device), false});
      cameras_.back().like.depth_m.resize(0, 0);
      cameras_.back().like.mask.resize(0, 0);
    }
    return camera;
  }

  std::size_t put_image(const DepthFrame& frame) {
    const std::size_t camera = camera_of(frame);
    BagCamera& known = cameras_[camera];
    frames_.camera_at(time_ns_, known.frame, frame.T_base_camera, bag_);
    put(known.topics + "/depth/camera_info", "sensor_msgs/msg/CameraInfo", time_ns_,
        encode(RosCameraInfo{header(known.frame), frame.camera}));
    put(known.topics + "/depth/image", "sensor_msgs/msg/Image", time_ns_, encode(RosImage{header(known.frame), frame.depth_m}));
    if (frame.mask.size() > 0) {
      known.has_mask = true;
      put(known.topics + "/mask", "sensor_msgs/msg/Image", time_ns_, encode(header(known.frame), frame.mask));
    }
    return camera;
  }

  void put_cloud(const PointCloud& cloud, const Step& step) {
    const bool first = !bag_.has("/points");
    if (cloud.sigma_m.size() != 1) refuse("the points of a cloud differ in their standard deviation", step);
    if (first) cloud_ = cloud;
    if (cloud.sigma_m[0] != cloud_.sigma_m[0] || cloud.pose_std_m != cloud_.pose_std_m ||
        cloud.pose_std_rad != cloud_.pose_std_rad)
      refuse("clouds differ in their standard deviations", step);
    if (cloud.camera != cloud_.camera) refuse("clouds are of several cameras", step);
    put("/points", "sensor_msgs/msg/PointCloud2", time_ns_, encode(RosPointCloud{header(frames_.base()), cloud}));
  }

  std::string mapping_text() const {
    std::string text = "topics:\n  wrench: /wrench\n  marks: /palpate/marks\n";
    if (bag_.has("/joint_states")) text += "  joints: /joint_states\n";
    if (!cameras_.empty()) text += "  depth:\n";
    for (const BagCamera& camera : cameras_) {
      YamlLine line;
      line.put("image", camera.topics + "/depth/image").put("info", camera.topics + "/depth/camera_info");
      if (camera.has_mask) line.put("mask", camera.topics + "/mask");
      line.put("noise", depth_noise_yaml(camera.like.noise));
      line.number_unless(0, "pose_std_m", camera.like.pose_std_m).number_unless(0, "pose_std_rad", camera.like.pose_std_rad);
      text += "    - " + line.str() + "\n";
    }
    if (bag_.has("/points")) {
      YamlLine line;
      line.put("topic", "/points").number("sigma_m", cloud_.sigma_m[0]);
      line.number_unless(0, "pose_std_m", cloud_.pose_std_m).number_unless(0, "pose_std_rad", cloud_.pose_std_rad);
      if (recording_.robot) line.put("mask_robot", "false");  // a recording's clouds are without it
      text += "  clouds:\n    - " + line.str() + "\n";
    }
    text += frames_.mapping_text() + "wrench: {reports: force_on_object, tare: none}\n";
    // Every step has its own samples and image, at its own time.
    text += "steps:\n  by: marks\n  window_s: 0.03\n  image_gap_s: 0.01\n";
    if (recording_.tools.size() > 1) text += "  tool: " + yaml_word(recording_.tools.front().name) + "\n";
    return text + "  pushes:\n" + pushes_;
  }

  const Recording& recording_;
  BagFolder bag_;
  BagFrames frames_;
  bool looks_alone_;
  std::vector<BagCamera> cameras_;
  PointCloud cloud_;
  std::string pushes_;
  std::int64_t time_ns_ = second_ns;
};

}  // namespace

void write_bag(const Recording& recording, const fs::path& given) {
  std::error_code code;
  fs::path folder = given.lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();
  if (fs::exists(folder, code) && !(fs::is_directory(folder, code) && fs::is_empty(folder, code)))
    throw Error("is there already; choose another folder or remove it", folder.string());
  fs::create_directories(folder, code);
  if (!fs::is_directory(folder, code)) throw Error("cannot be made; check the name and the permissions", folder.string());
  BagWriter(recording).write(folder);
}

}  // namespace palpate::io
