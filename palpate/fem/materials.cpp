// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/materials.hpp"

#include <Eigen/LU>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {

const std::vector<const MaterialLaw*>& material_table() {
  static const std::vector<const MaterialLaw*> table = {
      &linear_law(),      &corotational_law(),       &st_venant_kirchhoff_law(),
      &neo_hookean_law(), &neo_hookean_stable_law(), &neo_hookean_isochoric_law(),
      &foam_law(),
  };
  return table;
}

const MaterialLaw& material_law(std::string_view name) {
  std::string known;
  for (const MaterialLaw* law : material_table()) {
    if (law->name() == name) return *law;
    known += (known.empty() ? "" : ", ") + std::string(law->name());
  }
  throw Error("no material is called '" + std::string(name) + "'; choose one of " + known, "material");
}

Moduli moduli(double young_modulus_pa, double poisson_ratio, const VectorX& extra) {
  if (!(young_modulus_pa > 0) || !std::isfinite(young_modulus_pa))
    throw Error("must be a positive number of pascal, is " + std::to_string(young_modulus_pa), "young_modulus");
  if (!(poisson_ratio > -1 && poisson_ratio < 0.5))
    throw Error("must lie between -1 and 0.5 (both excluded), is " + std::to_string(poisson_ratio), "poisson_ratio");
  const double e = young_modulus_pa, nu = poisson_ratio;
  const double d = (1 + nu) * (1 - 2 * nu);
  Moduli m;
  m.young_pa = e;
  m.poisson = nu;
  m.lambda = e * nu / d;
  m.mu = e / (2 * (1 + nu));
  m.lambda_d_poisson = e * (1 + 2 * nu * nu) / (d * d);
  m.mu_d_poisson = -e / (2 * (1 + nu) * (1 + nu));
  m.extra = extra;
  return m;
}

// Most energies are linear in (lambda, mu), so their derivative to nu is the same law with (dlambda/dnu, dmu/dnu).
Mat3 MaterialLaw::stress_d_poisson(const Moduli& m, const Mat3& gradient) const {
  Moduli d = m;
  d.lambda = m.lambda_d_poisson;
  d.mu = m.mu_d_poisson;
  Mat3 stress = Mat3::Zero();
  energy_and_stress(d, gradient, stress);
  return stress;
}

Mat3 MaterialLaw::stress_d_extra(const Moduli&, const Mat3&, int) const {
  throw Error("the law has no further parameters", std::string(name()));
}

bool MaterialLaw::volumetric_part(const Moduli&, const Mat3&, bool, VolumetricPart&) const { return false; }

// d(F^-1)_ji / dF_kl = -F^-1_jk F^-1_li
void inverse_transposed_derivative(const Mat3& inverse, Mat9& out) {
  for (int l = 0; l < 3; ++l)
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) out(i + 3 * j, k + 3 * l) = -inverse(j, k) * inverse(l, i);
}

// cof F_ij = 1/2 e_ikm e_jln F_kl F_mn
void cofactor_derivative(const Mat3& f, Mat9& out) {
  out.setZero();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int a = 1; a < 3; ++a)
        for (int b = 1; b < 3; ++b) {
          const double sign = a == b ? 1 : -1;
          out(i + 3 * j, (i + a) % 3 + 3 * ((j + b) % 3)) = sign * f((i + 3 - a) % 3, (j + 3 - b) % 3);
        }
}

double volume_change(const Mat3& h) {
  const double minors =
      h(0, 0) * h(1, 1) - h(0, 1) * h(1, 0) + h(1, 1) * h(2, 2) - h(1, 2) * h(2, 1) + h(0, 0) * h(2, 2) - h(0, 2) * h(2, 0);
  return h.trace() + minors + h.determinant();
}

}  // namespace palpate::fem
