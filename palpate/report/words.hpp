// SPDX-License-Identifier: Apache-2.0
// Numbers and answers as people read them. The page, the figures and the command line say them in the same words.
#pragma once

#include <string>

#include "palpate/core/identification.hpp"
#include "palpate/core/quantity.hpp"

namespace palpate::report {

using palpate::interval;
using palpate::quantity;

/// "Young's modulus", "Poisson ratio", ... with the region in brackets where there is one.
std::string parameter_title(const Parameter& parameter);

/// The answer in one or two sentences, with intervals, honest about what is not determined or did not work out.
std::string answer(const Identification& identification);

/// The same while the work goes on: "So far: Young's modulus 12.9 kPa, Poisson ratio 0.240."
std::string answer_so_far(const Identification& identification);

/// "converged", "stopped by the user", ...
std::string termination_words(Termination termination);

}  // namespace palpate::report
