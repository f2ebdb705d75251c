// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/io/bag_fixed_frames.hpp"
#include "palpate/io/bag_mapping.hpp"
#include "palpate/io/ros_messages.hpp"
#include "palpate/io/urdf.hpp"
#include "palpate/io/yaml_field.hpp"

namespace palpate::io {
namespace {

constexpr double foreign_clock_s = 1;  // recorders are not that late: the headers then count from another zero
constexpr double far_lengths = 10, far_s = 60;  // a bag played ten times as fast still says its own times

/// A message whose stamp is no time of this bag.
class StrayStamp : public Error {
 public:
  StrayStamp(double time_s, const std::string& where)
      : Error("the stamp lies " + std::to_string(std::llround(time_s)) + " s from the bag's start", where) {}
};

/// ROS 1 let frames start with a slash.
std::string plain(const std::string& frame) { return frame.starts_with("/") ? frame.substr(1) : frame; }

class StreamReader {
 public:
  StreamReader(const MessageSource& bag, const BagMapping& mapping) : bag_(bag), mapping_(mapping) {
    if (bag.messages.empty()) throw Error("holds no message" + (bag.warnings.empty() ? "" : ": " + bag.warnings.front()), bag.name);
    start_ns_ = bag.messages.front().log_time_ns;
    const StreamPlan& plan = mapping.plan;
    const double length_s = static_cast<double>(bag.messages.back().log_time_ns - start_ns_) * 1e-9;
    far_s_ = far_s + far_lengths * length_s + std::abs(plan.camera_clock.offset_s) + std::abs(plan.wrench_clock.offset_s);
  }

  /// The messages of a topic. @throws Error when there is no such topic, or none of these types.
  struct Topic {
    const MessageTopic* about = nullptr;
    std::vector<const Message*> messages;
    std::string mapped;  ///< file, line and field
  };
  Topic topic(const MappedTopic& mapped, const std::vector<std::string>& types) const {
    Topic found;
    std::vector<std::string> names;
    for (std::size_t i = 0; i < bag_.topics.size(); ++i) {
      const MessageTopic& one = bag_.topics[i];
      names.push_back(one.name);
      if (one.name != mapped.name) continue;
      if (!types.empty() && std::find(types.begin(), types.end(), one.type) == types.end()) {
        if (found.about == nullptr) mismatch_ = one.type;
        continue;
      }
      found.about = &one;
      found.mapped = mapped.where;
      for (const Message& message : bag_.messages)
        if (message.topic == i) found.messages.push_back(&message);
      return found;
    }
    if (std::find(names.begin(), names.end(), mapped.name) != names.end()) {
      std::string expected;
      for (const std::string& one : types) expected += (expected.empty() ? "" : " or ") + one;
      throw Error("the topic '" + mapped.name + "' is of type " + mismatch_ + "; " + expected + " is expected", mapped.where);
    }
    const auto near = nearest_word(mapped.name, names);
    throw Error("the bag has no topic '" + mapped.name + "'" + (near ? "; did you mean '" + *near + "'?" : "") +
                    " (`palpate info` lists them)",
                mapped.where);
  }

  /// @throws StrayStamp
  double seconds(const RosHeader& header, const Message& message) const {
    const double time_s = stamped_s(header, message);
    if (is_stray(time_s)) throw StrayStamp(time_s, bag_.name);
    return time_s;
  }
  bool is_stray(double time_s) const { return std::abs(time_s) > far_s_; }
  /// Whatever it says.
  double stamped_s(const RosHeader& header, const Message& message) const {
    const bool by_log = mapping_.use_log_time || header.stamp_ns == 0;
    return static_cast<double>((by_log ? message.log_time_ns : header.stamp_ns) - (by_log ? log_start_ns() : start_ns_)) *
           1e-9;
  }
  double log_seconds(const Message& message) const {
    return static_cast<double>(message.log_time_ns - log_start_ns()) * 1e-9;
  }

  /// Headers of a simulation count from another zero than the recorder's clock does: the forces tell by how much. One without a
  /// stamp, sent before the simulation's clock was heard, tells nothing, and one stamp alone may be nonsense: what most of them say
  /// is the clock, and the first near it the start. (A simulation need not go as fast as the recorder's clock.)
  void settle_start(const Topic& wrench, std::vector<std::string>& warnings) {
    if (mapping_.use_log_time) return;
    std::vector<std::int64_t> shifts_ns;
    for (const Message* message : wrench.messages) {
      try {
        const std::int64_t stamp = decode_header(message->data, where(wrench), wrench.about->encoding).stamp_ns;
        if (stamp != 0) shifts_ns.push_back(stamp - message->log_time_ns);
      } catch (const Error&) {  // damaged: it is counted when the forces are read
      }
    }
    if (shifts_ns.empty()) return;
    std::vector<std::int64_t> sorted = shifts_ns;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    const std::int64_t median_ns = *middle;
    const auto seconds_of = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-9; };
    const std::int64_t first_ns = *std::find_if(shifts_ns.begin(), shifts_ns.end(), [&](std::int64_t one) {
      return std::abs(seconds_of(one - median_ns)) < far_s_;
    });
    if (std::min(std::abs(seconds_of(median_ns)), std::abs(seconds_of(first_ns))) < foreign_clock_s) return;
    start_ns_ += first_ns;
    warnings.push_back("the stamps in the messages' headers and the recorder's clock differ by " +
                       std::to_string(seconds_of(first_ns)) + " s; times count from the bag's start by the headers");
  }

  std::string where(const Topic& topic) const { return bag_.name + ": " + topic.about->name; }

  /// Runs `decode` on every message; those that are damaged, and those of no time of the bag, are counted.
  /// @throws Error where no stamp of a topic is one: its clock is another
  template <typename Decode>
  void each(const Topic& topic, std::vector<std::string>& warnings, Decode decode) const {
    std::size_t lost = 0, stray = 0;
    std::string first_lost, first_stray;
    for (const Message* message : topic.messages) {
      try {
        decode(*message);
      } catch (const StrayStamp& error) {
        if (stray++ == 0) first_stray = error.message();
      } catch (const Error& error) {
        if (lost++ == 0) first_lost = error.message();
      }
    }
    const std::string all = std::to_string(topic.messages.size()) + " messages of ";
    if (lost > 0) warnings.push_back(std::to_string(lost) + " of " + all + topic.about->name + " were left out (" + first_lost + ")");
    if (stray == 0) return;
    const std::string why = " (" + first_stray + "); clocks: {stamp: log} takes the recorder's times, an offset says how far a clock is off";
    if (stray == topic.messages.size())
      throw Error("no stamp of '" + topic.about->name + "' is a time of the bag" + why, topic.mapped);
    warnings.push_back(std::to_string(stray) + " of " + all + topic.about->name + " were left out" + why);
  }

 private:
  std::int64_t log_start_ns() const { return bag_.messages.front().log_time_ns; }
  const MessageSource& bag_;
  const BagMapping& mapping_;
  std::int64_t start_ns_ = 0;
  double far_s_ = 0;  // further from the bag's start no stamp is believed
  mutable std::string mismatch_;
};

template <typename Sample>
void sort_by_time(std::vector<Sample>& samples) {
  std::stable_sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) { return a.time_s < b.time_s; });
}

void read_wrenches(const StreamReader& reader, const StreamReader::Topic& topic, SensorStreams& streams) {
  reader.each(topic, streams.warnings, [&](const Message& message) {
    const RosWrench one = decode_wrench(message.data, reader.where(topic), topic.about->encoding);
    if (!one.force_n.allFinite() || !one.torque_nm.allFinite()) throw Error("holds NaN", reader.where(topic));
    streams.wrenches.push_back({reader.seconds(one.header, message), one.force_n, one.torque_nm});
    if (streams.wrench_frame.empty()) streams.wrench_frame = plain(one.header.frame);
  });
  sort_by_time(streams.wrenches);
  // Sent twice: it is one measurement.
  const auto same = [](const WrenchSample& a, const WrenchSample& b) {
    return a.time_s == b.time_s && a.force_n == b.force_n && a.torque_nm == b.torque_nm;
  };
  streams.wrenches.erase(std::unique(streams.wrenches.begin(), streams.wrenches.end(), same), streams.wrenches.end());
}

/// Several senders (an arm, its gripper) may share the topic and name their joints in any order: every message gives a sample
/// of all joints, those that it does not name as they were last seen, or will first be seen.
void read_joints(const StreamReader& reader, const StreamReader::Topic& topic, SensorStreams& streams) {
  struct Seen {
    double time_s = 0;
    std::vector<std::pair<std::size_t, double>> positions;  // joint and its position
  };
  std::vector<Seen> all;
  std::vector<std::string>& names = streams.joint_names;
  reader.each(topic, streams.warnings, [&](const Message& message) {
    const RosJointState one = decode_joint_state(message.data, reader.where(topic), topic.about->encoding);
    Seen seen{reader.seconds(one.header, message), {}};
    for (std::size_t k = 0; k < one.names.size(); ++k) {
      if (!std::isfinite(one.position[k])) continue;  // drivers say so of joints that they do not measure
      const auto place = std::find(names.begin(), names.end(), one.names[k]);
      seen.positions.emplace_back(static_cast<std::size_t>(place - names.begin()), one.position[k]);
      if (place == names.end()) names.push_back(one.names[k]);
    }
    all.push_back(std::move(seen));
  });
  sort_by_time(all);
  std::vector<double> now(names.size(), 0.0);
  for (auto one = all.rbegin(); one != all.rend(); ++one)
    for (const auto& [joint, position] : one->positions) now[joint] = position;  // ends at the first that was seen
  for (const Seen& one : all) {
    for (const auto& [joint, position] : one.positions) now[joint] = position;
    streams.joints.push_back({one.time_s, now});
  }
}

void read_transforms(const StreamReader& reader, const StreamReader::Topic& topic,
                     std::map<std::pair<std::string, std::string>, FrameLink>& links, SensorStreams& streams) {
  const bool fixed = topic.about->name.ends_with("tf_static");
  reader.each(topic, streams.warnings, [&](const Message& message) {
    std::optional<double> stray_s;
    for (const RosTransform& one : decode_transforms(message.data, reader.where(topic), topic.about->encoding)) {
      const double time_s = reader.stamped_s(one.header, message);
      if (!fixed && reader.is_stray(time_s)) {  // what stands may have been said long before
        stray_s = time_s;
        continue;
      }
      FrameLink& link = links[{plain(one.header.frame), plain(one.child)}];
      link.parent = plain(one.header.frame);
      link.child = plain(one.child);
      link.is_fixed |= fixed;
      link.samples.push_back({time_s, one.T_parent_child});
    }
    if (stray_s) throw StrayStamp(*stray_s, reader.where(topic));
  });
}

/// What the first whole message of a topic says of itself; nothing where all are damaged.
template <typename Decode>
auto first_whole(const StreamReader& reader, const StreamReader::Topic& topic, Decode decode)
    -> std::optional<decltype(decode(std::string_view(), std::string(), MessageEncoding::cdr))> {
  for (const Message* message : topic.messages) {
    try {
      return decode(message->data, reader.where(topic), topic.about->encoding);
    } catch (const Error&) {  // counted where all are read
    }
  }
  return std::nullopt;
}

/// A topic of the right type that holds something else would only show as an image less in every step.
void demand_depth(const StreamReader& reader, const StreamReader::Topic& images, const MappedTopic& mapped, const Camera& camera) {
  if (images.about->type == "sensor_msgs/msg/CompressedImage") {
    const auto format = first_whole(reader, images, decode_compressed_format);
    if (format && format->find("compressedDepth") == std::string::npos)
      throw Error(
          "the images of '" + mapped.name + "' are of format '" + format->substr(0, 40) + "'; depth is compressedDepth",
          mapped.where);
    return;
  }
  const auto kind = first_whole(reader, images, decode_image_kind);
  if (!kind) return;
  if (!kind->is_depth())
    throw Error("the images of '" + mapped.name + "' are of encoding '" + kind->encoding.substr(0, 20) + "'; depth is 16UC1 or 32FC1" +
                    (kind->is_mask() ? ". Is it the mask?" : ""),
                mapped.where);
  if (kind->rows != static_cast<std::size_t>(camera.height_px) || kind->columns != static_cast<std::size_t>(camera.width_px))
    throw Error("the images of '" + mapped.name + "' have " + std::to_string(kind->columns) + " x " + std::to_string(kind->rows) +
                    " pixels, their CameraInfo says " + std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) +
                    "; is it the CameraInfo of another topic?",
                mapped.where);
}

void demand_mask(const StreamReader& reader, const StreamReader::Topic& masks, const MappedTopic& mapped, const Camera& camera) {
  const auto kind = first_whole(reader, masks, decode_image_kind);
  if (!kind) return;
  if (!kind->is_mask())
    throw Error("the images of '" + mapped.name + "' are of encoding '" + kind->encoding.substr(0, 20) +
                    "'; a mask is mono8 or 8UC1",
                mapped.where);
  if (kind->rows != static_cast<std::size_t>(camera.height_px) || kind->columns != static_cast<std::size_t>(camera.width_px))
    throw Error("the mask has " + std::to_string(kind->columns) + " x " + std::to_string(kind->rows) + " pixels, the image " +
                    std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px),
                mapped.where);
}

void read_camera(const StreamReader& reader, const MappedCamera& mapped, const MessageSource& bag, SensorStreams& streams) {
  const auto images = reader.topic(mapped.image, {"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"});
  const auto infos = reader.topic(mapped.info, {"sensor_msgs/msg/CameraInfo"});
  DepthStream camera;
  camera.name = mapped.image.name;
  camera.frame = mapped.frame;
  camera.like = mapped.like;
  camera.mask_robot = mapped.mask_robot;
  if (infos.messages.empty()) throw Error("the topic holds no message: the camera is not known", mapped.info.where);
  const RosCameraInfo info = decode_camera_info(infos.messages.front()->data, reader.where(infos), infos.about->encoding);
  camera.like.camera = info.camera;
  if (info.camera.distortion != DistortionModel::none) {
    // The same CameraInfo stands beside raw and rectified images; image_proc tells them apart by the topic's name.
    const bool straight = mapped.rectified.value_or(mapped.image.name.find("image_rect") != std::string::npos);
    if (straight && !(info.rectified.fx_px > 0 && info.rectified.fy_px > 0))
      throw Error("the images are rectified, but P of the CameraInfo is empty", mapped.info.where);
    if (straight) camera.like.camera = info.rectified;
    if (!mapped.rectified)
      streams.warnings.push_back(mapped.image.name + " is taken as " + (straight ? "rectified" : "not rectified") +
                                 ", by its name, though its CameraInfo has a distortion; say so with rectified: true or false");
  }

  demand_depth(reader, images, mapped.image, camera.like.camera);
  struct Kept {
    std::shared_ptr<const void> memory;
    MessageEncoding encoding = MessageEncoding::cdr;
    bool is_compressed = false;
    std::string where;
    std::vector<std::string_view> data;
    std::vector<std::optional<std::string_view>> masks;
    MessageEncoding mask_encoding = MessageEncoding::cdr;
  };
  const auto kept = std::make_shared<Kept>();
  kept->memory = bag.memory;
  kept->encoding = images.about->encoding;
  kept->is_compressed = images.about->type == "sensor_msgs/msg/CompressedImage";
  kept->where = reader.where(images);
  std::vector<std::pair<double, std::string_view>> found;
  reader.each(images, streams.warnings, [&](const Message& message) {
    const RosHeader header = decode_header(message.data, kept->where, kept->encoding);
    if (camera.frame.empty()) camera.frame = plain(header.frame);
    found.emplace_back(reader.seconds(header, message), message.data);
  });
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [time_s, data] : found) {
    if (!camera.times_s.empty() && camera.times_s.back() == time_s) continue;  // sent twice
    camera.times_s.push_back(time_s);
    kept->data.push_back(data);
  }
  const Camera about = camera.like.camera;
  camera.image = [kept, about](std::size_t i) {
    const DepthImage depth = kept->is_compressed
                                 ? decode_compressed_depth(kept->data[i], kept->where, kept->encoding).depth_m
                                 : decode_image(kept->data[i], kept->where, kept->encoding).depth_m;
    if (depth.rows() != about.height_px || depth.cols() != about.width_px)
      throw Error("the image is of another size than its CameraInfo says", kept->where);
    return depth;
  };
  if (mapped.mask) {
    const auto masks = reader.topic(*mapped.mask, {"sensor_msgs/msg/Image"});
    demand_mask(reader, masks, *mapped.mask, about);
    kept->mask_encoding = masks.about->encoding;
    std::map<double, std::string_view> by_time;
    reader.each(masks, streams.warnings, [&](const Message& message) {
      by_time[reader.seconds(decode_header(message.data, kept->where, kept->mask_encoding), message)] = message.data;
    });
    for (const double time_s : camera.times_s) {
      const auto one = by_time.find(time_s);
      kept->masks.push_back(one == by_time.end() ? std::nullopt : std::optional(one->second));
    }
    camera.mask = [kept, about](std::size_t i) {
      if (!kept->masks[i]) return MaskImage();
      MaskImage mask = decode_mask(*kept->masks[i], kept->where, kept->mask_encoding);
      if (mask.rows() != about.height_px || mask.cols() != about.width_px) throw Error("the mask is of another size than the image", kept->where);
      return mask;
    };
  }
  streams.cameras.push_back(std::move(camera));
}

void read_cloud(const StreamReader& reader, const MappedCloud& mapped, const MessageSource& bag, SensorStreams& streams) {
  const auto topic = reader.topic(mapped.topic, {"sensor_msgs/msg/PointCloud2"});
  CloudStream stream;
  stream.name = mapped.topic.name;
  stream.frame = mapped.frame;
  stream.mask_robot = mapped.mask_robot;
  stream.sigma_m = mapped.sigma_m;
  stream.pose_std_m = mapped.pose_std_m;
  stream.pose_std_rad = mapped.pose_std_rad;
  const auto data = std::make_shared<std::vector<std::string_view>>();
  std::vector<std::pair<double, std::string_view>> found;
  const std::string where = reader.where(topic);
  const MessageEncoding encoding = topic.about->encoding;
  reader.each(topic, streams.warnings, [&](const Message& message) {
    const RosHeader header = decode_header(message.data, where, encoding);
    if (stream.frame.empty()) stream.frame = plain(header.frame);
    found.emplace_back(reader.seconds(header, message), message.data);
  });
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [time_s, bytes] : found) {
    stream.times_s.push_back(time_s);
    data->push_back(bytes);
  }
  stream.cloud = [data, where, encoding, memory = bag.memory](std::size_t i) {
    return decode_point_cloud((*data)[i], where, encoding).cloud;
  };
  streams.clouds.push_back(std::move(stream));
}

}  // namespace

SensorStreams read_streams(const MessageSource& bag, BagMapping& mapping) {
  SensorStreams streams;
  streams.warnings = bag.warnings;
  StreamReader reader(bag, mapping);
  const auto wrench = reader.topic(*mapping.wrench, {"geometry_msgs/msg/WrenchStamped"});
  if (wrench.messages.empty()) throw Error("the topic holds no message", mapping.wrench->where);
  reader.settle_start(wrench, streams.warnings);
  read_wrenches(reader, wrench, streams);
  if (mapping.joints) read_joints(reader, reader.topic(*mapping.joints, {"sensor_msgs/msg/JointState"}), streams);

  std::map<std::pair<std::string, std::string>, FrameLink> links;
  std::vector<MappedTopic> transforms = mapping.transforms;
  if (transforms.empty()) {
    for (const MessageTopic& one : bag.topics)
      if (one.type == "tf2_msgs/msg/TFMessage" || one.type == "tf/msg/tfMessage")
        transforms.push_back({one.name, mapping.plan.source + ": topics.transforms"});
  }
  for (const MappedTopic& one : transforms)
    read_transforms(reader, reader.topic(one, {"tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"}), links, streams);
  std::map<std::string, std::string> parents;
  for (const auto& [name, link] : links) {
    const auto [place, is_new] = parents.emplace(link.child, link.parent);
    if (!is_new)
      streams.warnings.push_back("the frame '" + link.child + "' has two parents, '" + place->second + "' and '" + link.parent +
                                 "': the first is taken at all times");
  }
  for (auto& [name, link] : links) {
    sort_by_time(link.samples);
    streams.frames.push_back(std::move(link));
  }
  for (const MappedCamera& camera : mapping.cameras) read_camera(reader, camera, bag, streams);
  for (const MappedCloud& cloud : mapping.clouds) read_cloud(reader, cloud, bag, streams);
  if (mapping.marks) {
    const auto marks = reader.topic(*mapping.marks, {});
    const bool is_text = marks.about->type == "std_msgs/msg/String";
    reader.each(marks, streams.warnings, [&](const Message& message) {
      streams.marks.push_back({reader.log_seconds(message),
                               is_text ? decode_string(message.data, reader.where(marks), marks.about->encoding) : ""});
    });
    const auto same = [](const MarkSample& a, const MarkSample& b) { return a.time_s == b.time_s && a.text == b.text; };
    streams.marks.erase(std::unique(streams.marks.begin(), streams.marks.end(), same), streams.marks.end());
  }
  if (mapping.robot_description && !mapping.plan.recording.robot) {
    const auto description = reader.topic(*mapping.robot_description, {"std_msgs/msg/String"});
    if (description.messages.empty()) throw Error("the topic holds no message", mapping.robot_description->where);
    const std::string urdf =
        decode_string(description.messages.front()->data, reader.where(description), description.about->encoding);
    mapping.plan.recording.robot = parse_urdf(urdf, reader.where(description), mapping.root, &streams.warnings);
  }
  add_fixed_frames(mapping, streams);
  streams.end_s = static_cast<double>(bag.messages.back().log_time_ns - bag.messages.front().log_time_ns) * 1e-9;
  return streams;
}

}  // namespace palpate::io
