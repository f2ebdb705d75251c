// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "cli/session.hpp"

namespace palpate::cli {

/// The topics of a bag with types, counts, rates and durations, what they are good for, and what a recording would still
/// need. What the mapping leaves alone; without one, a mapping to start from.
/// @param mapping  its file; empty = there is none
/// @throws Error when the bag holds no message
nlohmann::json look_into_bag(Session& session, const std::filesystem::path& path, const std::filesystem::path& mapping);

}  // namespace palpate::cli
