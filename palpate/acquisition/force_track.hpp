// SPDX-License-Identifier: Apache-2.0
// The parts of recording_from: sensors brought into the base frame and onto one clock. Inner header of the room.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/acquisition/clock_offset.hpp"
#include "palpate/acquisition/find_pushes.hpp"
#include "palpate/acquisition/frame_tree.hpp"
#include "palpate/core/streams.hpp"

namespace palpate::acquisition {

/// The tree of the streams' transforms; frames that only the robot description knows are added from the joints.
/// @throws Error naming a frame that is not connected to the base.
FrameTree tree_of(const StreamPlan& plan, const SensorStreams& streams);

/// Force on the object in the base frame, with the tip, wherever both are known; not tared.
/// @param wrench_offset_s  added to the force's times
/// @throws Error when there is no sample.
Track track_of(const StreamPlan& plan, const SensorStreams& streams, const FrameTree& tree, double wrench_offset_s);

/// Offset of the force's clock against the arm's, from how force follows travel while the tool is in contact.
ClockOffset wrench_offset(const StreamPlan& plan, const SensorStreams& streams, const FrameTree& tree);

/// Offset of a camera's clock against the arm's, from how its picture changes while the tip moves.
ClockOffset camera_offset(const StreamPlan& plan, const FrameTree& tree, const DepthStream& camera);

}  // namespace palpate::acquisition
