// SPDX-License-Identifier: Apache-2.0
// Loaded steps are left out, the rest is fitted, and they are predicted: the number that users understand.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/partial_fit.hpp"

namespace palpate::estimation {

/// Of all loads of a step together, N or m of imposed travel; compares within a push.
double load_of(const Step& step);

/// What is left out, one set of steps after the other. Each holds loaded steps that saw something, and so does what it leaves.
struct LeftOut {
  std::string what;
  std::vector<StepFlags> sets;
  std::vector<std::size_t> push;  ///< of each set
  bool whole_pushes = false;
};

/// @param most  pushes that are left out in turn
LeftOut whole_pushes(const PartialFits& fits, const std::vector<StepFlags>& pushes, std::size_t most);

/// The highest load of each push, with what nearly repeats it: its twin on the way back would tell it. What is left is lower, so
/// that it must be extrapolated to.
LeftOut highest_loads(const PartialFits& fits, const std::vector<StepFlags>& pushes, std::size_t most);

/// @param pushes   E of each push alone, where that is known
/// @param learned  if given: what each set was predicted from
HeldOut hold_out(PartialFits& fits, const LeftOut& left_out, const std::vector<PartialYoung>& pushes, std::vector<Optimum>* learned = nullptr);

}  // namespace palpate::estimation
