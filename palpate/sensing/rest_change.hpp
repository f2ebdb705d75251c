// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// Share of the pixels that two images from one place have in common (data in both, masked in neither) whose depth has
/// changed by more than five standard deviations of the noise, with all pixels within two of it: those beside an edge mix near
/// and far anew in every image. Nothing where all came back to where it was.
/// @throws Error when images, masks and cameras differ in size.
double changed_share(const DepthFrame& before, const DepthFrame& after);

}  // namespace palpate::sensing
