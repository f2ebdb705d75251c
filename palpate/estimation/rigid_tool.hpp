// SPDX-License-Identifier: Apache-2.0
// Tools of a recording as rigid bodies that touch the object.
#pragma once

#include "palpate/core/recording.hpp"
#include "palpate/fem/contact_statics.hpp"

namespace palpate::estimation {

/// Tools of a recording that touch as rigid bodies: their motion is imposed, and it is not that of nodes.
bool touches_rigidly(const Tool& tool);

/// Along which a tool's imposed motion goes: a platen's normal, else the load's direction.
Vec3 push_direction(const Tool& tool, const Load& load);

/// The tool where it just touches the object at rest: a platen at its plane, any other tool with its tip on the line of the
/// push through touched_m, as far along as nothing of it is inside the object (to a thousandth of its size). `bonded`:
/// what touches does not slide.
/// @throws Error for chosen vertices, a shape without its size, or a tool that misses the object
fem::RigidContact rigid_tool(const TetMesh& mesh, const Tool& tool, const Load& load);

/// How the place where the tool just touches moves as the contact moves along a tangent of the push, to first order: aside by as much, and
/// along the push as the surface rises or falls.
Vec3 way_along_surface(const TetMesh& mesh, const Tool& tool, const Load& load, const Vec3& tangent);

}  // namespace palpate::estimation
