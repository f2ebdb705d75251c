// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <vector>

#include "palpate/estimation/fit.hpp"

namespace palpate::cli {

/// Answers for one step of a recording by solving it at an answer: travel of the tool and surface.
class Expected {
 public:
  Expected(const Recording& recording, const estimation::SimulatedObject& object, const estimation::FitOptions& options,
           estimation::FitMemory& memory)
      : model_(recording, object, unknowns_, estimation::statics_options(recording, object, options), memory.model) {
    memory.model = model_.solved();
  }
  /// @param by_region  E of the regions, the first one's too; empty = one E
  estimation::StepPrediction operator()(std::size_t step, double young_pa, double nu, const std::vector<double>& by_region = {}) {
    VectorX at = unknowns_.prior_mean();
    at(estimation::log_young) = std::log(by_region.empty() ? young_pa : by_region.front());
    at(estimation::poisson) = nu;
    for (std::size_t r = 1; r < by_region.size(); ++r)
      at(estimation::first_ratio + static_cast<int>(r) - 1) = std::log(by_region[r] / by_region.front());
    return model_.predict(step, at);  // with derivatives: travel comes with them
  }

 private:
  estimation::Unknowns unknowns_;
  estimation::ForwardModel model_;
};

}  // namespace palpate::cli
