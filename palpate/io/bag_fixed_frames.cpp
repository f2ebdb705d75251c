// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_fixed_frames.hpp"

#include <algorithm>
#include <map>
#include <set>

#include "palpate/core/error.hpp"
#include "palpate/io/yaml_field.hpp"

namespace palpate::io {
namespace {

using Parents = std::map<std::string, std::string>;  // by child

/// The frame and all that it hangs on; a loop is gone round once.
std::vector<std::string> way_up(const Parents& parents, const std::string& frame) {
  std::vector<std::string> way{frame};
  for (auto above = parents.find(frame); above != parents.end(); above = parents.find(way.back())) {
    if (std::find(way.begin(), way.end(), above->second) != way.end()) break;
    way.push_back(above->second);
  }
  return way;
}

}  // namespace

void add_fixed_frames(const BagMapping& mapping, SensorStreams& streams) {
  if (mapping.fixed_frames.empty()) return;
  Parents said;  // by the bag and the robot's description
  std::set<std::string> known{mapping.plan.base_frame};
  for (const FrameLink& link : streams.frames) {
    said.emplace(link.child, link.parent);
    known.insert({link.child, link.parent});
  }
  if (mapping.plan.recording.robot) {
    for (const RobotLink& link : mapping.plan.recording.robot->links) known.insert(link.name);
    for (const RobotJoint& joint : mapping.plan.recording.robot->joints) said.emplace(joint.child, joint.parent);
  }
  Parents all;
  for (const FixedFrame& frame : mapping.fixed_frames) {
    known.insert(frame.child);
    all.emplace(frame.child, frame.parent);
  }
  all.insert(said.begin(), said.end());

  const std::vector<std::string> names(known.begin(), known.end());
  for (const FixedFrame& frame : mapping.fixed_frames) {
    if (!known.contains(frame.parent)) {
      const auto meant = nearest_word(frame.parent, names);
      std::string list;
      for (const std::string& one : names) list += (list.empty() ? "" : ", ") + one;
      throw Error("no frame is called '" + frame.parent + "'" + (meant ? "; did you mean '" + *meant + "'?" : ".") + " Known are " + list,
                  frame.parent_where);
    }
    const std::vector<std::string> above = way_up(all, frame.parent);
    if (std::find(above.begin(), above.end(), frame.child) != above.end())
      throw Error("'" + frame.parent + "' hangs on '" + frame.child + "' itself: give the inverse, with '" + frame.child +
                      "' as the parent",
                  frame.where);
    const auto before = said.find(frame.child);
    if (before == said.end()) continue;
    const std::string& base = mapping.plan.base_frame;
    if (way_up(said, frame.child).back() == way_up(said, base).back() && above.back() != way_up(all, base).back())
      throw Error("would tear '" + frame.child + "' off '" + before->second + "' and with it off the base frame: '" + frame.parent +
                      "' is not connected to that. Give the inverse, with '" + frame.child + "' as the parent",
                  frame.where);
    const bool by_transforms =
        std::any_of(streams.frames.begin(), streams.frames.end(), [&](const FrameLink& link) { return link.child == frame.child; });
    streams.warnings.push_back("the frame '" + frame.child + "' stands on '" + frame.parent + "' as frames.fixed says, not on '" + before->second +
                               "' as the " + (by_transforms ? "bag's transforms say" : "robot's description says"));
  }
  for (const FixedFrame& frame : mapping.fixed_frames) {
    std::erase_if(streams.frames, [&](const FrameLink& link) { return link.child == frame.child; });
    streams.frames.push_back({frame.parent, frame.child, true, {{0, frame.T_parent_child}}});
  }
}

}  // namespace palpate::io
