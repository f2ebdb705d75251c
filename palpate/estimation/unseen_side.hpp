// SPDX-License-Identifier: Apache-2.0
// Parts of the object that no view of it at rest showed.
#pragma once

#include <optional>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/estimation/fit.hpp"

namespace palpate::estimation {

/// Share of a surface's area that was not seen, without what stands on the plane.
/// @param seen  a vertex: 1 where a view showed it
double unseen_share(const TriMesh& surface, const std::vector<char>& seen, const std::optional<Plane>& plane);

/// Takes out the rays that show what no view of the object at rest showed: a guess is nothing to compare with. Neither is the rim
/// between the two.
void drop_unseen(const TriMesh& surface, const std::vector<char>& seen, const std::optional<Plane>& plane, Inputs& inputs);

}  // namespace palpate::estimation
