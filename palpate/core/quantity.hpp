// SPDX-License-Identifier: Apache-2.0
// Numbers with their unit as people read them.
#pragma once

#include <string>
#include <string_view>

namespace palpate {

/// "20.3 kPa", "1.24 mm", "0.450", "12.0 N". SI units in (Pa, m, N, s, rad, kg/m3, "" for a bare number); Pa and m get the
/// prefix that fits. `resolution` (same unit) is the smallest difference worth printing; 0 prints three significant digits.
std::string quantity(double value, std::string_view unit, double resolution = 0);

/// "19.9 to 20.7 kPa", both ends with the same prefix and digits.
std::string interval(double lower, double upper, std::string_view unit);

}  // namespace palpate
