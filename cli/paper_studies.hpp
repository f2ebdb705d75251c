// SPDX-License-Identifier: Apache-2.0
// Questions that take several fits of one scene: what the paper could not know, and whether a partial model suffices.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cli/paper_trial.hpp"

namespace palpate::cli {

struct StudyRow {
  std::string what;
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< the truth
  MethodAnswer paper, palpate;                     ///< NaN: not asked
  std::vector<PaperView> views = {};               ///< of a model that several views gave; only where asked for
};

struct StudyOptions {
  std::uint64_t seed = 1;
  int threads = 1;
  bool pictures = false;
  bool coarse = false;  ///< a look in minutes (ModelChoice)
};

struct Study {
  std::string_view name, title, about;
  std::vector<StudyRow> (*run)(const StudyOptions&, const OnProgress&);
};

struct StudyAnswer {
  const Study* study = nullptr;
  std::uint64_t seed = 0;
  std::vector<StudyRow> rows;
  std::string failed;  ///< the error that it ended with; empty: none
  double seconds = 0;
};

/// The table that --help, the page and the tests loop over.
std::span<const Study> studies();
/// nullptr: there is none of that name.
const Study* study_of(std::string_view name);

}  // namespace palpate::cli
