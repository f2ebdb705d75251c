// SPDX-License-Identifier: Apache-2.0
// Parts of the names of unknowns, by which they are told apart. They follow from who acts in a push, never from what is stated as exactly known: in every copy
// of a recording an unknown has the same name, however many others there are beside it.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::estimation {

/// In the order in which a push's loads name them; one without a name where there is no load.
std::vector<std::string> tools_of(const Push& push);

/// Of what a sensor of a tool errs by all along a push: "[PUSH]" of the tool that its loads name first, "[PUSH, TOOL]" of a further one.
std::string of_push(const Push& push, const std::string& tool);

/// The same of what holds from a slip on, or up to it: "[PUSH, slipped]" in place of "[PUSH]" (stretch_of).
std::string of_stretch(const Push& push, std::size_t step, const std::string& tool);

/// Of a load's contact, which is a tool's and a place's: of the first place that the tool touches as of_stretch has it, of a further one
/// "[PUSH, TOOL 2]".
std::string of_contact(const Push& push, std::size_t step, const Load& load);

/// Of what is a single load's: "[PUSH:STEP]" of the step's first one, "[PUSH:STEP, TOOL]" of a further one.
std::string of_load(const Push& push, std::size_t step, std::size_t load);

/// Of what a camera (RayObservation::camera) errs by all along a push: "[PUSH]" of the recording's first one, "[PUSH, camera 3]" of another
/// one. Images without a camera's name are one camera's, but for further ones of the same step: "[PUSH, frame2]".
/// @param before  how many clouds and images the step has before it
std::string of_camera(const Push& push, const std::string& camera, int before);

/// "frame", "frame2", ...: how the names of the poses of a step's clouds and depth images begin.
/// @param before  how many of them the step has before it
std::string of_frame(int before);

}  // namespace palpate::estimation
