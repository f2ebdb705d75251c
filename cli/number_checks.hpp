// SPDX-License-Identifier: Apache-2.0
// What an option's number must be, in words of its own.
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

namespace palpate::cli {

/// A finite number above 0.
inline CLI::Validator positive_number() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0;
        const bool fine = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value > 0;
        return fine ? std::string() : "must be a number above 0, is " + text;
      },
      "POSITIVE");
}

/// A finite number, 0 or above.
inline CLI::Validator number_from_zero() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0;
        const bool fine = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value >= 0;
        return fine ? std::string() : "must be 0 or a number above it, is " + text;
      },
      "NUMBER >= 0");
}

/// A Poisson ratio with which a body can be computed.
inline CLI::Validator poisson_number() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0;
        const bool fine = CLI::detail::lexical_cast(text, value) && value > -1 && value <= 0.4995;
        return fine ? std::string() : "must lie above -1 and at most at 0.4995, is " + text;
      },
      "NUMBER");
}

/// A number, neither NaN nor infinite.
inline CLI::Validator finite_number() {
  return CLI::Validator(
      [](std::string& text) {
        double value = 0;
        return CLI::detail::lexical_cast(text, value) && std::isfinite(value) ? std::string() : "must be a finite number, is " + text;
      },
      "NUMBER");
}

}  // namespace palpate::cli
