// SPDX-License-Identifier: Apache-2.0
// What the answers of `palpate paper` expect of a place that nobody pushed, and what they look like on the seen points.
#pragma once

#include "cli/paper_inputs.hpp"
#include "cli/paper_trial.hpp"

namespace palpate::cli {

/// The unused push, by all answers.
/// @param other      with the other law; nullptr: none was fitted
/// @param by_region  ours' E of every region, empty = one E
void predict_unused(const Prepared& given, const Prepared* other, const lab::PaperTrial& trial, const std::vector<double>& by_region,
                    const estimation::FitOptions& options, SharedModels& shared, TrialAnswer& out);

/// Fig. 3: what registration makes of the hardest step at 3, 2, 1.3 and 1 times an E.
void add_pictures(const Prepared& given, double young_modulus_pa, double poisson_ratio, const estimation::FitOptions& options, TrialAnswer& out);

}  // namespace palpate::cli
