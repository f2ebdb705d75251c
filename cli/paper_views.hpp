// SPDX-License-Identifier: Apache-2.0
// Fig. 1, 2, 7 and 10 of the paper: what the camera saw of a push, the model of the object, and the same view of the model as it is
// simulated with the answer.
#pragma once

#include "cli/paper_inputs.hpp"
#include "cli/paper_trial.hpp"

namespace palpate::cli {

/// @param seen       the recording as it was taken: images in full
/// @param given      the model
/// @param by_region  E of the regions, the first one's too; empty = one E
/// Nothing where no loaded step has a depth image, or the answer has no equilibrium.
std::vector<PaperView> views_of(const Recording& seen, const Prepared& given, const MethodAnswer& answer, const std::vector<double>& by_region,
                                const estimation::FitOptions& options);

/// Fig. 2 (b to d), of an object whose shape several views gave: one view's cloud, all of them, and what was made of them.
/// @param given  the model
std::vector<PaperView> views_of_model(const Recording& seen, const Prepared& given);

}  // namespace palpate::cli
