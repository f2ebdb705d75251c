// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_mapping.hpp"

#include <algorithm>

#include "palpate/io/file.hpp"
#include "palpate/io/recording_reader.hpp"

namespace palpate::io {
namespace {

constexpr const char* mapping_format = "palpate-mapping/1";
constexpr std::pair<const char*, StepsBy> ways[] = {
    {"times", StepsBy::times}, {"marks", StepsBy::marks}, {"detection", StepsBy::detection}};
constexpr std::pair<const char*, bool> reports[] = {{"force_on_sensor", false}, {"force_on_object", true}};
constexpr std::pair<const char*, bool> stamps[] = {{"header", false}, {"log", true}};
/// What is searched at all: every 2 ms of it is tried.
constexpr PhysicalRange search{0.01, 10, "s", "clocks that are further apart: give the offset as a number, or take stamp: log"};
constexpr PhysicalRange window{1e-3, 60, "s", "it is the time over which the force of one step is averaged"};

MappedTopic topic_of(const YamlField& field) {
  const std::string name = field.text();
  if (name.empty() || name[0] != '/') field.fail("a topic starts with '/', e.g. /" + (name.empty() ? "joint_states" : name));
  return {name, field.where()};
}

std::optional<MappedTopic> topic_or_none(YamlKeys& keys, const std::string& key) {
  const auto field = keys.optional(key);
  return field ? std::optional<MappedTopic>(topic_of(*field)) : std::nullopt;
}

void read_depth(const YamlField& list, BagMapping& mapping) {
  for (const YamlField& item : list.items()) {
    YamlKeys keys(item);
    MappedCamera camera;
    camera.image = topic_of(keys.required("image", "the topic of the depth images"));
    camera.info = topic_of(keys.required("info", "the topic of their CameraInfo"));
    camera.mask = topic_or_none(keys, "mask");
    camera.frame = keys.text_or("frame", "");
    if (const auto wanted = keys.optional("mask_robot")) camera.mask_robot = wanted->boolean();
    if (const auto straight = keys.optional("rectified")) camera.rectified = straight->boolean();
    camera.like.pose_std_m = keys.within_or("pose_std_m", 0, ranges::length_std);
    camera.like.pose_std_rad = keys.within_or("pose_std_rad", 0, ranges::angle_std);
    const YamlField noise = keys.required("noise", "e.g. {model: constant, sigma_m: 0.002}");
    camera.like.noise = read_depth_noise(noise);
    camera.noise_where = YamlKeys(noise).required("model").where();
    keys.finish();
    mapping.cameras.push_back(std::move(camera));
  }
}

void read_clouds(const YamlField& list, BagMapping& mapping) {
  for (const YamlField& item : list.items()) {
    YamlKeys keys(item);
    MappedCloud cloud;
    cloud.topic = topic_of(keys.required("topic"));
    cloud.frame = keys.text_or("frame", "");
    if (const auto wanted = keys.optional("mask_robot")) cloud.mask_robot = wanted->boolean();
    cloud.sigma_m = keys.required("sigma_m", "the standard deviation of a point, per axis").within(ranges::length_sigma);
    cloud.pose_std_m = keys.within_or("pose_std_m", 0, ranges::length_std);
    cloud.pose_std_rad = keys.within_or("pose_std_rad", 0, ranges::angle_std);
    keys.finish();
    mapping.clouds.push_back(std::move(cloud));
  }
}

void read_topics(const YamlField& field, BagMapping& mapping) {
  YamlKeys keys(field);
  mapping.wrench = topic_or_none(keys, "wrench");
  mapping.joints = topic_or_none(keys, "joints");
  mapping.robot_description = topic_or_none(keys, "robot_description");
  mapping.marks = topic_or_none(keys, "marks");
  const auto transforms = keys.optional("transforms"), depth = keys.optional("depth"), clouds = keys.optional("clouds");
  if (!mapping.wrench) keys.required("wrench", "the topic of the force sensor: without a force there is no Young's modulus");
  keys.finish();
  if (transforms) {
    for (const YamlField& one : transforms->items()) mapping.transforms.push_back(topic_of(one));
  }
  if (depth) read_depth(*depth, mapping);
  if (clouds) read_clouds(*clouds, mapping);
}

FixedFrame read_fixed_frame(const YamlField& item, const StreamPlan& plan) {
  YamlKeys keys(item);
  const YamlField parent = keys.required("parent", "the frame that the other one is fixed to"),
                  child = keys.required("child", "the frame that is fixed to the parent"),
                  pose = keys.required("T_parent_child", "{position_m: [..], quaternion_xyzw: [..]} or 4 rows of 4 numbers");
  keys.finish();
  const FixedFrame frame{parent.text(), child.text(), read_pose(pose), item.where(), parent.where()};
  if (frame.parent.empty()) parent.fail("a frame has a name");
  if (frame.child.empty()) child.fail("a frame has a name");
  if (frame.parent == frame.child) child.fail("is the parent itself");
  if (frame.child == plan.base_frame)
    child.fail("is the base frame, which hangs on nothing: give the inverse, with '" + frame.child + "' as the parent");
  return frame;
}

void read_fixed_frames(const YamlField& list, BagMapping& mapping) {
  for (const YamlField& item : list.items()) {
    FixedFrame frame = read_fixed_frame(item, mapping.plan);
    for (const FixedFrame& other : mapping.fixed_frames)
      if (other.child == frame.child) item.fail("the frame '" + frame.child + "' is fixed to '" + other.parent + "' already");
    mapping.fixed_frames.push_back(std::move(frame));
  }
}

void read_frames(const YamlField& field, BagMapping& mapping) {
  StreamPlan& plan = mapping.plan;
  YamlKeys keys(field);
  const YamlField base = keys.required("base", "the frame that meshes, planes and answers are given in"),
                  tip = keys.required("tip", "the frame of the tool's tip, z along the tool and into the object");
  plan.base_frame = base.text(), plan.base_where = base.where();
  plan.tip_frame = tip.text(), plan.tip_where = tip.where();
  plan.wrench_frame = keys.text_or("wrench", "");
  const auto fixed = keys.optional("fixed");
  keys.finish();
  if (fixed) read_fixed_frames(*fixed, mapping);
}

ClockPlan read_clock(YamlKeys& keys, const std::string& key) {
  ClockPlan clock;
  const auto field = keys.optional(key);
  if (!field) return clock;
  if (field->is_scalar() && field->text() == "estimate") {
    clock.estimate = true;
  } else {
    clock.offset_s = field->number();
  }
  return clock;
}

void read_clocks(const YamlField& field, BagMapping& mapping) {
  YamlKeys keys(field);
  if (const auto stamp = keys.optional("stamp")) mapping.use_log_time = stamp->choice<bool>(stamps);
  mapping.plan.camera_clock = read_clock(keys, "camera_offset_s");
  mapping.plan.wrench_clock = read_clock(keys, "wrench_offset_s");
  if (const auto most = keys.optional("largest_offset_s")) mapping.plan.largest_offset_s = most->within(search);
  keys.finish();
}

void read_wrench(const YamlField& field, StreamPlan& plan) {
  YamlKeys keys(field);
  plan.force_on_object =
      keys.required("reports", "force_on_sensor (what most sensors report) or force_on_object").choice<bool>(reports);
  if (const auto tare = keys.optional("tare")) {
    if (tare->is_map()) {
      YamlKeys inner(*tare);
      plan.tare = Tare::between;
      plan.tare_from_s = inner.required("from_s").number();
      const YamlField to = inner.required("to_s");
      plan.tare_to_s = to.number();
      if (!(plan.tare_to_s > plan.tare_from_s)) to.fail("must be later than from_s");
      inner.finish();
    } else {
      constexpr std::pair<const char*, Tare> words[] = {{"none", Tare::none}, {"before_contact", Tare::before_contact}};
      plan.tare = tare->choice<Tare>(words);
    }
  }
  if (const auto duration = keys.optional("tare_s")) plan.tare_s = duration->positive();
  plan.tool_mass_kg = keys.within_or("tool_mass_kg", 0, ranges::tool_mass);
  if (const auto centre = keys.optional("tool_centre_m")) plan.tool_centre_m = centre->vector3();
  if (const auto gravity = keys.optional("gravity_m_s2")) plan.gravity_m_s2 = gravity->vector3();
  keys.finish();
}

/// The keys that stand in `steps` for every push, or in one push for itself.
void read_push_keys(YamlKeys& keys, const Recording& recording, PlannedPush& push) {
  if (const auto tool = keys.optional("tool")) {
    push.tool = tool->text();
    std::vector<std::string> known;
    for (const Tool& one : recording.tools) known.push_back(one.name);
    if (std::find(known.begin(), known.end(), push.tool) == known.end()) tool->fail_name("tool", "tools", known);
  }
  push.site = keys.text_or("site", push.site);
  if (const auto contact = keys.optional("contact_m")) push.contact_m = contact->vector3();
  if (const auto direction = keys.optional("direction")) push.direction = direction->unit_vector();
  push.force_tare_std_n = keys.within_or("force_tare_std_n", push.force_tare_std_n, ranges::force_std);
  push.travel_offset_std_m = keys.within_or("travel_offset_std_m", push.travel_offset_std_m, ranges::length_std);
  push.contact_std_m = keys.within_or("contact_std_m", push.contact_std_m, ranges::length_std);
  push.force_relative_std = keys.within_or("force_relative_std", push.force_relative_std, ranges::share_std);
  if (const auto sigma = keys.optional("force_std_n")) push.force_std_n = sigma->within(ranges::force_std);
  if (const auto sigma = keys.optional("travel_sigma_m")) {
    push.travel_sigma_m.clear();
    for (const YamlField& one : sigma->is_list() ? sigma->items() : std::vector<YamlField>{*sigma})
      push.travel_sigma_m.push_back(one.within(ranges::length_sigma));
  }
}

void read_steps(const YamlField& field, BagMapping& mapping) {
  StreamPlan& plan = mapping.plan;
  YamlKeys keys(field);
  const YamlField by = keys.required("by", "times, marks or detection");
  plan.steps_by = by.choice<StepsBy>(ways);
  if (plan.steps_by == StepsBy::marks && !mapping.marks) by.fail("needs the topic of the marks: topics.marks");
  if (const auto value = keys.optional("window_s")) plan.window_s = value->within(window);
  if (const auto value = keys.optional("image_gap_s")) plan.image_gap_s = value->positive();
  if (const auto value = keys.optional("contact_threshold_n")) plan.contact_threshold_n = value->positive();
  if (const auto value = keys.optional("still_m_s")) plan.still_m_s = value->positive();
  if (const auto value = keys.optional("hold_s")) plan.hold_s = value->positive();
  if (plan.recording.tools.size() == 1) plan.any_push.tool = plan.recording.tools.front().name;
  read_push_keys(keys, plan.recording, plan.any_push);
  const auto pushes = keys.optional("pushes");
  if (plan.steps_by == StepsBy::times && !pushes)
    keys.required("pushes", "a list of {name, at_s: [seconds from the bag's start]}");
  keys.finish();
  if (pushes) {
    for (const YamlField& item : pushes->items()) {
      YamlKeys inner(item);
      PlannedPush push = plan.any_push;
      push.where = item.where();
      const std::string otherwise = "push " + std::to_string(plan.pushes.size() + 1);
      push.name = plan.steps_by == StepsBy::marks ? inner.required("name", "as the marks name it").text()
                                                  : inner.text_or("name", otherwise);
      for (const PlannedPush& other : plan.pushes)
        if (other.name == push.name) item.fail("there is a push '" + push.name + "' already");
      read_push_keys(inner, plan.recording, push);
      if (plan.steps_by == StepsBy::times) {
        const YamlField at = inner.required("at_s", "the times of the steps, seconds from the bag's start");
        push.at_s = at.numbers();
        if (push.at_s.empty()) at.fail("holds no time");
        for (std::size_t i = 1; i < push.at_s.size(); ++i)
          if (!(push.at_s[i] > push.at_s[i - 1])) at.fail("times must rise");
      }
      inner.finish();
      if (push.tool.empty()) item.fail("which of the tools pushed? Give 'tool'");
      plan.pushes.push_back(std::move(push));
    }
  }
  if (plan.any_push.tool.empty() && plan.steps_by != StepsBy::times) field.fail("which of the tools pushed? Give 'tool'");
}

}  // namespace

BagMapping read_mapping(const std::filesystem::path& path) {
  const std::filesystem::path root = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  RecordingContext context{RecordingFolder(root), {}, {}, {}, {}, 0, {}};
  BagMapping mapping;
  mapping.root = root;
  context.of_bag = &mapping.plan;
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) throw Error("there is no such mapping", path.string());
  const YamlField top = YamlField::parse(context.folder.read(path.filename().string(), path.string()), path.string());
  YamlKeys keys(top);
  const YamlField format = keys.required("format", std::string("write 'format: ") + mapping_format + "'");
  if (format.text() != mapping_format) {
    if (format.text().starts_with("palpate-recording/"))
      format.fail("this is a recording, not the mapping of a bag; give its folder as the recording");
    format.fail("'" + format.text().substr(0, 60) + "' is not a format that this version reads; it reads " + mapping_format);
  }
  const YamlField topics = keys.required("topics", "say which topic holds what; `palpate info BAG` suggests it");
  const YamlField frames = keys.required("frames", "name the frames: {base: ..., tip: ...}");
  const YamlField steps = keys.required("steps", "say how steps are found: {by: detection}");
  const auto clocks = keys.optional("clocks"), wrench = keys.optional("wrench");
  read_object(keys, context);
  mapping.plan.recording = std::move(context.recording);
  if (mapping.plan.recording.tools.empty()) keys.required("tools", "say what touched the object");
  read_topics(topics, mapping);
  read_frames(frames, mapping);
  if (clocks) read_clocks(*clocks, mapping);
  if (!wrench) keys.required("wrench", "{reports: force_on_sensor} or {reports: force_on_object}");
  read_wrench(*wrench, mapping.plan);
  read_steps(steps, mapping);
  mapping.plan.recording.input_hashes = context.folder.hashes();
  mapping.plan.source = path.string();
  return mapping;
}

}  // namespace palpate::io
