// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {
namespace {

class Linear final : public MaterialLaw {
 public:
  std::string_view name() const override { return "linear"; }
  std::string_view summary() const override { return "small strains: W = mu e:e + lambda/2 tr(e)^2, e = sym(grad u)"; }
  bool is_linear() const override { return true; }

  double energy_and_stress(const Moduli& m, const Mat3& h, Mat3& stress) const override {
    const Mat3 strain = 0.5 * (h + h.transpose());
    stress = 2 * m.mu * strain;
    stress.diagonal().array() += m.lambda * strain.trace();
    return 0.5 * stress.cwiseProduct(strain).sum();
  }

  void tangent(const Moduli& m, const Mat3&, Mat9& out) const override {
    out.setZero();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        out(i + 3 * j, i + 3 * j) += m.mu;
        out(i + 3 * j, j + 3 * i) += m.mu;
        out(i + 3 * i, j + 3 * j) += m.lambda;
      }
  }

  bool volumetric_part(const Moduli& m, const Mat3& h, bool with_hessian, VolumetricPart& out) const override {
    out.modulus = m.lambda;
    out.modulus_d_poisson = m.lambda_d_poisson;
    out.theta = h.trace();
    out.gradient.setIdentity();
    if (with_hessian) out.hessian.setZero();
    return true;
  }
};

}  // namespace

const MaterialLaw& linear_law() {
  static const Linear law;
  return law;
}

}  // namespace palpate::fem
