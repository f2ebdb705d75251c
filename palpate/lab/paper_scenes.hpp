// SPDX-License-Identifier: Apache-2.0
// The experiments of Frank et al. (IROS 2010, section VII) remade in the lab, where the truth is known.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "palpate/core/progress.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::lab {

struct PaperTrial {
  Recording recording;
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< of the whole object; of one with regions: of its first site's
  std::vector<double> site_young_pa;               ///< where each push acts
  Push unused;                                     ///< a push at a place that is not in the recording
  std::vector<double> unused_force_n;              ///< what truly acted, a step
};

/// A row of the table: what stands in the lab and what looks at it.
struct PaperScene {
  std::string_view name, title;
  std::string_view figures;     ///< of the paper
  std::string_view paper_says;  ///< what the paper reports, in a sentence
  std::string_view differs;     ///< where the lab's scene is not the paper's
  std::string_view object, depth_sensor, force_sensor;
  double young_modulus_pa, poisson_ratio;  ///< 0: drawn from the seed
  double region_ratio;                     ///< 1: one stiffness everywhere
  int sites;                               ///< of the object that are pushed; 0 = all
  int views;                               ///< images that its shape is known from; 0 = it is given
  std::array<double, 3> unused_aim_m, unused_direction;  ///< of the push that is predicted, from the object's foot
};

/// Makes one seed of it. Stopped by its progress, the recording holds the pushes so far.
PaperTrial make_paper_trial(const PaperScene& scene, std::uint64_t seed, const OnProgress& progress = {});

/// The table that --help, the page and the tests loop over.
std::span<const PaperScene> paper_scenes();

/// @throws Error listing the names when there is none of that name.
const PaperScene& paper_scene(std::string_view name);

}  // namespace palpate::lab
