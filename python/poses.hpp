// SPDX-License-Identifier: Apache-2.0
// Poses as users have them: matrices of few digits, ROS's quaternions, rotation vectors of an arm's controller.
#pragma once

#include "python/convert.hpp"

namespace palpate::python {

/// 4 x 4, of a position and at most one way to say a rotation; None: not given. @throws Error naming the argument
py::object pose_of(const py::object& position_m, const py::object& quaternion_xyzw, const py::object& rotation_vector_rad, const py::object& rotation);

}  // namespace palpate::python
