// SPDX-License-Identifier: Apache-2.0
// Numbers with their unit as people read them.
#pragma once

#include <string>
#include <string_view>

namespace palpate {

/// "20.3 kPa", "1.24 mm", "0.450", "12.0 N". SI units in (Pa, m, N, s, rad, kg/m3, "" for a bare number); Pa and m get the
/// prefix that fits. `resolution` (same unit) is the smallest difference worth printing; 0 prints three significant digits.
/// Below a millionth of the unit "1.00e-09 N".
std::string quantity(double value, std::string_view unit, double resolution = 0);

/// "19.9 to 20.7 kPa", both ends with the same prefix and decimals, as the width asks for and five digits at most; a lower end above zero
/// keeps two digits, in a unit of its own where it is far below: "300 Pa to 200 kPa".
std::string interval(double lower, double upper, std::string_view unit);

}  // namespace palpate
