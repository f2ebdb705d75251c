// SPDX-License-Identifier: Apache-2.0
// The sample of a stream that belongs to a time. Inner header of the room `acquisition`.
#pragma once

#include <optional>
#include <set>
#include <vector>

namespace palpate::acquisition {

/// Index of the sample nearest to a time, if nearer than gap_s and not used by another step; it is used then.
/// @param times_s   in order, by the sensor's clock
/// @param offset_s  what is added to them
std::optional<std::size_t> nearest_time(const std::vector<double>& times_s, double offset_s, double time_s, double gap_s, std::set<std::size_t>& used);

/// How far off it is, used or not; infinite where there is none.
double nearest_gap_s(const std::vector<double>& times_s, double offset_s, double time_s);

}  // namespace palpate::acquisition
