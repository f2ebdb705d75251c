// SPDX-License-Identifier: Apache-2.0
// A fit whose mesh is fine enough for its answer.
#pragma once

#include <optional>

#include "palpate/estimation/finer_model.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/shape_error.hpp"

namespace palpate::estimation {

/// Fits, and with `refine: auto` once more on a finer mesh as long as what the mesh does to E is estimated to be more than
/// `mesh_tolerance` (a share of E) and more than a third of all else that is not known of E (both times 0.35 where the body is not
/// linear, of which the estimate has said less than half): the mesh that showed the error, where most
/// of it is made elsewhere than under the tools, else what refined_within finds. Leaves recording and object as
/// they were fitted last; the answer's provenance says which meshes were taken.
/// @param doubt  other shapes of a side that nobody saw; nullptr: none
/// @param fill_anew  finer_model.hpp
/// @param last_finer  filled with what says of the last mesh what it does, for further fits on it; nullptr: not wanted
Identification fit_on_fine_mesh(Recording& recording, SimulatedObject& object, const Inputs& observed,
                                const FitOptions& options, double mesh_tolerance, ShapeDoubt* doubt,
                                const OnProgress& progress, const FillAnew& fill_anew = {},
                                std::optional<FinerModel>* last_finer = nullptr);

}  // namespace palpate::estimation
