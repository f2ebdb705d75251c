// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/recording.hpp"

namespace palpate {

/// What can be, but seldom is meant, as warnings of the recording: odd numbers, a robot's part that cannot be masked, a noise model of
/// another distance.
void warn_of_oddities(Recording& recording);

}  // namespace palpate
