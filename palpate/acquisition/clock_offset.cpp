// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/clock_offset.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"

namespace palpate::acquisition {
namespace {

constexpr std::size_t fewest_changes = 10;
constexpr double least_correlation = 0.5;

double correlation_at(const RunningSum& motion, std::span<const Change> changes, double offset_s) {
  const double n = static_cast<double>(changes.size());
  double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  for (const Change& one : changes) {
    const double moved = motion.at(one.to_s + offset_s) - motion.at(one.from_s + offset_s);
    x += moved, y += one.amount;
    xx += moved * moved, yy += one.amount * one.amount, xy += moved * one.amount;
  }
  const double spread = (xx - x * x / n) * (yy - y * y / n);
  return spread > 0 ? (xy - x * y / n) / std::sqrt(spread) : 0;
}

}  // namespace

double RunningSum::at(double time_s) const {
  const auto after = std::lower_bound(times_s.begin(), times_s.end(), time_s);
  if (after == times_s.begin()) return values.front();
  if (after == times_s.end()) return values.back();
  const auto i = static_cast<std::size_t>(after - times_s.begin());
  const double share = (time_s - times_s[i - 1]) / (times_s[i] - times_s[i - 1]);
  return (1 - share) * values[i - 1] + share * values[i];
}

double believed_offset_s(const ClockOffset& found) {
  if (!found.usable || !(std::abs(found.offset_s) > found.std_s)) return 0;
  return found.offset_s - found.std_s * found.std_s / found.offset_s;
}

double left_std_s(const ClockOffset& found) {
  return found.usable ? std::hypot(found.std_s, found.offset_s - believed_offset_s(found)) : 0;
}

ClockOffset find_offset(const RunningSum& motion, std::span<const Change> changes, double largest_s, double overlap,
                        double step_s) {
  if (!(largest_s > 0 && step_s > 0 && overlap >= 1))
    throw Error("must be positive", "find_offset: largest_s, step_s, overlap");
  constexpr double most_steps = 5e5;
  if (!(largest_s / step_s <= most_steps))
    throw Error("is more than half a million steps of the search; search less far", "find_offset: largest_s");
  ClockOffset found;
  if (motion.times_s.size() < 2 || changes.size() < fewest_changes) return found;
  const int half = static_cast<int>(std::ceil(largest_s / step_s));
  std::vector<double> r;
  for (int k = -half; k <= half; ++k) r.push_back(correlation_at(motion, changes, k * step_s));
  const auto peak = static_cast<int>(std::max_element(r.begin(), r.end()) - r.begin());
  found.correlation = r[static_cast<std::size_t>(peak)];
  found.offset_s = (peak - half) * step_s;
  const bool inside = peak > 0 && peak < 2 * half;
  // The noise of one change goes into the likelihood; a lag of a few per cent of it is what the curvature tells.
  const auto cost = [&](int k) {
    const double one = std::clamp(r[static_cast<std::size_t>(k)], 0.0, 1 - 1e-9);
    return 0.5 * static_cast<double>(changes.size()) / overlap * std::log(1 - one * one);
  };
  if (inside) {
    // Over a few grid points: the correlation of series that were sampled slowly has corners.
    const int reach = std::min({5, peak, 2 * half - peak});
    const double before = cost(peak - reach), here = cost(peak), after = cost(peak + reach), width = reach * step_s;
    const double curvature = (before - 2 * here + after) / (width * width);
    if (curvature > 0) {
      found.offset_s += std::clamp((before - after) / (2 * width * curvature), -width, width);
      // Or over all offsets, each as likely as it is: few images have other peaks that are nearly as high.
      double weights = 0, squares = 0;
      for (int k = 0; k <= 2 * half; ++k) {
        const double weight = std::exp(here - cost(k)), off_s = (k - half) * step_s - found.offset_s;
        weights += weight, squares += weight * off_s * off_s;
      }
      found.std_s = std::max(1 / std::sqrt(curvature), std::sqrt(squares / weights));
      found.usable = found.correlation > least_correlation && found.std_s < 0.25 * largest_s;
    }
  }
  return found;
}

}  // namespace palpate::acquisition
