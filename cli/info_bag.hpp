// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "cli/session.hpp"

namespace palpate::cli {

/// The topics of a bag with types, counts, rates and durations, what they are good for, and what a recording would still
/// need; with `suggest`, a mapping to start from.
nlohmann::json look_into_bag(Session& session, const std::filesystem::path& path, bool suggest);

}  // namespace palpate::cli
