// SPDX-License-Identifier: Apache-2.0
// Both methods on what was prepared, with what each took.
#pragma once

#include <string>
#include <vector>

#include "cli/paper_inputs.hpp"
#include "palpate/core/identification.hpp"

namespace palpate::cli {

struct MethodAnswer {
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< NaN: it has none
  double lower_95_pa = 0, upper_95_pa = 0;         ///< NaN: the method has none
  double poisson_lower_95 = 0, poisson_upper_95 = 0;
  int solves = 0, load_cases = 0, iterations = 0;  ///< FitSummary
  double seconds = 0;
  bool converged = false;
  std::vector<FitIteration> path;
  std::vector<std::string> verdicts;  ///< codes
};
/// Of a method that was not asked, or found nothing.
MethodAnswer no_answer();
MethodAnswer summary(const Identification& answer, double seconds);

MethodAnswer by_paper(const Prepared& given, const estimation::FitOptions& options, estimation::FitMemory* memory,
                      const OnProgress& progress);
/// @param whole  if given: all that was found
MethodAnswer by_palpate(const Prepared& given, const estimation::FitOptions& options, estimation::FitMemory* memory,
                        const OnProgress& progress, Identification* whole = nullptr);

}  // namespace palpate::cli
