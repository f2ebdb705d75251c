// SPDX-License-Identifier: Apache-2.0
// What an option's number must be, in words of its own.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>
#include <system_error>

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

/// From 0 to the largest that 64 bits hold: "-1" is not taken for that one.
inline CLI::Validator whole_number() {
  return CLI::Validator(
      [](std::string& text) {
        std::uint64_t value = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        const bool fine = error == std::errc() && end == text.data() + text.size();
        return fine ? std::string() : "must be a whole number from 0 to 18446744073709551615, is " + text;
      },
      "NUMBER");
}

/// One of three. @param which  e.g. "a place in metres, base frame"
inline CLI::Validator coordinate(const std::string& which) {
  return CLI::Validator(
      [which](std::string& text) {
        double value = 0;
        const bool fine = CLI::detail::lexical_cast(text, value) && std::isfinite(value);
        return fine ? std::string() : "needs three numbers, X Y Z: " + which + "; `" + text + "` is none";
      },
      "");
}

}  // namespace palpate::cli
