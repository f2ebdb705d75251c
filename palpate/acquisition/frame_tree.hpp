// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/streams.hpp"

namespace palpate::acquisition {

/// Frames that move, joined by links that were seen now and then. Between two samples the position is interpolated linearly
/// and the rotation at constant speed.
class FrameTree {
 public:
  /// @param largest_gap_s  longest time between two samples that is bridged
  explicit FrameTree(const std::vector<FrameLink>& links, double largest_gap_s = 1.0);

  bool knows(const std::string& frame) const;
  bool has_parent(const std::string& frame) const { return above_.count(frame) > 0; }
  /// True when a way leads from one to the other, at whatever time.
  bool connects(const std::string& a, const std::string& b) const;
  /// The frame at the top of the way up; itself where it has no parent.
  std::string root_of(const std::string& frame) const { return way_up(frame).back(); }
  /// T_target_source, or nothing when they are not connected or a link was not seen near that time.
  std::optional<Pose> lookup(const std::string& target, const std::string& source, double time_s) const;
  /// Times, rising, at which a link that moves between the two was seen; empty where none is or they are not connected.
  std::vector<double> times_s(const std::string& target, const std::string& source) const;
  std::vector<std::string> frames() const;

 private:
  std::vector<std::string> way_up(const std::string& frame) const;
  std::optional<Pose> at(const FrameLink& link, double time_s) const;

  std::map<std::string, FrameLink> above_;  // by child
  double largest_gap_s_;
};

}  // namespace palpate::acquisition
