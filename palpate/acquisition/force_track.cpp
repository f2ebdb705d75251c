// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/force_track.hpp"

#include <algorithm>
#include <cmath>
#include <deque>

#include "palpate/acquisition/stream_joints.hpp"
#include "palpate/core/error.hpp"
#include "palpate/sensing/kinematics.hpp"
#include "palpate/sensing/wrench.hpp"

namespace palpate::acquisition {
namespace {

std::string sensor_frame(const StreamPlan& plan, const SensorStreams& streams) {
  return plan.wrench_frame.empty() ? streams.wrench_frame : plan.wrench_frame;
}

/// A joint that nobody tells, which hides a frame: its own link's, or that of the link that it is mounted on.
std::optional<std::string> hiding_joint(const FrameTree& tree, const StreamPlan& plan, const SensorStreams& streams,
                                        const std::string& frame) {
  if (!plan.recording.robot) return std::nullopt;
  const sensing::Kinematics kinematics(*plan.recording.robot);
  const auto& links = kinematics.robot().links;
  const std::string top = tree.root_of(frame);
  const auto link = std::find_if(links.begin(), links.end(), [&](const RobotLink& one) { return one.name == top; });
  if (link == links.end()) return std::nullopt;
  return kinematics.missing_joint(static_cast<Index>(link - links.begin()), streams.joint_names);
}

/// @param name   of what has the frame, for the message
/// @param field  of the mapping that names it; the tip's own where it has one
void demand_frame(const FrameTree& tree, const StreamPlan& plan, const SensorStreams& streams, const std::string& frame,
                  const std::string& name, const char* field) {
  if (frame == plan.base_frame || tree.connects(plan.base_frame, frame)) return;
  std::string known;
  for (const std::string& one : tree.frames()) known += (known.empty() ? "" : ", ") + one;
  const auto written = [&](const std::string& where) { return where.empty() ? plan.source + ": " + field : where; };
  if (!known.empty() && !tree.knows(plan.base_frame))
    throw Error("no transform names the base frame '" + plan.base_frame + "'; frames in the bag: " + known, written(plan.base_where));
  const std::string where = written(frame == plan.tip_frame ? plan.tip_where : "");
  if (const auto joint = hiding_joint(tree, plan, streams, frame))
    throw Error("the frame '" + frame + "' (" + name + ") hangs on the joint '" + *joint + "', " +
                    (streams.joints.empty() ? "and there are no joint states (topics.joints); map or record them, or the transforms,"
                                            : "which the joint states (topics.joints) never tell; record its topic,") +
                    " or name a frame before that joint",
                where);
  throw Error("the frame '" + frame + "' (" + name + ") is not connected to the base frame '" + plan.base_frame +
                  "' by any transform; frames in the bag: " + (known.empty() ? "none" : known) +
                  ". A robot description with joint states helps too, and frames.fixed says where a frame is that nothing in the bag tells",
              where);
}

/// Way of the tip so far, signed along its own axis or as a length.
RunningSum way_of(const Track& track, bool is_signed, double from_s, double to_s) {
  RunningSum sum;
  double value = 0;
  for (std::size_t i = 0; i < track.samples.size(); ++i) {
    const auto& sample = track.samples[i];
    if (sample.time_s < from_s || sample.time_s > to_s) continue;
    if (!sum.times_s.empty() && sample.time_s <= sum.times_s.back()) continue;
    if (i > 0 && !sum.times_s.empty()) {
      const Vec3 moved = sample.tip_m - track.samples[i - 1].tip_m;
      value += is_signed ? moved.dot(track.direction[i]) : moved.norm();
    }
    sum.times_s.push_back(sample.time_s);
    sum.values.push_back(value);
  }
  return sum;
}

/// The tip at the arm's own times, no denser than the period, without a force. Not at all times from the first to the last of
/// everything: one stamp of another century is enough, and they have no end.
Track tip_track(const StreamPlan& plan, const FrameTree& tree, double period_s) {
  Track track;
  for (const double time : tree.times_s(plan.base_frame, plan.tip_frame)) {
    if (!track.samples.empty() && time < track.samples.back().time_s + period_s) continue;
    const auto tip = tree.lookup(plan.base_frame, plan.tip_frame, time);
    if (!tip) continue;
    track.samples.push_back({time, Vec3::Zero(), tip->translation()});
    track.direction.push_back(tip->linear().col(2));
  }
  return track;
}

/// The streams' frames, and of the links that no transform names those whose joint is fixed or told by the joint states.
std::vector<FrameLink> with_links_of(const sensing::Kinematics& kinematics, const FrameTree& tree, const SensorStreams& streams) {
  const auto& joints = kinematics.robot().joints;
  std::vector<FrameLink> links = streams.frames;
  std::vector<std::pair<std::size_t, std::size_t>> moving;  // a link, a joint
  const auto fixed = kinematics.joint_poses({}, {});
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (tree.has_parent(joints[j].child)) continue;
    if (!fixed[j]) moving.emplace_back(links.size(), j);
    links.push_back({joints[j].parent, joints[j].child, bool(fixed[j]), {}});
    if (fixed[j]) links.back().samples.push_back({0, *fixed[j]});
  }
  // Joints that the description does not know (of another device on the topic) have no say.
  std::vector<std::size_t> used;
  std::vector<std::string> names;
  for (std::size_t k = 0; k < streams.joint_names.size(); ++k) {
    if (knows(kinematics.robot(), streams.joint_names[k])) used.push_back(k), names.push_back(streams.joint_names[k]);
  }
  for (const JointSample& sample : streams.joints) {
    std::vector<double> positions;
    for (const std::size_t k : used) positions.push_back(sample.positions[k]);
    // Of a joint that nobody tells, a gripper's perhaps, only what hangs on it is not known.
    const auto poses = kinematics.joint_poses(names, positions);
    for (const auto& [link, joint] : moving)
      if (poses[joint]) links[link].samples.push_back({sample.time_s, *poses[joint]});
  }
  return links;
}

}  // namespace

FrameTree tree_of(const StreamPlan& plan, const SensorStreams& streams) {
  FrameTree tree(streams.frames);
  std::vector<std::string> wanted{plan.tip_frame};
  if (!plan.force_on_object || sensor_frame(plan, streams) != plan.base_frame) wanted.push_back(sensor_frame(plan, streams));
  for (const DepthStream& camera : streams.cameras) wanted.push_back(camera.frame);
  for (const CloudStream& cloud : streams.clouds) wanted.push_back(cloud.frame);
  const auto& robot = plan.recording.robot;
  const bool missing =
      std::any_of(wanted.begin(), wanted.end(), [&](const auto& one) { return !tree.connects(plan.base_frame, one); });
  if (missing && robot) tree = FrameTree(with_links_of(sensing::Kinematics(*robot), tree, streams));
  demand_frame(tree, plan, streams, plan.tip_frame, "tip", "frames.tip");
  if (wanted.size() > 1 && wanted[1] == sensor_frame(plan, streams))
    demand_frame(tree, plan, streams, wanted[1], "wrench", "frames.wrench");
  for (const DepthStream& camera : streams.cameras) demand_frame(tree, plan, streams, camera.frame, camera.name, "topics.depth");
  for (const CloudStream& cloud : streams.clouds) demand_frame(tree, plan, streams, cloud.frame, cloud.name, "topics.clouds");
  return tree;
}

Track track_of(const StreamPlan& plan, const SensorStreams& streams, const FrameTree& tree, double wrench_offset_s) {
  const std::string sensor = sensor_frame(plan, streams);
  sensing::ToolWeight weight;
  weight.mass_kg = plan.tool_mass_kg;
  weight.centre_m = plan.tool_centre_m;
  Track track;
  for (const WrenchSample& sample : streams.wrenches) {
    const double time = sample.time_s + wrench_offset_s;
    const auto tip = tree.lookup(plan.base_frame, plan.tip_frame, time);
    const auto at_sensor =
        sensor == plan.base_frame ? std::optional(Pose(Pose::Identity())) : tree.lookup(plan.base_frame, sensor, time);
    if (!tip || !at_sensor) continue;
    // A sensor that reports the force on the object has turned the sign of all that it felt, the tool's weight with it.
    const double sign = plan.force_on_object ? -1 : 1;
    const sensing::WrenchReading reading{time, sign * sample.force_n, sign * sample.torque_nm, at_sensor->linear()};
    const Vec3 force =
        sensing::wrench_at_tip(reading, weight, plan.gravity_m_s2, at_sensor->inverse() * tip->translation()).force_n;
    track.samples.push_back({time, force, tip->translation()});
    track.direction.push_back(tip->linear().col(2).normalized());
  }
  if (track.samples.empty())
    throw Error("the tip's pose is known at no time at which there is a force; check frames and clocks",
                plan.source + ": frames");
  return track;
}

ClockOffset wrench_offset(const StreamPlan& plan, const SensorStreams& streams, const FrameTree& tree) {
  constexpr double bin_s = 0.02;
  ClockOffset found;
  found.sensor = "force";
  const Track raw = track_of(plan, streams, tree, 0);
  const auto spans = find_contacts(raw, plan);
  if (spans.empty()) return found;
  std::vector<Change> changes;
  double from = 1e300, to = -1e300;
  for (const ContactSpan& span : spans) {
    const double begin = raw.samples[span.begin].time_s, end = raw.samples[span.end - 1].time_s;
    from = std::min(from, begin), to = std::max(to, end);
    std::size_t i = span.begin;
    for (double time = begin; time + bin_s <= end; time += bin_s) {
      // Mean force of the bin against that of the next: one sample would be mostly noise.
      const auto mean = [&](double a) {
        while (i > span.begin && raw.samples[i - 1].time_s >= a) --i;
        while (i < span.end && raw.samples[i].time_s < a) ++i;
        double sum = 0, count = 0;
        for (std::size_t k = i; k < span.end && raw.samples[k].time_s < a + bin_s; ++k)
          sum += raw.samples[k].force_n.dot(span.direction), ++count;
        return count > 0 ? sum / count : std::nan("");
      };
      const Change change{time + 0.5 * bin_s, time + 1.5 * bin_s, mean(time + bin_s) - mean(time)};
      if (std::isfinite(change.amount)) changes.push_back(change);
    }
  }
  const Track tip = tip_track(plan, tree, 0.0025);
  const double margin = plan.largest_offset_s + 1;
  found = find_offset(way_of(tip, true, from - margin, to + margin), changes, plan.largest_offset_s);
  found.sensor = "force";
  return found;
}

ClockOffset camera_offset(const StreamPlan& plan, const FrameTree& tree, const DepthStream& camera) {
  constexpr std::size_t most_images = 600;
  constexpr double compared_s = 0.15;        // apart: the tool has to have moved beyond the noise of a pixel
  constexpr double largest_change_m = 0.02;  // edges jump by as much as the background is away: they count, but not for more
  ClockOffset found;
  found.sensor = camera.name;
  if (camera.times_s.empty()) return found;
  const Track tip = tip_track(plan, tree, 0.005);
  const RunningSum way = way_of(tip, false, -1e300, 1e300);
  // Where most happens: the stretch of images over which the tip goes farthest.
  std::size_t begin = 0;
  const std::size_t count = std::min(most_images, camera.times_s.size());
  double farthest = -1;
  for (std::size_t i = 0; !way.times_s.empty() && i + count <= camera.times_s.size();
       i += std::max<std::size_t>(1, count / 4)) {
    const double gone = way.at(camera.times_s[i + count - 1]) - way.at(camera.times_s[i]);
    if (gone > farthest) farthest = gone, begin = i;
  }
  const double period_s = count > 1 ? (camera.times_s[begin + count - 1] - camera.times_s[begin]) / double(count - 1) : 1;
  const auto apart = std::size_t(std::max(1.0, std::round(compared_s / period_s)));
  std::vector<Change> changes;
  std::deque<std::pair<double, DepthImage>> seen;
  for (std::size_t i = begin; i < begin + count; ++i) {
    DepthImage image;
    try {
      const DepthImage whole = camera.image(i);
      const Eigen::Index stride = std::max<Eigen::Index>(1, whole.cols() / 160);
      image.resize(whole.rows() / stride, whole.cols() / stride);
      for (Eigen::Index r = 0; r < image.rows(); ++r)
        for (Eigen::Index c = 0; c < image.cols(); ++c) image(r, c) = whole(r * stride, c * stride);
    } catch (const Error&) {
      continue;  // a damaged image
    }
    if (seen.size() == apart) {
      const auto& [time_s, before] = seen.front();
      double changed = 0;
      for (Eigen::Index k = 0; before.size() == image.size() && k < image.size(); ++k) {
        const double a = before.data()[k], b = image.data()[k];
        if (a > 0 && b > 0) changed += std::min(std::abs(a - b), largest_change_m);
      }
      changes.push_back({time_s, camera.times_s[i], changed});
      seen.pop_front();
    }
    seen.emplace_back(camera.times_s[i], std::move(image));
  }
  found = find_offset(way, changes, plan.largest_offset_s, double(apart));
  found.sensor = camera.name;
  return found;
}

}  // namespace palpate::acquisition
