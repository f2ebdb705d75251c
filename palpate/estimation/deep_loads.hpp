// SPDX-License-Identifier: Apache-2.0
// Loads that a patch of even pressure cannot stand for: under more than 0.4 E a solid caves in beneath one, and no tool does that to
// it. A push that goes so deep is fitted as far as the model reaches.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "palpate/estimation/fit.hpp"

namespace palpate::estimation {

/// Mean pressure over E; beyond it a Neo-Hookean solid under an even dead pressure caves in.
inline constexpr double largest_pressure = 0.4;

/// A push: how many of its steps, from the first one on.
using StepCounts = std::vector<std::size_t>;

StepCounts all_steps(const Recording& recording);
/// The steps before the first one whose mean pressure under a round tool of known force is above `over_young` times
/// `young_modulus_pa`.
StepCounts steps_within_pressure(const Recording& recording, double young_modulus_pa, double over_young = largest_pressure);

/// The first steps of each push alone.
void keep_first_steps(Recording& recording, const StepCounts& counts);
/// The same of one entry a step. @param given  the recording that they are of
template <class Entry>
std::vector<Entry> first_steps(const std::vector<Entry>& all, const Recording& given, const StepCounts& counts) {
  std::vector<Entry> kept;
  std::size_t flat = 0;
  for (std::size_t p = 0; p < given.pushes.size(); ++p)
    for (std::size_t s = 0; s < given.pushes[p].steps.size(); ++s, ++flat)
      if (s < counts[p] && flat < all.size()) kept.push_back(all[flat]);
  return kept;
}

/// Fits by `fit` the steps that press with at most 0.4 E, and says in a verdict (`deep_loads_left_out`) which others there are. E
/// is not known beforehand: a first one is read off the lighter loads by linear theory, and where the fit has another one that
/// changes which steps these are, they are fitted anew. Near the limit a surface may cave in
/// or not, and a load that does may spoil the very E by which it counts: where the deepest ones come near it, E of the lighter loads
/// alone must not be lower (Hausman's test), or they are left out as well. With a linear law, which caves in under nothing, and
/// where every load is far beyond, all steps are fitted.
/// @param fit     of the first steps of each push; called once where no load is near the limit
/// @param fitted  if given: the steps that the answer is of. Goes in as the most that are fitted (empty: all)
/// @param progress  of the fits of lighter loads alone; stopped there, the answer ends as cancelled
Identification fit_within_pressure(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                                   const FitOptions& options, const std::function<Identification(const StepCounts&)>& fit,
                                   StepCounts* fitted = nullptr, const OnProgress& progress = {});

}  // namespace palpate::estimation
