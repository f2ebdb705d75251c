// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {
namespace {

// Rotation of F = R S with det R = +1 (inverted elements included: S then has a negative eigenvalue).
Mat3 polar_rotation(const Mat3& f) {
  const double det = f.determinant();
  if (det > 1e-3 * std::pow(f.squaredNorm() / 3, 1.5)) {
    // Scaled Newton iteration (Higham 1986): quadratic, five or six steps at the strains of a push.
    Mat3 r = f;
    for (int i = 0; i < 30; ++i) {
      const Mat3 inverse_transposed = r.inverse().transpose();
      const double scale = std::sqrt(inverse_transposed.norm() / r.norm());
      const Mat3 next = 0.5 * (scale * r + inverse_transposed / scale);
      const double change = (next - r).squaredNorm();
      r = next;
      if (change < 1e-28) return r;
    }
  }
  const Eigen::JacobiSVD<Mat3> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 u = svd.matrixU();
  if (u.determinant() * svd.matrixV().determinant() < 0) u.col(2) = -u.col(2);
  return u * svd.matrixV().transpose();
}

// S - I, from S^2 - I = H + H' + H'H, which does not cancel at small strains.
Mat3 stretch_minus_identity(const Mat3& h, const Mat3& rotation) {
  const Mat3 s = rotation.transpose() * (Mat3::Identity() + h);
  const Mat3 sum = Mat3::Identity() + 0.5 * (s + s.transpose());
  if (sum.determinant() < 1.0) return sum - 2 * Mat3::Identity();
  const Mat3 strain = (h + h.transpose() + h.transpose() * h) * sum.inverse();
  return 0.5 * (strain + strain.transpose());
}

// dR/dF: dR = R [w]x with (tr(S) I - S) w = axial(R'dF - dF'R).
void rotation_derivative(const Mat3& r, const Mat3& strain, Mat9& out) {
  Mat3 spin = -strain;
  spin.diagonal().array() += strain.trace() + 2;
  const Mat3 spin_inverse = spin.inverse();
  for (int l = 0; l < 3; ++l)
    for (int k = 0; k < 3; ++k) {
      // R'dF for dF = e_k e_l' has the column l equal to row k of R.
      const Vec3 row = r.row(k).transpose();
      const Vec3 axial = Vec3::Unit(l).cross(row);
      const Vec3 w = spin_inverse * axial;
      Mat3 cross;
      cross << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
      const Mat3 d = r * cross;
      out.col(k + 3 * l) = as_vector(d);
    }
}

class Corotational final : public MaterialLaw {
 public:
  std::string_view name() const override { return "corotational"; }
  std::string_view summary() const override {
    return "W = mu |F - R|^2 + lambda/2 tr(S - I)^2, F = R S, with its exact tangent (unstable above a pressure of 0.3 E)";
  }

  double energy_and_stress(const Moduli& m, const Mat3& h, Mat3& stress) const override {
    const Mat3 r = polar_rotation(Mat3::Identity() + h);
    const Mat3 strain = stretch_minus_identity(h, r);
    const double trace = strain.trace();
    stress.noalias() = r * (2 * m.mu * strain);
    stress += m.lambda * trace * r;
    return m.mu * strain.squaredNorm() + 0.5 * m.lambda * trace * trace;
  }

  // dP = 2 mu dF + (lambda tr(S - I) - 2 mu) dR + lambda (R : dF) R
  void tangent(const Moduli& m, const Mat3& h, Mat9& out) const override {
    const Mat3 r = polar_rotation(Mat3::Identity() + h);
    const Mat3 strain = stretch_minus_identity(h, r);
    rotation_derivative(r, strain, out);
    out *= m.lambda * strain.trace() - 2 * m.mu;
    out.noalias() += m.lambda * as_vector(r) * as_vector(r).transpose();
    out.diagonal().array() += 2 * m.mu;
  }

  bool volumetric_part(const Moduli& m, const Mat3& h, bool with_hessian, VolumetricPart& out) const override {
    out.gradient = polar_rotation(Mat3::Identity() + h);
    const Mat3 strain = stretch_minus_identity(h, out.gradient);
    out.modulus = m.lambda;
    out.modulus_d_poisson = m.lambda_d_poisson;
    out.theta = strain.trace();
    if (with_hessian) rotation_derivative(out.gradient, strain, out.hessian);
    return true;
  }
};

}  // namespace

const MaterialLaw& corotational_law() {
  static const Corotational law;
  return law;
}

}  // namespace palpate::fem
