// SPDX-License-Identifier: Apache-2.0
// The data of the page (and of the figures): what viewer/src/data.ts reads.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::report {

struct PayloadOptions {
  std::string title;                  ///< empty: the recording's name
  std::size_t max_bytes = 2'000'000;  ///< of meshes and clouds together, as text
  bool running = false;               ///< the work goes on: the answer is said as what is known so far
};

/// Everything the page shows, thinned and quantised to `max_bytes`; "thinned" in it says in words what was left out.
/// @param recording  may be null: the page then lacks tools, supports and hashes
nlohmann::json payload(const Identification& identification, const Recording* recording, const PayloadOptions& options);

}  // namespace palpate::report
