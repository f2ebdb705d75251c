// SPDX-License-Identifier: Apache-2.0
// A recording that goes on must go on with the same thing: pushes of a ball do not belong to a plate.
#pragma once

#include <filesystem>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::cli {

/// @param now  what stands before the robot, without pushes
/// @param by_views  the shape is built from views of the untouched object: it is that of `there`, and not compared
/// @throws Error that names the first thing which is not as it was recorded (object, shape, supports, tools, robot, law)
void must_be_same_scene(const Recording& there, const Recording& now, bool by_views, const std::filesystem::path& folder);

/// @throws Error where the push of this name was recorded elsewhere, along another direction or with another tool
void must_be_same_push(const Push& recorded, const acquisition::PushPlan& plan, const acquisition::PushOptions& protocol,
                       const std::filesystem::path& folder);

/// When a robot's clock may go on after these pushes, s; 0 where there are none.
double not_before_s(const std::vector<Push>& pushes);

}  // namespace palpate::cli
