// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {
namespace {

class NeoHookean final : public MaterialLaw {
 public:
  std::string_view name() const override { return "neo_hookean"; }
  std::string_view summary() const override {
    return "W = mu/2 (I1 - 3) - mu ln J + lambda/2 (ln J)^2 (Bonet and Wood 2008, eq. 6.27)";
  }

  double energy_and_stress(const Moduli& m, const Mat3& h, Mat3& stress) const override {
    const double change = volume_change(h);
    if (!(change > -1)) return std::numeric_limits<double>::infinity();
    const double log_j = std::log1p(change);
    const Mat3 inverse_transposed = (Mat3::Identity() + h).inverse().transpose();
    // F - F^-T = (F F' - I) F^-T and I1 - 3 = tr(F F' - I): no cancellation at small strains.
    const Mat3 left = h + h.transpose() + h * h.transpose();
    stress.noalias() = m.mu * left * inverse_transposed;
    stress += m.lambda * log_j * inverse_transposed;
    return m.mu * (0.5 * left.trace() - log_j) + 0.5 * m.lambda * log_j * log_j;
  }

  // dP_ij/dF_kl = mu d_ik d_jl + (mu - lambda ln J) F^-1_jk F^-1_li + lambda F^-1_ji F^-1_lk
  void tangent(const Moduli& m, const Mat3& h, Mat9& out) const override {
    const Mat3 inverse = (Mat3::Identity() + h).inverse();
    const double c = m.mu - m.lambda * std::log1p(volume_change(h));
    for (int l = 0; l < 3; ++l)
      for (int k = 0; k < 3; ++k)
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i)
            out(i + 3 * j, k + 3 * l) = c * inverse(j, k) * inverse(l, i) + m.lambda * inverse(j, i) * inverse(l, k);
    out.diagonal().array() += m.mu;
  }

  bool volumetric_part(const Moduli& m, const Mat3& h, bool with_hessian, VolumetricPart& out) const override {
    const Mat3 inverse = (Mat3::Identity() + h).inverse();
    out.modulus = m.lambda;
    out.modulus_d_poisson = m.lambda_d_poisson;
    out.theta = std::log1p(volume_change(h));
    out.gradient = inverse.transpose();
    if (with_hessian) inverse_transposed_derivative(inverse, out.hessian);
    return true;
  }
};

}  // namespace

const MaterialLaw& neo_hookean_law() {
  static const NeoHookean law;
  return law;
}

}  // namespace palpate::fem
