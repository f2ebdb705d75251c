// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/stream_views.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "palpate/acquisition/nearest_time.hpp"
#include "palpate/core/error.hpp"
#include "palpate/sensing/plane_mask.hpp"

namespace palpate::acquisition {

StreamViews::StreamViews(const StreamPlan& plan, const SensorStreams& streams, const FrameTree& tree, std::vector<double> camera_offset_s,
                         double cloud_offset_s)
    : plan_(plan), streams_(streams), tree_(tree), camera_offset_s_(std::move(camera_offset_s)), cloud_offset_s_(cloud_offset_s) {
  used_images_.resize(streams.cameras.size());
  used_clouds_.resize(streams.clouds.size());
}

double StreamViews::seen_at(double time_s) const {
  for (std::size_t c = 0; c < streams_.cameras.size(); ++c) {
    std::set<std::size_t> used = used_images_[c];
    const auto image = nearest_time(streams_.cameras[c].times_s, camera_offset_s_[c], time_s, plan_.image_gap_s, used);
    if (image) return streams_.cameras[c].times_s[*image] + camera_offset_s_[c];
  }
  for (std::size_t c = 0; c < streams_.clouds.size(); ++c) {
    std::set<std::size_t> used = used_clouds_[c];
    const auto cloud = nearest_time(streams_.clouds[c].times_s, cloud_offset_s_, time_s, plan_.image_gap_s, used);
    if (cloud) return streams_.clouds[c].times_s[*cloud] + cloud_offset_s_;
  }
  return time_s;
}

void StreamViews::look(Step& step, RepeatedNotes& notes) {
  for (std::size_t c = 0; c < streams_.cameras.size(); ++c) {
    const DepthStream& camera = streams_.cameras[c];
    const auto image = nearest_time(camera.times_s, camera_offset_s_[c], step.time_s, plan_.image_gap_s, used_images_[c]);
    if (!image) {
      const double gap_s = nearest_gap_s(camera.times_s, camera_offset_s_[c], step.time_s);
      if (gap_s < plan_.image_gap_s)
        notes.add(camera.name + ": its image belongs to another step already; none is left for", step.time_s);
      else
        notes.add(camera.name + ": no image within " + seconds_text(plan_.image_gap_s) + " of", step.time_s, "", gap_s);
      continue;
    }
    auto frame = frame_of(c, *image, step.time_s, notes);
    if (!frame) continue;
    // Its stick alone is masked then, as without a description.
    if (!frame->robot_is_masked && plan_.recording.robot && sensing::has_shapes(*plan_.recording.robot)) step.joints_rad.clear();
    step.observations.emplace_back(std::move(*frame));
  }
  look_at_clouds(step, notes);
}

std::vector<DepthFrame> StreamViews::of_rest(RepeatedNotes& notes) {
  std::vector<DepthFrame> views;
  for (const double time_s : plan_.views_at_s) {
    const std::size_t before = views.size();
    double gap_s = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < streams_.cameras.size(); ++c) {
      std::set<std::size_t> used;  // a view may be the image of a step, too
      const auto image = nearest_time(streams_.cameras[c].times_s, camera_offset_s_[c], time_s, plan_.image_gap_s, used);
      gap_s = std::min(gap_s, nearest_gap_s(streams_.cameras[c].times_s, camera_offset_s_[c], time_s));
      if (!image) continue;
      if (auto frame = frame_of(c, *image, time_s, notes)) views.push_back(std::move(*frame));
    }
    if (views.size() > before) continue;
    const std::string why = streams_.cameras.empty() ? "there are no depth images (topics.depth)"
                            : gap_s < plan_.image_gap_s ? "the image there cannot be used: " + (notes.texts().empty() ? std::string("it shows nothing") : notes.texts().back())
                                                        : "the nearest is " + seconds_text(gap_s) + " away";
    throw Error("there is no view at " + seconds_text(time_s) + ": " + why, plan_.views_where);
  }
  return views;
}

std::optional<DepthFrame> StreamViews::frame_of(std::size_t c, std::size_t image, double step_s, RepeatedNotes& notes) {
  const DepthStream& camera = streams_.cameras[c];
  DepthFrame frame = camera.like;
  frame.time_s = camera.times_s[image] + camera_offset_s_[c];
  const auto pose = pose_of(camera.frame, frame.time_s);
  if (!pose) {
    notes.add(camera.name + ": its pose is not known at the time of the image of", step_s);
    return std::nullopt;
  }
  frame.T_base_camera = *pose;
  try {
    frame.depth_m = camera.image(image);
    if (camera.mask) frame.mask = camera.mask(image);
  } catch (const Error& error) {
    notes.add(camera.name + ": the image cannot be used of", step_s, ": " + error.message());
    return std::nullopt;
  }
  if (const auto at = robot_to_mask(camera.mask_robot, frame.time_s, step_s, "image of", "topics.depth", notes)) {
    frame = sensing::with_mask(frame, mask_->mask_known(frame, at->joints.names, at->joints.positions, at->T_base_root));
    frame.robot_is_masked = true;
  } else {
    frame.robot_is_masked = !camera.mask_robot.value_or(true);  // it is not to be
  }
  if (!sensing::is_blank(frame)) return frame;
  notes.add(camera.name + ": the image shows nothing outside its mask at", step_s, ": left out");
  return std::nullopt;
}

void StreamViews::look_at_clouds(Step& step, RepeatedNotes& notes) {
  for (std::size_t c = 0; c < streams_.clouds.size(); ++c) {
    const CloudStream& stream = streams_.clouds[c];
    const auto number = nearest_time(stream.times_s, cloud_offset_s_, step.time_s, plan_.image_gap_s, used_clouds_[c]);
    const auto pose = number ? pose_of(stream.frame, stream.times_s[*number] + cloud_offset_s_) : std::nullopt;
    if (!pose) {
      notes.add(stream.name + ": no cloud with a known pose near", step.time_s);
      continue;
    }
    const auto at = robot_to_mask(stream.mask_robot, stream.times_s[*number] + cloud_offset_s_, step.time_s, "cloud of", "topics.clouds", notes);
    if (at && !in_clouds_) in_clouds_ = std::make_unique<sensing::RobotInClouds>(*mask_);
    try {
      PointCloud cloud = stream.cloud(*number);
      cloud.points_m = (cloud.points_m * pose->linear().transpose()).rowwise() + pose->translation().transpose();
      cloud.sigma_m = VectorX::Constant(1, stream.sigma_m);
      cloud.pose_std_m = stream.pose_std_m;
      cloud.pose_std_rad = stream.pose_std_rad;
      if (at) cloud = in_clouds_->without_robot(cloud, at->joints.names, at->joints.positions, at->T_base_root);
      if (cloud.points_m.rows() == 0) {
        notes.add(stream.name + ": the cloud holds no point outside the robot at", step.time_s, ": left out");
        continue;
      }
      step.observations.emplace_back(std::move(cloud));
    } catch (const Error& error) {
      notes.add(stream.name + ": the cloud cannot be used of", step.time_s, ": " + error.message());
    }
  }
}

std::optional<Pose> StreamViews::pose_of(const std::string& frame, double time_s) const {
  if (frame == plan_.base_frame) return Pose(Pose::Identity());
  return tree_.lookup(plan_.base_frame, frame, time_s);
}

/// The robot when an image or a cloud was taken, where it is to be left out and known; where it is not known that is said.
std::optional<StreamViews::PosedRobot> StreamViews::robot_to_mask(std::optional<bool> wanted, double time_s, double step_s, const std::string& where,
                                                                  const std::string& topics, RepeatedNotes& notes) {
  const auto& robot = plan_.recording.robot;
  if (!wanted.value_or(robot && sensing::has_shapes(*robot) && !streams_.joints.empty())) return std::nullopt;
  if (!robot) throw Error("mask_robot needs the robot: give robot.urdf or topics.robot_description", plan_.source + ": " + topics);
  if (!mask_) mask_ = std::make_unique<sensing::RobotMask>(*robot);
  const std::string root = mask_->kinematics().robot().links[std::size_t(mask_->kinematics().root_link())].name;
  const auto base = pose_of(root, time_s);
  if (!base) {
    notes.add("the robot is not masked in the " + where, step_s, ": the pose of '" + root + "' is not known");
    return std::nullopt;
  }
  const NamedJoints joints = known_joints_at(streams_, robot, time_s);
  if (const auto unmasked = unmasked_links(*mask_, joints, streams_)) {
    notes.add(unmasked->who + " not masked in the " + where, step_s, ": " + unmasked->why);
    if (unmasked->is_whole_robot) return std::nullopt;
  }
  return PosedRobot{*base, joints};
}

}  // namespace palpate::acquisition
