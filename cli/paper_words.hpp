// SPDX-License-Identifier: Apache-2.0
// Numbers and codes as the page of `palpate paper` writes them; "none" where there is none.
#pragma once

#include <string>
#include <vector>

#include "cli/paper_methods.hpp"

namespace palpate::cli {

std::string pascal(double young_modulus_pa);
/// "11.6 kPa (-13 %)"
std::string of_truth(double found_pa, double truth_pa);
std::string interval(const MethodAnswer& answer);
std::string number(double value, const char* format);
/// NaN: there are none
double median(std::vector<double> values);
/// As text of a page.
std::string escaped(const std::string& words);
/// "a, b (3 times)"
std::string listed(const std::vector<std::string>& codes);

/// Of one method over several answers; those without one are in no mean.
struct Spread {
  int answers = 0, without = 0, most_load_cases = 0;
  double mean_pa = 0, std_pa = 0, poisson = 0, iterations = 0, solves = 0, seconds = 0;  ///< std of one alone: NaN
};
Spread spread_of(const std::vector<const MethodAnswer*>& answers);
/// "12.1 kPa +- 4.0 %"
std::string mean_and_std(const Spread& spread);

}  // namespace palpate::cli
