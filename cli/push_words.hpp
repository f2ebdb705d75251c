// SPDX-License-Identifier: Apache-2.0
// Planned pushes and their promises in words and JSON, for `suggest` and `explore`.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/suggest.hpp"

namespace palpate::cli {

/// Half of a 95 % interval: "4.1 %" of E from a standard deviation of log E, "-" where nothing is known.
std::string percent_95(double log_std);
/// "0.024"
std::string plain_95(double std);

/// Why a push ended. Where the robot would not move, which push that was and what to try.
std::string stop_words(const acquisition::PushPlan& plan, const acquisition::PushReport& report, double start_distance_m);

/// What went wrong with a push that was made: its force drifted or crept, the object did not come back.
std::vector<std::string> push_warnings(const std::string& name, const acquisition::PushReport& report);

/// Standard deviations and half widths of 95 %; null where nothing is known.
nlohmann::json spread_json(const estimation::ExpectedSpread& spread);

}  // namespace palpate::cli
