// SPDX-License-Identifier: Apache-2.0
// Random numbers that are the same with every compiler and standard library (std::normal_distribution is not).
#pragma once

#include <cmath>
#include <cstdint>

#include "palpate/core/math.hpp"

namespace palpate::lab {

/// SplitMix64 (Steele, Lea, Flood 2014): one word of state, so a stream of its own for every purpose is cheap.
class Random {
 public:
  /// Streams of one seed are independent of each other; adding one changes none of the others.
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0)
      : state_(mix(seed) ^ mix(0x9E3779B97F4A7C15U * (stream + 1))) {}

  std::uint64_t word() { return mix(state_ += 0x9E3779B97F4A7C15U); }
  /// Uniform in [0, 1).
  double uniform() { return double(word() >> 11) * 0x1.0p-53; }
  double uniform(double lower, double upper) { return lower + (upper - lower) * uniform(); }
  /// Standard normal (Box and Muller; the sine is thrown away, so that a draw never depends on the one before).
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * M_PI * uniform());
  }
  Vec3 normal3() {
    const double x = normal(), y = normal(), z = normal();
    return {x, y, z};
  }

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31);
  }
  std::uint64_t state_;
};

}  // namespace palpate::lab
