// SPDX-License-Identifier: Apache-2.0
// What the calls of a robot in Python give, checked as a driver's is (acquisition/driver_robot.cpp), and as files are: what is wrong is
// said where it comes from, and not by a recording that nobody can read.
#pragma once

#include "palpate/acquisition/robot.hpp"

namespace palpate::python {

/// @param clock_s  of the reading before; becomes this one's  @throws Error naming call and field
void check_state(const acquisition::RobotState& state, double& clock_s);

/// The image with 0 where it holds no number: no data. @param call  that gave it  @throws Error naming call and field
DepthFrame checked_frame(DepthFrame frame, const char* call);

/// @throws Error naming the limit
void check_limits(const acquisition::RobotLimits& limits);

}  // namespace palpate::python
