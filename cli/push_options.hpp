// SPDX-License-Identifier: Apache-2.0
// How a push is made (acquisition::PushOptions) on the command line, the same in every verb that pushes.
#pragma once

#include <CLI/CLI.hpp>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"

namespace palpate::cli {

/// What everybody sets. travel_limit_m becomes 0 and stays so where nothing is said: the object's own limit.
void add_push_limits(CLI::App& app, acquisition::PushOptions& push);
/// All the rest but the force step, which a verb may plan itself.
void add_push_thresholds(CLI::App& app, acquisition::PushOptions& push);
/// force_step_n becomes 0 and stays so where nothing is said: the object's own.
void add_force_step_option(CLI::App& app, acquisition::PushOptions& push);

/// Before anything moves; what is left to the object counts as fine.
/// @throws Error naming the option that is out of range.
void check_push_options(acquisition::PushOptions push);

/// @throws Error where a tool is as wide as the way that is left for it around the object.
void must_clear(const std::vector<Tool>& tools, const acquisition::PushOptions& push);

}  // namespace palpate::cli
