// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "palpate/report/words.hpp"

namespace palpate::cli {

std::string pascal(double young_modulus_pa) {
  return std::isfinite(young_modulus_pa) ? report::quantity(young_modulus_pa, "Pa") : "none";
}

std::string of_truth(double found_pa, double truth_pa) {
  return std::isfinite(found_pa) ? fmt::format("{} ({:+.0f} %)", pascal(found_pa), 100 * (found_pa / truth_pa - 1)) : "none";
}

std::string interval(const MethodAnswer& answer) {
  return std::isfinite(answer.lower_95_pa) ? report::interval(answer.lower_95_pa, answer.upper_95_pa, "Pa") : "none";
}

std::string number(double value, const char* format) { return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "none"; }

std::string escaped(const std::string& words) {
  std::string out;
  for (const char letter : words) out += letter == '<' ? "&lt;" : letter == '>' ? "&gt;" : letter == '&' ? "&amp;" : std::string(1, letter);
  return out;
}

std::string listed(const std::vector<std::string>& codes) {
  std::vector<std::pair<std::string, int>> counted;
  for (const std::string& code : codes) {
    const auto known = std::find_if(counted.begin(), counted.end(), [&](const auto& one) { return one.first == code; });
    if (known == counted.end()) {
      counted.emplace_back(code, 1);
    } else {
      ++known->second;
    }
  }
  std::string all;
  for (const auto& [code, count] : counted)
    all += (all.empty() ? "" : ", ") + code + (count > 1 ? fmt::format(" ({} times)", count) : "");
  return all.empty() ? "none" : all;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  return 0.5 * (values[values.size() / 2] + values[(values.size() - 1) / 2]);
}

Spread spread_of(const std::vector<const MethodAnswer*>& answers) {
  Spread spread;
  double square = 0;
  for (const MethodAnswer* answer : answers) {
    if (!std::isfinite(answer->young_modulus_pa)) {
      ++spread.without;
      continue;
    }
    ++spread.answers;
    spread.mean_pa += answer->young_modulus_pa;
    square += answer->young_modulus_pa * answer->young_modulus_pa;
    spread.poisson += answer->poisson_ratio;
    spread.iterations += answer->iterations;
    spread.solves += answer->solves;
    spread.seconds += answer->seconds;
    spread.most_load_cases = std::max(spread.most_load_cases, answer->load_cases);
  }
  const double count = spread.answers > 0 ? spread.answers : std::numeric_limits<double>::quiet_NaN();
  for (double* sum : {&spread.mean_pa, &spread.poisson, &spread.iterations, &spread.solves, &spread.seconds}) *sum /= count;
  spread.std_pa = count > 1 ? std::sqrt(std::max(0.0, square - count * spread.mean_pa * spread.mean_pa) / (count - 1))
                            : std::numeric_limits<double>::quiet_NaN();
  return spread;
}

std::string mean_and_std(const Spread& spread) {
  if (spread.answers == 0) return "none";
  return pascal(spread.mean_pa) + (spread.answers > 1 ? fmt::format(" &plusmn; {:.1f} %", 100 * spread.std_pa / spread.mean_pa) : "");
}

}  // namespace palpate::cli
