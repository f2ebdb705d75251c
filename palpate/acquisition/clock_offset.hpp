// SPDX-License-Identifier: Apache-2.0
// How far two clocks are apart, told from what both saw: where the arm starts and stops, its force and its picture do too.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace palpate::acquisition {

/// A quantity that only grows or changes as the other sensor's changes do, e.g. the way that the tip has gone so far.
struct RunningSum {
  std::vector<double> times_s;  ///< rise
  std::vector<double> values;
  double at(double time_s) const;  ///< linear in between, constant outside
};

/// What a sensor saw change between two of its times.
struct Change {
  double from_s = 0, to_s = 0;
  double amount = 0;
};

struct ClockOffset {
  std::string sensor;      ///< for messages
  double offset_s = 0;     ///< added to the sensor's times
  double std_s = 0;        ///< the width of the likelihood's peak, or of all of it where that is more
  double correlation = 0;  ///< at the peak
  bool usable = false;     ///< a clear peak inside the range that was searched
};

/// What of an estimated offset is to be added to the sensor's times: nothing of one within its standard deviation of zero, which is
/// no evidence of any offset, and nearly all of one that is many of them away (the James-Stein estimate in one dimension).
double believed_offset_s(const ClockOffset& found);

/// How far the clocks may still be apart after that, as a standard deviation: the estimate's own, and what was not believed.
double left_std_s(const ClockOffset& found);

/// The offset at which the changes go best with those of `motion`: largest correlation over offsets up to
/// `largest_s` on both sides, on a grid of `step_s`, refined by a parabola. The standard deviation takes the changes for a
/// line in the motion with normal noise: log-likelihood -n/2 log(1 - r^2).
/// @param overlap  changes that share a time: n is that many times fewer
/// @throws Error when the grid would have more than a million points.
ClockOffset find_offset(const RunningSum& motion, std::span<const Change> changes, double largest_s, double overlap = 1,
                        double step_s = 0.002);

}  // namespace palpate::acquisition
