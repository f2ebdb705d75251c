// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/frame_tree.hpp"

#include <algorithm>

namespace palpate::acquisition {

FrameTree::FrameTree(const std::vector<FrameLink>& links, double largest_gap_s) : largest_gap_s_(largest_gap_s) {
  for (const FrameLink& link : links) {
    if (link.samples.empty() || link.parent == link.child) continue;
    above_.emplace(link.child, link);
  }
}

bool FrameTree::knows(const std::string& frame) const {
  return above_.count(frame) > 0 ||
         std::any_of(above_.begin(), above_.end(), [&](const auto& entry) { return entry.second.parent == frame; });
}

std::vector<std::string> FrameTree::way_up(const std::string& frame) const {
  std::vector<std::string> way{frame};
  for (auto link = above_.find(frame); link != above_.end(); link = above_.find(way.back())) {
    if (std::find(way.begin(), way.end(), link->second.parent) != way.end()) break;  // a loop
    way.push_back(link->second.parent);
  }
  return way;
}

bool FrameTree::connects(const std::string& a, const std::string& b) const {
  return a == b || (knows(a) && knows(b) && way_up(a).back() == way_up(b).back());
}

std::optional<Pose> FrameTree::at(const FrameLink& link, double time_s) const {
  const auto& samples = link.samples;
  if (link.is_fixed) return samples.back().T_parent_child;
  const auto after = std::lower_bound(samples.begin(), samples.end(), time_s,
                                      [](const PoseSample& sample, double time) { return sample.time_s < time; });
  if (after != samples.end() && after->time_s == time_s) return after->T_parent_child;
  constexpr double near_s = 0.05;  // an end of the series, or a side of a long gap, that is as good as there
  if (after == samples.end() || after == samples.begin()) {
    const PoseSample& end = after == samples.begin() ? samples.front() : samples.back();
    return std::abs(end.time_s - time_s) <= near_s ? std::optional(end.T_parent_child) : std::nullopt;
  }
  const PoseSample &a = *(after - 1), &b = *after;
  const double gap_s = b.time_s - a.time_s;
  if (gap_s > largest_gap_s_) {
    const PoseSample& near = time_s - a.time_s < b.time_s - time_s ? a : b;
    return std::abs(near.time_s - time_s) <= near_s ? std::optional(near.T_parent_child) : std::nullopt;
  }
  const double share = (time_s - a.time_s) / gap_s;
  Pose pose = Pose::Identity();
  pose.translation() = (1 - share) * a.T_parent_child.translation() + share * b.T_parent_child.translation();
  const Eigen::Quaterniond from(a.T_parent_child.linear()), to(b.T_parent_child.linear());
  pose.linear() = from.slerp(share, to).toRotationMatrix();
  return pose;
}

std::optional<Pose> FrameTree::lookup(const std::string& target, const std::string& source, double time_s) const {
  const std::vector<std::string> a = way_up(target), b = way_up(source);
  const auto meet_a = std::find_if(a.begin(), a.end(),
                                   [&](const std::string& one) { return std::find(b.begin(), b.end(), one) != b.end(); });
  if (meet_a == a.end()) return std::nullopt;
  const auto up = [&](const std::vector<std::string>& way) -> std::optional<Pose> {
    Pose pose = Pose::Identity();  // T_meet_way[0]
    for (const std::string& frame : way) {
      if (frame == *meet_a) return pose;
      const auto step = at(above_.at(frame), time_s);
      if (!step) return std::nullopt;
      pose = *step * pose;
    }
    return std::nullopt;
  };
  const auto T_meet_target = up(a), T_meet_source = up(b);
  if (!T_meet_target || !T_meet_source) return std::nullopt;
  if (target == *meet_a) return *T_meet_source;  // not a digit is lost
  return T_meet_target->inverse() * *T_meet_source;
}

std::vector<double> FrameTree::times_s(const std::string& target, const std::string& source) const {
  const std::vector<std::string> a = way_up(target), b = way_up(source);
  if (a.back() != b.back()) return {};
  std::vector<double> times;
  const auto add = [&](const std::vector<std::string>& way, const std::vector<std::string>& other) {
    for (const std::string& frame : way) {
      if (std::find(other.begin(), other.end(), frame) != other.end()) return;  // where they meet
      const FrameLink& link = above_.at(frame);
      if (link.is_fixed) continue;
      for (const PoseSample& sample : link.samples) times.push_back(sample.time_s);
    }
  };
  add(a, b);
  add(b, a);
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

std::vector<std::string> FrameTree::frames() const {
  std::vector<std::string> names;
  for (const auto& [child, link] : above_) {
    for (const std::string& name : {child, link.parent})
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace palpate::acquisition
