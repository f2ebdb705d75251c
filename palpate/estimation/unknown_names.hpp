// SPDX-License-Identifier: Apache-2.0
// Unknowns of two models of one recording are the same where they are called the same; where they stand may differ.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "palpate/estimation/unknowns.hpp"

namespace palpate::estimation {

/// Unknowns that share a name (two cameras in a step) are told apart by their order, which steps to come do not change.
inline std::vector<std::string> names_of(const Unknowns& unknowns) {
  std::map<std::string, int> seen;
  std::vector<std::string> names;
  for (int k = 0; k < unknowns.size(); ++k) names.push_back(unknowns[k].name + "#" + std::to_string(seen[unknowns[k].name]++));
  return names;
}

/// Where a fit ended, for a model of its own. What the fit had no unknown for stays at its prior's mean.
/// @param asked  of that model; @param fitted  of the fit, which ended at `at`
inline VectorX values_by_name(const Unknowns& asked, const Unknowns& fitted, const VectorX& at) {
  std::map<std::string, int> place;
  const std::vector<std::string> known = names_of(fitted), names = names_of(asked);
  for (std::size_t k = 0; k < known.size(); ++k) place[known[k]] = static_cast<int>(k);
  VectorX values = asked.prior_mean();
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto found = place.find(names[k]);
    if (found != place.end()) values(static_cast<Index>(k)) = at(found->second);
  }
  return values;
}

}  // namespace palpate::estimation
