// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_survey.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

#include "palpate/core/error.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io {
namespace {

std::string image_use(const Message& message, MessageEncoding encoding) {
  try {
    return decode_image(message.data, "", encoding).depth_m.size() > 0 ? "depth images" : "";
  } catch (const Error&) {
    return decode_mask(message.data, "", encoding).size() > 0 ? "grey images" : "";
  }
}

/// What a topic is good for, told by its type and, for images, by the first of them.
std::string use_of(const MessageTopic& topic, const Message* first) {
  if (topic.encoding == MessageEncoding::other) return "";
  const std::string& type = topic.type;
  if (type == "geometry_msgs/msg/WrenchStamped") return "force";
  if (type == "sensor_msgs/msg/JointState") return "joints";
  if (type == "tf2_msgs/msg/TFMessage" || type == "tf/msg/tfMessage") return "transforms";
  if (type == "sensor_msgs/msg/PointCloud2") return "clouds";
  if (type == "sensor_msgs/msg/CameraInfo") return "camera";
  try {
    if (type == "std_msgs/msg/String" && first != nullptr &&
        decode_string(first->data, "", topic.encoding).find("<robot") != std::string::npos)
      return "robot description";
    if (type == "std_msgs/msg/String") return "texts";
    if (type == "sensor_msgs/msg/Image" && first != nullptr) return image_use(*first, topic.encoding);
    if (type == "sensor_msgs/msg/CompressedImage" && first != nullptr)
      return decode_compressed_depth(first->data, "", topic.encoding).depth_m.size() > 0 ? "depth images" : "";
  } catch (const Error&) {  // colour images, other compressions
  }
  return "";
}

std::size_t common_prefix(const std::string& a, const std::string& b) {
  std::size_t n = 0;
  while (n < std::min(a.size(), b.size()) && a[n] == b[n]) ++n;
  return n;
}

const SurveyedTopic* first_of(const BagSurvey& survey, const std::string& use) {
  for (const SurveyedTopic& topic : survey.topics)
    if (topic.use == use && topic.messages > 0) return &topic;
  return nullptr;
}

/// The raw topic that image_transport packs into this one, if it is such a one.
std::string packed_of(const std::string& topic) {
  constexpr std::string_view packed = "/compressedDepth";
  return topic.ends_with(packed) ? topic.substr(0, topic.size() - packed.size()) : std::string();
}

/// The same pictures stand in the bag unpacked as well.
bool is_repeated(const BagSurvey& survey, const SurveyedTopic& depth) {
  const std::string raw = packed_of(depth.name);
  return !raw.empty() && std::any_of(survey.topics.begin(), survey.topics.end(), [&](const SurveyedTopic& one) {
    return one.name == raw && one.use == "depth images" && one.messages > 0;
  });
}

constexpr const char* fill_in = "FILL_IN";  // what the bag does not tell and its owner has to

const SurveyedTopic* camera_info_of(const BagSurvey& survey, const std::string& image) {
  const SurveyedTopic* best = nullptr;
  for (const SurveyedTopic& topic : survey.topics) {
    if (topic.use != "camera" || topic.messages == 0) continue;
    if (best == nullptr || common_prefix(topic.name, image) > common_prefix(best->name, image)) best = &topic;
  }
  return best;
}

/// Grey pictures that are named a mask, of the same camera.
const SurveyedTopic* mask_topic_of(const BagSurvey& survey, const std::string& image) {
  const SurveyedTopic* best = nullptr;
  for (const SurveyedTopic& topic : survey.topics) {
    if (topic.use != "grey images" || topic.messages == 0 || topic.name.find("mask") == std::string::npos) continue;
    const std::size_t shared = common_prefix(topic.name, image);
    if (shared > 1 && (best == nullptr || shared > common_prefix(best->name, image))) best = &topic;
  }
  return best;
}

std::string guess_frame(const std::vector<std::string>& frames, std::initializer_list<const char*> words) {
  for (const char* word : words)
    for (const std::string& frame : frames)
      if (frame.find(word) != std::string::npos) return frame;
  return fill_in;
}

std::string skeleton(const BagSurvey& survey, const std::vector<std::string>& frames,
                     const std::vector<std::string>& roots) {
  const SurveyedTopic *force = first_of(survey, "force"), *joints = first_of(survey, "joints"),
                      *robot = first_of(survey, "robot description");
  std::string text =
      "# Write your own in place of every FILL_IN, and look at every line marked check. docs/recording-format.md explains every key.\n"
      "format: palpate-mapping/1\n"
      "# The object untouched, in the base frame, beside this file; or where the bag shows it from several sides, in place of surface_mesh,\n"
      "# views_at_s: [the seconds from the bag's start at which the camera stood still]\n"
      "rest: {surface_mesh: FILL_IN.stl, state: stress_free}\n"
      "supports:                                            # how it is held\n"
      "  # check: the plane, and that the object sticks to it; what only lies there: kind: table, contact: friction, friction_coefficient: 0.5\n"
      "  - {name: table, kind: plane, point_m: [0, 0, 0], normal: [0, 0, 1], tolerance_m: 0.002}\n"
      "environment:                                         # what the camera sees beside the object and is not it\n"
      "  planes: [{point_m: [0, 0, 0], normal: [0, 0, 1]}]   # check\n"
      "tools:                                               # what touched the object; check: disc (flat end) or sphere, and its radius\n"
      "  - {name: tool, shape: disc, radius_m: 0.01, contact: bonded}\n"
      "force_scale_std: 0.01                                # check: what the sensor's scale is known to\n"
      "topics:\n";
  text += "  wrench: " + (force ? force->name : std::string(fill_in)) + "\n";
  if (joints) text += "  joints: " + joints->name + "\n";
  if (robot) text += "  robot_description: " + robot->name + "\n";
  std::string depth, clouds;
  for (const SurveyedTopic& topic : survey.topics) {
    if (topic.messages == 0) continue;
    if (topic.use == "depth images" && !is_repeated(survey, topic)) {
      const SurveyedTopic *info = camera_info_of(survey, topic.name), *mask = mask_topic_of(survey, topic.name);
      depth += "    - {image: " + topic.name + ", info: " + (info ? info->name : std::string(fill_in)) +
               (mask ? ", mask: " + mask->name : "") + ", noise: {model: constant, sigma_m: 0.003}}   # check: noise of the sensor\n";
    }
    if (topic.use == "clouds")
      clouds += "    - {topic: " + topic.name + ", sigma_m: 0.003}   # check: standard deviation of a point\n";
  }
  if (!depth.empty()) text += "  depth:\n" + depth;
  if (!clouds.empty() && depth.empty()) text += "  clouds:\n" + clouds;
  if (!clouds.empty() && !depth.empty()) {  // both would most often show the same points twice
    text += "  # in place of depth, or beside it where they are another device's:\n";
    std::istringstream lines("  clouds:\n" + clouds);
    for (std::string line; std::getline(lines, line);) text += "  #" + line.substr(1) + "\n";
  }
  const std::string base = std::find(frames.begin(), frames.end(), "base_link") != frames.end() ? "base_link"
                           : roots.empty()                                                      ? fill_in
                                                                                                : roots.front();
  text += "frames: {base: " + base +
          ", tip: " + guess_frame(frames, {"tool_tip", "tip", "tcp", "tool", "ee", "hand", "flange"}) +
          "}   # check: of a tip or camera that no frame names, frames.fixed says where it is\n";
  text += "wrench: {reports: force_on_sensor}   # check: or force_on_object; the sign shows in one push\n";
  if (!depth.empty()) text += "clocks: {camera_offset_s: estimate}\n";
  return text + "steps: {by: detection, travel_sigma_m: 0.0005, travel_offset_std_m: 0.0005}   # check: the arm's repeatability\n";
}

}  // namespace

std::vector<UnusedTopic> unused_topics(const BagSurvey& found, const BagMapping& mapping) {
  std::set<std::string> taken;
  const auto take = [&](const std::optional<MappedTopic>& topic) {
    if (topic) taken.insert(topic->name);
  };
  for (const auto& one : {mapping.wrench, mapping.joints, mapping.robot_description, mapping.marks}) take(one);
  for (const MappedTopic& one : mapping.transforms) taken.insert(one.name);
  for (const MappedCamera& camera : mapping.cameras) {
    for (const MappedTopic& one : {camera.image, camera.info}) taken.insert(one.name);
    take(camera.mask);
    taken.insert(packed_of(camera.image.name));                    // the same pictures
    taken.insert(camera.image.name + "/compressedDepth");
  }
  for (const MappedCloud& cloud : mapping.clouds) taken.insert(cloud.topic.name);
  const bool has_robot = mapping.plan.recording.robot || mapping.robot_description || first_of(found, "robot description");
  // A robot has many cameras; missed are those of its depth images.
  const auto of_unused = [&](const SurveyedTopic& info) {
    return std::any_of(found.topics.begin(), found.topics.end(), [&](const SurveyedTopic& depth) {
      return depth.use == "depth images" && !taken.contains(depth.name) && camera_info_of(found, depth.name) == &info;
    });
  };
  std::vector<UnusedTopic> unused;
  for (const SurveyedTopic& topic : found.topics) {
    if (topic.messages == 0 || taken.contains(topic.name)) continue;
    const auto named = [&](const char* part) { return topic.name.find(part) != std::string::npos; };
    const char* key = topic.use == "force"                                               ? "topics.wrench"
                      : topic.use == "joints" && has_robot                               ? "topics.joints"
                      : topic.use == "transforms" && !mapping.transforms.empty()         ? "topics.transforms"
                      : topic.use == "robot description" && !mapping.plan.recording.robot ? "topics.robot_description"
                      : topic.use == "depth images" && !is_repeated(found, topic)        ? "topics.depth"
                      : topic.use == "camera" && of_unused(topic)                        ? "topics.depth"
                      : topic.use == "grey images" && named("mask")                      ? "topics.depth"
                      : topic.use == "clouds" && mapping.cameras.empty()                 ? "topics.clouds"
                      : topic.use == "texts" && named("mark")                            ? "topics.marks"
                                                                                         : nullptr;
    if (key != nullptr) unused.push_back({topic.name, topic.use, key});
  }
  return unused;
}

BagSurvey survey(const MessageSource& bag) {
  BagSurvey result;
  std::vector<const Message*> first(bag.topics.size(), nullptr), last(bag.topics.size(), nullptr);
  for (const Message& message : bag.messages) {
    if (first[message.topic] == nullptr) first[message.topic] = &message;
    last[message.topic] = &message;
  }
  const std::int64_t start_ns = bag.messages.empty() ? 0 : bag.messages.front().log_time_ns;
  if (!bag.messages.empty()) result.duration_s = static_cast<double>(bag.messages.back().log_time_ns - start_ns) * 1e-9;
  for (std::size_t i = 0; i < bag.topics.size(); ++i) {
    const MessageTopic& topic = bag.topics[i];
    SurveyedTopic one{topic.name, topic.type, topic.messages, 0, 0, 0, "", ""};
    if (first[i] != nullptr) {
      one.from_s = static_cast<double>(first[i]->log_time_ns - start_ns) * 1e-9;
      one.to_s = static_cast<double>(last[i]->log_time_ns - start_ns) * 1e-9;
      if (topic.messages > 1 && one.to_s > one.from_s)
        one.rate_hz = static_cast<double>(topic.messages - 1) / (one.to_s - one.from_s);
    }
    one.use = use_of(topic, first[i]);
    if (first[i] != nullptr &&
        (one.use == "force" || one.use == "depth images" || one.use == "clouds" || one.use == "camera")) {
      try {
        one.frame = decode_header(first[i]->data, topic.name, topic.encoding).frame;
      } catch (const Error&) {  // damaged: reading it with a mapping will say so
      }
    }
    result.topics.push_back(std::move(one));
  }

  std::map<std::string, std::string> parent;
  for (const Message& message : bag.messages) {
    if (result.topics[message.topic].use != "transforms") continue;
    try {
      for (const RosTransform& one : decode_transforms(message.data, "", bag.topics[message.topic].encoding))
        parent[one.child] = one.header.frame;
    } catch (const Error&) {
    }
  }
  std::vector<std::string> frames, roots;
  for (const auto& [child, above] : parent) {
    result.frames.push_back(child + " of " + above);
    for (const std::string& name : {child, above})
      if (std::find(frames.begin(), frames.end(), name) == frames.end()) frames.push_back(name);
    if (!parent.count(above) && std::find(roots.begin(), roots.end(), above) == roots.end()) roots.push_back(above);
  }

  const auto has = [&](const char* use) { return first_of(result, use) != nullptr; };
  if (!has("force"))
    result.missing.push_back(
        "there is no force (geometry_msgs/WrenchStamped): without one, Young's modulus cannot be learned");
  if (!has("transforms") && !(has("joints") && has("robot description")))
    result.missing.push_back(
        "nothing says where the tool's tip was: record /tf and /tf_static, or /joint_states with /robot_description");
  if (!has("depth images") && !has("clouds"))
    result.missing.push_back(
        "there is neither a depth image (16UC1, 32FC1, compressedDepth) nor a point cloud: force and travel alone tell "
        "Young's modulus, the Poisson ratio hardly");
  if (has("depth images") && !has("camera"))
    result.missing.push_back("the depth images have no sensor_msgs/CameraInfo: record the camera's info topic too");
  for (const SurveyedTopic& topic : result.topics) {
    if (topic.frame.empty() || topic.use == "camera") continue;
    if (has("transforms") && std::find(frames.begin(), frames.end(), topic.frame) == frames.end())
      result.missing.push_back("no transform mentions the frame '" + topic.frame + "' of " + topic.name +
                               ": say where it is in the mapping's frames.fixed, unless the robot's description knows it");
  }
  result.mapping = skeleton(result, frames, roots);
  return result;
}

}  // namespace palpate::io
