// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_frames.hpp"

#include <algorithm>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/core/joint_motion.hpp"
#include "palpate/io/yaml_text.hpp"

namespace palpate::io {
namespace {

void put(const std::string& topic, std::int64_t stamp_ns, const std::vector<RosTransform>& transforms, BagFolder& bag) {
  if (!transforms.empty()) bag.put(topic, "tf2_msgs/msg/TFMessage", stamp_ns, encode(transforms));
}

}  // namespace

FramesSaid frames_said(const MessageSource& bag) {
  FramesSaid said;
  for (const Message& message : bag.messages) {
    const MessageTopic& topic = bag.topics[message.topic];
    const std::string where = bag.name + ": " + topic.name;
    if (topic.type == "sensor_msgs/msg/CameraInfo") {
      const RosHeader header = decode_header(message.data, where, topic.encoding);
      said.images[header.frame].push_back(header.stamp_ns);
    }
    if (topic.type != "tf2_msgs/msg/TFMessage") continue;
    for (RosTransform& one : decode_transforms(message.data, where, topic.encoding)) {
      if (topic.name == "/tf_static")
        said.fixed.push_back(std::move(one));
      else
        said.parents[one.child] = one.header.frame;
    }
  }
  return said;
}

BagFrames::BagFrames(const std::optional<RobotModel>& robot, const std::vector<std::string>& joint_names) {
  std::map<std::string, std::size_t> depth;  // links by how far from the root
  if (robot) {
    for (const RobotLink& link : robot->links) links_.push_back(link.name);
    const auto number = [&](const std::string& link) {
      return std::size_t(std::find(links_.begin(), links_.end(), link) - links_.begin());
    };
    const auto hangs = [&](const std::string& link) {
      return std::any_of(robot->joints.begin(), robot->joints.end(), [&](const RobotJoint& one) { return one.child == link; });
    };
    const auto root = std::find_if_not(links_.begin(), links_.end(), hangs);
    if (root != links_.end()) base_ = *root, depth[base_] = 0;
    bool all_told = !joint_names.empty();  // and every joint ends at a link
    for (bool more = true; more;) {
      more = false;
      for (const RobotJoint& one : robot->joints) {
        if (!depth.contains(one.parent) || depth.contains(one.child)) continue;
        more = true;
        depth[one.child] = depth[one.parent] + 1;
        parents_[one.child] = number(one.parent);
        Joint joint{one, number(one.parent), number(one.child), {}};
        all_told = all_told && joint.child < links_.size();
        if (one.kind != RobotJoint::Kind::fixed) {
          joint.about.axis.normalize();
          const auto place = std::find(joint_names.begin(), joint_names.end(), one.mimic.empty() ? one.name : one.mimic);
          all_told = all_told && place != joint_names.end();
          joint.position = std::size_t(place - joint_names.begin());
        }
        joints_.push_back(joint);
      }
    }
    if (!all_told || depth.size() != links_.size()) joints_.clear();
  }
  tip_ = name_for("tip", "tool_");
  if (!places_links()) return;
  // Where the robot knows no tip of its own it hangs on the last link that carries something else than the camera.
  std::size_t deepest = 0;
  for (std::size_t i = 0; i < links_.size(); ++i)
    if (links_[i] != camera(0) && depth.at(links_[i]) >= deepest) deepest = depth.at(links_[i]), tip_parent_ = i;
  if (const auto link = parents_.find(tip_); link != parents_.end()) tip_parent_ = link->second;
}

bool BagFrames::is_leaf(std::size_t link) const {
  return std::none_of(joints_.begin(), joints_.end(), [&](const Joint& one) { return one.parent == link; });
}

/// A link that ends there is what its name says; any other one of that name is something else.
std::string BagFrames::name_for(std::string wanted, const std::string& prefix) const {
  for (;; wanted = prefix + wanted) {
    const auto link = std::find(links_.begin(), links_.end(), wanted);
    if (link == links_.end() && wanted != base_) return wanted;
    if (places_links() && wanted != base_ && is_leaf(std::size_t(link - links_.begin()))) return wanted;
  }
}

std::string BagFrames::camera(std::size_t number) const {
  return name_for(number == 0 ? "camera" : "camera_" + std::to_string(number + 1), "depth_");
}

std::string BagFrames::mapping_text() const {
  const auto word = [](const std::string& name) { return name == "base" || name == "tip" ? name : yaml_word(name); };
  return "frames: {base: " + word(base_) + ", tip: " + word(tip_) + "}\n";
}

std::string BagFrames::parent_of(const std::string& frame) const {
  if (!places_links()) return base_;
  if (frame == tip_) return links_[tip_parent_];
  const auto link = parents_.find(frame);
  return link == parents_.end() ? base_ : links_[link->second];
}

void BagFrames::go_on(const FramesSaid& said) {
  for (const auto& [child, parent] : said.parents) {
    if (parent != parent_of(child))
      throw Error("was begun by another version of this program: '" + child + "' hangs on '" + parent + "' there, on '" +
                      parent_of(child) + "' here; choose another folder",
                  "--raw-bag");
    cameras_[child].moves = true;
  }
  for (const RosTransform& one : said.fixed) {
    const auto images = said.images.find(one.child);
    cameras_[one.child] = {one.T_parent_child, images == said.images.end() ? std::vector<std::int64_t>() : images->second, false};
  }
}

void BagFrames::robot_at(std::int64_t stamp_ns, const std::vector<double>& joints_rad, const std::optional<Pose>& T_base_tip,
                         BagFolder& bag) {
  if (!told_ns_.insert(stamp_ns).second) return;
  if (places_links() && !joints_rad.empty()) {
    T_base_link_.assign(links_.size(), Pose::Identity());
    robot_.clear();
    for (const Joint& joint : joints_) {
      const RobotJoint& about = joint.about;
      Pose T_parent_child = about.T_parent_joint;
      if (joint.position) {
        const double told = joints_rad.at(*joint.position);
        T_parent_child = T_parent_child * joint_motion(about, about.mimic.empty() ? told : about.mimic_multiplier * told + about.mimic_offset);
      }
      T_base_link_[joint.child] = T_base_link_[joint.parent] * T_parent_child;
      if (about.child != tip_) robot_.push_back({{0, about.parent}, about.child, T_parent_child});
    }
  }
  std::erase_if(robot_, [&](const RosTransform& one) { return one.child == tip_; });
  if (T_base_tip && !places_links()) robot_.push_back({{0, base_}, tip_, *T_base_tip});
  if (T_base_tip && !T_base_link_.empty())
    robot_.push_back({{0, links_[tip_parent_]}, tip_, T_base_link_[tip_parent_].inverse() * *T_base_tip});
  put_robot(stamp_ns, bag);
}

void BagFrames::put_robot(std::int64_t stamp_ns, BagFolder& bag) {
  for (const RosTransform& one : robot_) add(stamp_ns, one, bag);
}

void BagFrames::camera_at(std::int64_t stamp_ns, const std::string& frame, const Pose& T_base_camera, BagFolder& bag) {
  if (places_links() && parents_.contains(frame)) {
    // The way to it leads over links, whose place is known at this stamp, too: the arm stands when an image is taken.
    if (T_base_link_.empty()) return;
    const std::size_t parent = parents_.at(frame);
    if (told_ns_.insert(stamp_ns).second) put_robot(stamp_ns, bag);
    if (stamp_ns == waiting_ns_) add(stamp_ns, {{0, links_[parent]}, frame, T_base_link_[parent].inverse() * T_base_camera}, bag);
    return;
  }
  Seen& seen = cameras_[frame];
  if (seen.stands) return;
  if (!seen.moves && (seen.stamps_ns.empty() || seen.T_base_camera.matrix() == T_base_camera.matrix())) {
    seen.T_base_camera = T_base_camera;
    seen.stamps_ns.push_back(stamp_ns);
    return;
  }
  if (!seen.moves) {
    if (waiting_ns_ != stamp_ns) close_stamp(bag);
    for (const std::int64_t before_ns : seen.stamps_ns) held_[before_ns].push_back({{before_ns, base_}, frame, seen.T_base_camera});
    for (const auto& [before_ns, transforms] : held_) put("/tf", before_ns, transforms, bag);
    held_.clear();
    seen.stamps_ns.clear();
    seen.moves = true;
  }
  add(stamp_ns, {{0, base_}, frame, T_base_camera}, bag);
}

void BagFrames::camera_stands(const std::string& frame, const Pose& T_base_camera) {
  cameras_[frame].stands = true;
  cameras_[frame].T_base_camera = T_base_camera;
}

void BagFrames::close_stamp(BagFolder& bag) {
  if (waiting_.empty()) return;
  const bool is_seen = std::any_of(cameras_.begin(), cameras_.end(), [&](const auto& one) {
    return !one.second.stamps_ns.empty() && one.second.stamps_ns.back() == waiting_ns_;
  });
  if (is_seen)
    held_[waiting_ns_] = std::move(waiting_);
  else
    put("/tf", waiting_ns_, waiting_, bag);
  waiting_.clear();
}

void BagFrames::add(std::int64_t stamp_ns, RosTransform transform, BagFolder& bag) {
  if (stamp_ns != waiting_ns_) {
    close_stamp(bag);
    waiting_ns_ = stamp_ns;
  }
  transform.header.stamp_ns = stamp_ns;
  const auto same = std::find_if(waiting_.begin(), waiting_.end(), [&](const RosTransform& one) { return one.child == transform.child; });
  if (same == waiting_.end())
    waiting_.push_back(std::move(transform));
  else
    *same = std::move(transform);
}

void BagFrames::put_rest(BagFolder& bag) const {
  for (const auto& [stamp_ns, transforms] : held_) put("/tf", stamp_ns, transforms, bag);
  put("/tf", waiting_ns_, waiting_, bag);
  std::vector<RosTransform> standing;
  for (const auto& [frame, seen] : cameras_)
    if (!seen.moves) standing.push_back({{bag.first_ns(), base_}, frame, seen.T_base_camera});
  put("/tf_static", bag.first_ns(), standing, bag);
}

}  // namespace palpate::io
