// SPDX-License-Identifier: Apache-2.0
// What a recording states of its sensors: cameras, clouds, markers, and how well everything is known. An interval is as honest
// as these numbers, and one that was forgotten counts as exact.
#pragma once

#include <nlohmann/json.hpp>

#include "cli/verbs.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::cli {

/// `cameras`, `clouds`, `markers`, `regions` and `stated`: each standard deviation as [least, greatest] of the recording; one that
/// nothing has is not among them.
nlohmann::json stated_of(const Recording& recording);

void tell_stated(Session& session, const nlohmann::json& stated);

}  // namespace palpate::cli
