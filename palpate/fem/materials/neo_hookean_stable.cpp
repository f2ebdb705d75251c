// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <cmath>

#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {
namespace {

// cof(I + H) = I + tr(H) I - H' + cof(H)
Mat3 cofactor_minus_identity(const Mat3& h) {
  Mat3 c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c(i, j) = h((i + 1) % 3, (j + 1) % 3) * h((i + 2) % 3, (j + 2) % 3) -
                h((i + 1) % 3, (j + 2) % 3) * h((i + 2) % 3, (j + 1) % 3);
  c -= h.transpose();
  c.diagonal().array() += h.trace();
  return c;
}

// Constants of the paper's energy that give Hooke's law with (lambda, mu) at small strains (its section 3.4).
struct Constants {
  double mu, lambda;
  explicit Constants(const Moduli& m) : mu(4.0 / 3 * m.mu), lambda(m.lambda + 5.0 / 6 * m.mu) {}
};

class NeoHookeanStable final : public MaterialLaw {
 public:
  std::string_view name() const override { return "neo_hookean_stable"; }
  std::string_view summary() const override {
    return "W = a/2 (I1 - 3) - a/2 ln((I1 + 1)/4) + b/2 (J - 1)^2 - 3a/4 (J - 1), a = 4/3 mu, b = lambda + 5/6 mu "
           "(Smith, de Goes and Kim 2018); exists for inverted elements too";
  }

  double energy_and_stress(const Moduli& m, const Mat3& h, Mat3& stress) const override {
    const Constants c(m);
    const double change = volume_change(h);
    const Mat3 cofactor = cofactor_minus_identity(h);
    const double excess = 2 * h.trace() + h.squaredNorm();  // I1 - 3
    // a I1/(I1+1) F - 3a/4 cof F, without cancellation at rest
    stress = c.mu * (excess / (4 * (excess + 4))) * (Mat3::Identity() + h) + 0.75 * c.mu * (h - cofactor);
    stress += c.lambda * change * (Mat3::Identity() + cofactor);
    return 0.5 * c.mu * (excess - std::log1p(excess / 4)) + 0.5 * c.lambda * change * change - 0.75 * c.mu * change;
  }

  void tangent(const Moduli& m, const Mat3& h, Mat9& out) const override {
    const Constants c(m);
    const Mat3 f = Mat3::Identity() + h, cofactor = Mat3::Identity() + cofactor_minus_identity(h);
    const double i1 = f.squaredNorm();
    cofactor_derivative(f, out);
    out *= c.lambda * volume_change(h) - 0.75 * c.mu;
    out.noalias() += c.lambda * as_vector(cofactor) * as_vector(cofactor).transpose();
    out.noalias() += (2 * c.mu / ((i1 + 1) * (i1 + 1))) * as_vector(f) * as_vector(f).transpose();
    out.diagonal().array() += c.mu * i1 / (i1 + 1);
  }

  bool volumetric_part(const Moduli& m, const Mat3& h, bool with_hessian, VolumetricPart& out) const override {
    out.modulus = m.lambda + 5.0 / 6 * m.mu;
    out.modulus_d_poisson = m.lambda_d_poisson + 5.0 / 6 * m.mu_d_poisson;
    out.theta = volume_change(h);
    out.gradient = Mat3::Identity() + cofactor_minus_identity(h);
    if (with_hessian) cofactor_derivative(Mat3::Identity() + h, out.hessian);
    return true;
  }
};

}  // namespace

const MaterialLaw& neo_hookean_stable_law() {
  static const NeoHookeanStable law;
  return law;
}

}  // namespace palpate::fem
