// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "palpate/core/lens_scatter.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::sensing {

/// The picture's mean light as its depths say (masked ones too: arm and table shine), and the prior of the share that the
/// lens spreads. Nothing where the frame's noise knows of no such share.
/// @throws Error as back_project does.
std::optional<LensScatter> lens_scatter(const DepthFrame& frame);

}  // namespace palpate::sensing
