// SPDX-License-Identifier: Apache-2.0
// Numbers and answers as people read them. The page, the figures and the command line say them in the same words.
#pragma once

#include <string>
#include <string_view>

#include "palpate/core/identification.hpp"

namespace palpate::report {

/// "20.3 kPa", "1.24 mm", "0.450", "12.0 N". SI units in (Pa, m, N, s, rad, kg/m3, "" for a bare number); Pa and m get the
/// prefix that fits. `resolution` (same unit) is the smallest difference worth printing; 0 prints three significant digits.
std::string quantity(double value, std::string_view unit, double resolution = 0);

/// "19.9 to 20.7 kPa", both ends with the same prefix and digits.
std::string interval(double lower, double upper, std::string_view unit);

/// "Young's modulus", "Poisson ratio", ... with the region in brackets where there is one.
std::string parameter_title(const Parameter& parameter);

/// The answer in one or two sentences, with intervals, honest about what is not determined or did not work out.
std::string answer(const Identification& identification);

/// The same while the work goes on: "So far: Young's modulus 12.9 kPa, Poisson ratio 0.240."
std::string answer_so_far(const Identification& identification);

/// "converged", "stopped by the user", ...
std::string termination_words(Termination termination);

}  // namespace palpate::report
