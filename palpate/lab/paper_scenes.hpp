// SPDX-License-Identifier: Apache-2.0
// The experiments of Frank et al. (IROS 2010, section VII) remade in the lab, where the truth is known.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "palpate/core/progress.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::lab {

struct PaperTrial {
  Recording recording;
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< of the whole object
};

struct PaperScene {
  std::string_view name, title;
  std::string_view figures;     ///< of the paper
  std::string_view paper_says;  ///< what the paper reports, in a sentence
  std::string_view differs;     ///< where the lab's scene is not the paper's
  PaperTrial (*make)(std::uint64_t seed, const OnProgress& progress);
};

/// The table that --help, the page and the tests loop over.
std::span<const PaperScene> paper_scenes();

/// @throws Error listing the names when there is none of that name.
const PaperScene& paper_scene(std::string_view name);

}  // namespace palpate::lab
