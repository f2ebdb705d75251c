// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "palpate/core/recording.hpp"

namespace palpate::io {

/// Writes a recording as a bag: a folder of rosbag2 (metadata.yaml and one MCAP file, which usual viewers open) with the
/// mapping.yaml and the mesh files that make a recording of it again. What `recording_from(read_streams(...))` gives back
/// has the same object, forces, travels and images; times are shifted, so that pushes follow each other. A force's standard
/// deviation travels as two samples on both sides of the mean.
/// @throws Error when `folder` exists and is not empty, or the recording holds what no topic can say: markers, imposed
///         travel, wrench observations, several loads in a step.
void write_bag(const Recording& recording, const std::filesystem::path& folder);

}  // namespace palpate::io
