// SPDX-License-Identifier: Apache-2.0
// Both methods on what was prepared, with what each took.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "cli/paper_inputs.hpp"
#include "palpate/core/identification.hpp"
#include "palpate/estimation/paper_method.hpp"

namespace palpate::cli {

/// A clock for what takes its time.
class Watch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

struct MethodAnswer {
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< NaN: it has none
  double lower_95_pa = 0, upper_95_pa = 0;         ///< NaN: the method has none
  double poisson_lower_95 = 0, poisson_upper_95 = 0;
  int solves = 0, load_cases = 0, iterations = 0;  ///< FitSummary
  double seconds = 0;
  bool converged = false;
  std::vector<FitIteration> path;
  std::vector<std::string> verdicts;  ///< codes
  std::string failed;                 ///< the error that it ended with; empty: none
};
/// Of a method that was not asked, or found nothing.
MethodAnswer no_answer();
MethodAnswer summary(const Identification& answer, double seconds);

MethodAnswer by_paper(const Prepared& given, const estimation::FitOptions& options, estimation::FitMemory* memory,
                      const OnProgress& progress,
                      estimation::PaperDistance distance = estimation::PaperDistance::nearest_vertex);

/// What `by_palpate` found besides.
struct Found {
  Identification answer;
  estimation::StepCounts fitted;  ///< of which samples: loads too high for the model are left out (deep_loads.hpp)
  Recording slipped;              ///< all samples, with the slips that were found
};

/// @param found  if given: all that was found
MethodAnswer by_palpate(const Prepared& given, const estimation::FitOptions& options, estimation::FitMemory* memory,
                        const OnProgress& progress, Found* found = nullptr);
/// With another law, of samples in which a first one found slips already. A slip that this fit does not find by itself (of two samples
/// it hardly can) it is told, and both fits are counted.
/// @param slipped  the same pushes, with the slips that the first law found
MethodAnswer by_palpate_told_of_slips(const Prepared& given, const Recording& slipped, const estimation::FitOptions& options,
                                      estimation::FitMemory* memory, const OnProgress& progress);
/// Of an object that was seen from one side, as `identify` does it: where a planar back side agrees better with the pushes
/// than the one that was fitted, it takes its place, and the answer is of that one. What both fits took is counted.
/// @param given  of `seen` and `choice`; both are changed to what was fitted at last
MethodAnswer by_palpate_on_better_shape(const Observed& seen, ModelChoice& choice, Prepared& given, const estimation::FitOptions& options,
                                        estimation::FitMemory* memory, const OnProgress& progress, Found* found = nullptr);

}  // namespace palpate::cli
