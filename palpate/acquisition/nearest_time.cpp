// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/nearest_time.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::acquisition {

std::optional<std::size_t> nearest_time(const std::vector<double>& times_s, double offset_s, double time_s, double gap_s, std::set<std::size_t>& used) {
  const auto after = std::lower_bound(times_s.begin(), times_s.end(), time_s - offset_s);
  std::optional<std::size_t> best;
  for (const auto one : {after, after == times_s.begin() ? after : after - 1}) {
    if (one == times_s.end()) continue;
    const auto i = static_cast<std::size_t>(one - times_s.begin());
    const double gap = std::abs(*one + offset_s - time_s);
    if (gap < gap_s && (!best || gap < std::abs(times_s[*best] + offset_s - time_s))) best = i;
  }
  if (best && !used.insert(*best).second) return std::nullopt;
  return best;
}

double nearest_gap_s(const std::vector<double>& times_s, double offset_s, double time_s) {
  double gap_s = std::numeric_limits<double>::infinity();
  for (const double one : times_s) gap_s = std::min(gap_s, std::abs(one + offset_s - time_s));
  return gap_s;
}

}  // namespace palpate::acquisition
