// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {
namespace {

class StVenantKirchhoff final : public MaterialLaw {
 public:
  std::string_view name() const override { return "stvk"; }
  std::string_view summary() const override {
    return "W = mu E:E + lambda/2 tr(E)^2, E = (F'F - I)/2 (softens under compression and loses stability)";
  }

  double energy_and_stress(const Moduli& m, const Mat3& h, Mat3& stress) const override {
    const Mat3 strain = green_strain(h);
    Mat3 second = 2 * m.mu * strain;
    second.diagonal().array() += m.lambda * strain.trace();
    stress.noalias() = second + h * second;
    return 0.5 * second.cwiseProduct(strain).sum();
  }

  // dP = dF S + F (mu (dF'F + F'dF) + lambda (F : dF) I)
  void tangent(const Moduli& m, const Mat3& h, Mat9& out) const override {
    const Mat3 f = Mat3::Identity() + h, strain = green_strain(h);
    Mat3 second = 2 * m.mu * strain;
    second.diagonal().array() += m.lambda * strain.trace();
    const Mat3 left = f * f.transpose();
    for (int l = 0; l < 3; ++l)
      for (int k = 0; k < 3; ++k)
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i)
            out(i + 3 * j, k + 3 * l) = (i == k ? second(l, j) : 0) + m.mu * f(i, l) * f(k, j) +
                                        (j == l ? m.mu * left(i, k) : 0) + m.lambda * f(i, j) * f(k, l);
  }

  bool volumetric_part(const Moduli& m, const Mat3& h, bool with_hessian, VolumetricPart& out) const override {
    out.modulus = m.lambda;
    out.modulus_d_poisson = m.lambda_d_poisson;
    out.theta = green_strain(h).trace();
    out.gradient = Mat3::Identity() + h;
    if (with_hessian) out.hessian.setIdentity();
    return true;
  }

 private:
  static Mat3 green_strain(const Mat3& h) { return 0.5 * (h + h.transpose() + h.transpose() * h); }
};

}  // namespace

const MaterialLaw& st_venant_kirchhoff_law() {
  static const StVenantKirchhoff law;
  return law;
}

}  // namespace palpate::fem
