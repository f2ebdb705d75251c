// SPDX-License-Identifier: Apache-2.0
// The same object on finer meshes: one that shows what the mesh does to the answer, and one that is fine enough for it.
#pragma once

#include <optional>

#include "palpate/core/recording.hpp"
#include "palpate/estimation/forward_model.hpp"

namespace palpate::estimation {

/// The same object on a finer mesh; supports and tools name its nodes.
struct FinerModel {
  Recording recording;
  SimulatedObject object;
};

/// Halves every edge where the mesh has up to 5000 tetrahedra and supports and tools are found by their place; else those
/// under round tools (within the radius, growing away from it), where most of the error is made.
/// @param recording  with rest.volume as the fit uses it: linear tetrahedra, of which `object` has the quadratic ones
/// @returns nothing where the volume is not linear, or there is neither
std::optional<FinerModel> finer_model(const Recording& recording, const SimulatedObject& object);

/// A mesh for a fit whose own error in E was too large: under every round tool as fine as fem::discretise asks for at this
/// tolerance. Where all of them were fine enough already, the error is made elsewhere: then every edge is halved, as
/// finer_model does.
/// @returns nothing where no finer mesh can be had within 4000 corners
std::optional<FinerModel> refined_within(const Recording& recording, const SimulatedObject& object, double tolerance);

}  // namespace palpate::estimation
