// SPDX-License-Identifier: Apache-2.0
// Parts of the writer of recordings that the writer of bags shares. Inner header of the room `io`.
#pragma once

#include <filesystem>
#include <string>

#include "palpate/core/recording.hpp"

namespace palpate::io {

/// The keys of recording.yaml that say what the object is, how it is held and what touched it (all but pushes and markers), as
/// text; the files that they name are written into `folder`.
std::string object_text(const Recording& recording, const std::filesystem::path& folder);

}  // namespace palpate::io
