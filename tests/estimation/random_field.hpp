// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "palpate/lab/random.hpp"

namespace palpate::coverage {

/// Smooth random field with covariance std^2 exp(-d^2 / (2 length^2)), by random Fourier features.
class RandomField {
 public:
  RandomField(double std, double length_m, lab::Random& random) {
    constexpr int waves = 250;
    wave_.resize(waves, 3);
    phase_.resize(waves);
    for (int k = 0; k < waves; ++k) {
      wave_.row(k) = random.normal3() / length_m;
      phase_(k) = random.uniform(0, 2 * EIGEN_PI);
    }
    size_ = std * std::sqrt(2.0 / waves);
  }
  double at(const Vec3& x_m) const { return size_ * (wave_ * x_m + phase_).array().cos().sum(); }

 private:
  Eigen::Matrix<double, Eigen::Dynamic, 3> wave_;
  VectorX phase_;
  double size_ = 0;
};

}  // namespace palpate::coverage
