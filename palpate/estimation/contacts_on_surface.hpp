// SPDX-License-Identifier: Apache-2.0
// A force's contact point that is stated beside the surface.
#pragma once

#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::estimation {

/// A round patch is what of the surface lies within its radius of the contact point: of one that is stated half a radius off the
/// surface a quarter of the area is missing. Contacts of forces under round tools that are off by more than a tenth of the radius
/// (a hundredth of the area) are moved to the nearest place on the surface.
/// @throws Error naming step and distance where one lies further away than the tool is wide: there is no patch
void put_contacts_on_surface(Recording& recording, const TetMesh& mesh);

/// Says of every push whose contact was moved by more than a quarter of the tool's radius how far off it was stated.
std::vector<Verdict> contacts_off_surface(const Recording& stated, const Recording& moved);

}  // namespace palpate::estimation
