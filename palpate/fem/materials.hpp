// SPDX-License-Identifier: Apache-2.0
// The table of materials. A law is one file in materials/ and one line in the table of materials.cpp; the contract suite
// (tests/fem/material_contract_test.cpp), the static solver and the command line loop over the table.
//
// Every law takes the displacement gradient H = F - I (not F: at strains of 1e-6 the difference would be rounding), and
// every law's (E, nu) are those of its small strains.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::fem {

using Mat9 = Eigen::Matrix<double, 9, 9>;  ///< dP/dF; the pair (i, j) of a 3 x 3 matrix has index i + 3 j

/// Elastic constants with what laws need of them; made by `moduli`.
struct Moduli {
  double young_pa = 0, poisson = 0;
  double lambda = 0, mu = 0;  ///< Lame constants, Pa
  double lambda_d_poisson = 0, mu_d_poisson = 0;
  VectorX extra;  ///< further parameters in the order of MaterialLaw::extra_parameters
};

/// @throws Error when E <= 0 or nu is outside (-1, 0.5).
Moduli moduli(double young_modulus_pa, double poisson_ratio, const VectorX& extra = {});

/// A further parameter of a law beside E and nu.
struct ExtraParameter {
  std::string name;
  std::string unit;
  double initial = 0, lower = 0, upper = 0;
};

/// The part of an energy that locks near nu = 0.5, kappa/2 theta^2 with theta a measure of volume change.
struct VolumetricPart {
  double modulus = 0, modulus_d_poisson = 0;  ///< kappa and its derivative to nu, Pa
  double theta = 0;
  Mat3 gradient;  ///< dtheta/dF
  Mat9 hessian;   ///< d2theta/dF2, written when asked for
};

/// A hyperelastic law W(F). The energy is proportional to E in every law of the table (what makes d/dlogE free).
class MaterialLaw {
 public:
  virtual ~MaterialLaw() = default;
  virtual std::string_view name() const = 0;
  virtual std::string_view summary() const = 0;  ///< one line with the energy and its source
  virtual bool is_linear() const { return false; }
  virtual std::vector<ExtraParameter> extra_parameters() const { return {}; }

  /// Energy density [Pa]; writes the first Piola-Kirchhoff stress P = dW/dF [Pa]. Infinity where the law does not exist
  /// (J <= 0 of the laws with a logarithm); P is then left alone.
  virtual double energy_and_stress(const Moduli& m, const Mat3& gradient, Mat3& stress) const = 0;

  /// dP/dF [Pa]. Only asked where the energy is finite.
  virtual void tangent(const Moduli& m, const Mat3& gradient, Mat9& out) const = 0;

  /// dP/dnu at constant E [Pa].
  virtual Mat3 stress_d_poisson(const Moduli& m, const Mat3& gradient) const;

  /// Splits kappa/2 theta^2 off the energy, for elements that average theta. False: the law has no such part (it is meant
  /// for compressible bodies) and elements leave it as it is.
  virtual bool volumetric_part(const Moduli& m, const Mat3& gradient, bool with_hessian, VolumetricPart& out) const;

  /// dP/d extra[index].
  virtual Mat3 stress_d_extra(const Moduli& m, const Mat3& gradient, int index) const;
};

/// All laws, in the order of the documentation.
const std::vector<const MaterialLaw*>& material_table();

/// @throws Error that lists the table's names when `name` is not one of them.
const MaterialLaw& material_law(std::string_view name);

/// J - 1 of F = I + H without cancellation.
double volume_change(const Mat3& gradient);

/// d(F^-T)/dF from F^-1, d(cof F)/dF from F.
void inverse_transposed_derivative(const Mat3& inverse, Mat9& out);
void cofactor_derivative(const Mat3& f, Mat9& out);
/// A matrix as the vector that indexes Mat9.
inline Eigen::Map<const Eigen::Matrix<double, 9, 1>> as_vector(const Mat3& a) {
  return Eigen::Map<const Eigen::Matrix<double, 9, 1>>(a.data());
}

}  // namespace palpate::fem
