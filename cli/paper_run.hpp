// SPDX-License-Identifier: Apache-2.0
// Runs what `palpate paper` was asked for, seed by seed. What is there already is not run again, and a seed that fails is a row.
#pragma once

#include <functional>

#include "cli/paper_seeds.hpp"

namespace palpate::cli {

struct PaperPlan {
  std::vector<const lab::PaperScene*> scenes;
  std::vector<const Study*> studies;
  std::uint64_t first_seed = 1, study_seed = 1;  ///< of scenes, and of studies
  int seeds = 1, study_seeds = 1;                ///< a scene, and a study
  std::uint64_t details_of = 1;  ///< the seed of each scene that also gets pictures, samples alone, grid search and cross-checks
  bool quick = false;
  int side_by_side = 1;  ///< scenes and studies that are run at the same time
  int threads = 1;       ///< of each of them
  PlacedObject object;
};

/// The work itself, called from as many threads as run side by side; tests put other work in its place.
struct PaperWork {
  std::function<void(const lab::PaperScene&, std::uint64_t seed, const TrialOptions&, SharedModels*, TrialAnswer&)> trial;
  std::function<void(const Study&, const StudyOptions&, StudyAnswer&)> study;
  std::function<bool()> stopped;
  std::function<void(const std::string&)> say;
};

TrialOptions options_of(const PaperPlan& plan, const lab::PaperScene& scene, std::uint64_t seed);

/// The page is written anew after every seed, from all that the folder holds: a run that is stopped leaves what it has.
/// @throws Error when the folder holds a seed that was made with other options, before anything is run.
PaperRuns run_plan(const PaperPlan& plan, const PaperWork& work, const std::filesystem::path& out);

}  // namespace palpate::cli
