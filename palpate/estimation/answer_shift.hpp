// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/math.hpp"

namespace palpate::estimation {

/// Change of an answer.
struct AnswerShift {
  double log_young = 0, poisson = 0;
  VectorX region_log_young;  ///< of further regions
  int load_cases = 0;        ///< that were solved to find it
  VectorX region_poisson = {};  ///< of further regions with a nu of their own; empty: they share it
  AnswerShift of_region(Index region) const { return {region == 0 ? log_young : region_log_young(region - 1), poisson, {}, 0}; }
  AnswerShift times(double share) const {
    return {share * log_young, share * poisson, share * region_log_young, load_cases, share * region_poisson};
  }
  /// @param other  an empty one changes nothing; its load cases are its own
  AnswerShift plus(const AnswerShift& other) const {
    AnswerShift sum = *this;
    sum.log_young += other.log_young;
    sum.poisson += other.poisson;
    if (other.region_log_young.size() == sum.region_log_young.size()) sum.region_log_young += other.region_log_young;
    if (other.region_poisson.size() == sum.region_poisson.size()) sum.region_poisson += other.region_poisson;
    return sum;
  }
};

}  // namespace palpate::estimation
