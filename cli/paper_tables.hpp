// SPDX-License-Identifier: Apache-2.0
// Tables of the page of `palpate paper`, as HTML; empty where a trial has nothing for one.
#pragma once

#include <span>
#include <string>

#include "cli/paper_scores.hpp"
#include "cli/paper_studies.hpp"

namespace palpate::cli {

/// E by site, and where there are samples alone: how they spread within the sites and between them.
std::string site_table(const TrialAnswer& trial);
/// E of the samples alone: mean and spread, and what one took.
std::string sample_table(const TrialAnswer& trial, bool truth_known);
std::string unused_table(const lab::PaperScene& scene, const TrialAnswer& trial);
/// The same at the highest force of each seed, over the seeds. Empty: there was no such push, or one seed alone.
std::string foresight_table(const SceneAnswers& answers);
/// Of an apparent modulus: no errors.
std::string score_table(const SceneAnswers& answers);
/// Seeds that ended with an error, and why.
std::string failed_table(const std::vector<TrialAnswer>& trials);
std::string study_table(const StudyAnswer& answer);
/// The same over the seeds of one study. Empty: there is one alone.
std::string study_score_table(std::span<const StudyAnswer> seeds);

}  // namespace palpate::cli
