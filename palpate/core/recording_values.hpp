// SPDX-License-Identifier: Apache-2.0
// What no recording can hold, wherever it was made: files are refused by their readers, recordings that a program put together
// have nobody else to look.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate {

struct WrongValue {
  std::string where;  ///< "pushes[0].steps[2].loads[0].force_n"
  std::string what;   ///< and what to do
};

/// Numbers that are not finite, standard deviations that are negative, indices of nothing, directions that are not of unit length, tools
/// without a name in Recording::tools, images of another size than their camera's, times that go back: what files' readers refuse, too.
/// Of every field the first one; says nothing of what is only unlikely, nor of fields that the kind of their noun does not use.
std::vector<WrongValue> wrong_values(const Recording& recording);

/// The same of one step.
/// @param place   of the step, for messages
std::vector<WrongValue> wrong_values(const Step& step, const std::vector<Tool>& tools, const std::string& place);

/// What the nodes of a support are chosen by: its kind says it, a clamp by `select`. One that says `vertices` and lists none is held
/// where a solver takes it to be: in its box, if it has one, else along its plane.
NodeSelection selection_of(const Support& support);

/// As files' readers make it: of unit length. What is so but for rounding keeps its digits.
Vec3 unit_direction(const Vec3& direction);

/// In memory nobody need say how a view errs; a file must.
/// @param place  of the image, for the message
/// @throws Error where the noise is `constant` and its standard deviation is not given.
void demand_depth_sigma(const DepthNoise& noise, const std::string& place);

/// @throws Error for the first of them, if any.
void demand_right_values(const std::vector<WrongValue>& wrong);

/// What nothing deforms says nothing of its stiffness: a fit would hand back where it started.
/// @throws Error where no step presses and no weight acts.
void demand_loads(const Recording& recording);

}  // namespace palpate
