// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/io/bag_mapping.hpp"

namespace palpate::io {

/// Puts the frames that the mapping fixes (`frames.fixed`) into the streams' tree. What the transforms say of the same child
/// is taken out, with a warning: a calibration of one's own is better than a drawing's numbers.
/// @param streams  with all that the bag's transforms say
/// @throws Error naming the mapping's line when a parent is no frame that anything knows, or hangs on its own child, or a
///         frame would be torn off the base frame (a pose that was given the wrong way round).
void add_fixed_frames(const BagMapping& mapping, SensorStreams& streams);

}  // namespace palpate::io
