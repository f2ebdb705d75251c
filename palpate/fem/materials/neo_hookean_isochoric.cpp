// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {
namespace {

class NeoHookeanIsochoric final : public MaterialLaw {
 public:
  std::string_view name() const override { return "neo_hookean_isochoric"; }
  std::string_view summary() const override {
    return "W = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2 (CalculiX *HYPERELASTIC, NEO HOOKE with C10 = mu/2, D1 = 2/K)";
  }

  double energy_and_stress(const Moduli& m, const Mat3& h, Mat3& stress) const override {
    const double change = volume_change(h);
    if (!(change > -1)) return std::numeric_limits<double>::infinity();
    const double bulk = m.lambda + 2.0 / 3 * m.mu;
    const double shrink = std::expm1(-2.0 / 3 * std::log1p(change));  // J^(-2/3) - 1
    const Mat3 inverse_transposed = (Mat3::Identity() + h).inverse().transpose();
    const Mat3 left = h + h.transpose() + h * h.transpose();
    Mat3 deviator = left;
    deviator.diagonal().array() -= left.trace() / 3;
    stress.noalias() = m.mu * (1 + shrink) * deviator * inverse_transposed;
    stress += bulk * change * (1 + change) * inverse_transposed;
    return 0.5 * m.mu * ((1 + shrink) * left.trace() + 3 * shrink) + 0.5 * bulk * change * change;
  }

  // With G = F^-T, a = J^(-2/3): d[mu a (F - I1/3 G)] + d[K (J - 1) J G].
  void tangent(const Moduli& m, const Mat3& h, Mat9& out) const override {
    const Mat3 f = Mat3::Identity() + h, inverse = f.inverse(), g = inverse.transpose();
    const double change = volume_change(h), j = 1 + change;
    const double bulk = m.lambda + 2.0 / 3 * m.mu, a = m.mu * std::pow(j, -2.0 / 3), i1 = f.squaredNorm();
    inverse_transposed_derivative(inverse, out);
    out *= bulk * change * j - a * i1 / 3;
    const auto fv = as_vector(f), gv = as_vector(g);
    out.noalias() += (bulk * (2 * j - 1) * j + a * i1 * 2 / 9) * gv * gv.transpose();
    out.noalias() -= (a * 2 / 3) * (gv * fv.transpose() + fv * gv.transpose());
    out.diagonal().array() += a;
  }

  bool volumetric_part(const Moduli& m, const Mat3& h, bool with_hessian, VolumetricPart& out) const override {
    const Mat3 f = Mat3::Identity() + h;
    out.modulus = m.lambda + 2.0 / 3 * m.mu;
    out.modulus_d_poisson = m.lambda_d_poisson + 2.0 / 3 * m.mu_d_poisson;
    out.theta = volume_change(h);
    out.gradient = (1 + out.theta) * f.inverse().transpose();
    if (with_hessian) cofactor_derivative(f, out.hessian);
    return true;
  }
};

}  // namespace

const MaterialLaw& neo_hookean_isochoric_law() {
  static const NeoHookeanIsochoric law;
  return law;
}

}  // namespace palpate::fem
