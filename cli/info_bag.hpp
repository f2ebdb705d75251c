// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "cli/session.hpp"

namespace palpate::cli {

/// `palpate info FILE.mcap`: the topics of a bag, their types, counts and rates, and which of them palpate understands.
int look_into_bag(Session& session, const std::filesystem::path& file);

}  // namespace palpate::cli
