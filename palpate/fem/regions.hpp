// SPDX-License-Identifier: Apache-2.0
// Which elements belong to which part of the object.
#pragma once

#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::fem {

/// Centre of an element's corners.
Vec3 element_centre(const TetMesh& mesh, Index element);

/// Region of every element (index into `regions`), by its centre; the rules are those of Region. `listed` is the mesh that
/// RegionSelection::elements counts in; where `mesh` is a finer one, the nearest listed centre decides.
/// @throws Error naming the region when one gets no element, an element belongs to none, or a list names elements that
///         `listed` does not have (nullptr: there is none)
std::vector<int> regions_of(const TetMesh& mesh, const std::vector<Region>& regions, const TetMesh* listed = nullptr);

}  // namespace palpate::fem
