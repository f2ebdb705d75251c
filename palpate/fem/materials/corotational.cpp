// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {
namespace {

// Rotation of F = R S with det R = +1 (inverted elements included: S then has a negative eigenvalue).
Mat3 polar_rotation(const Mat3& f) {
  const double size = f.squaredNorm() / 3;
  if (f.determinant() > 1e-3 * size * std::sqrt(size)) {
    // Newton's iteration (Higham 1986), scaled while it is far: quadratic, four steps at the strains of a push.
    Mat3 r = f;
    bool far = std::abs(size - 1) > 0.2;
    for (int i = 0; i < 30; ++i) {
      Mat3 cofactor;
      cofactor << r.col(1).cross(r.col(2)), r.col(2).cross(r.col(0)), r.col(0).cross(r.col(1));
      const double inverse_determinant = 1 / r.col(0).dot(cofactor.col(0));
      const double scale =
          far ? std::sqrt(std::sqrt(cofactor.squaredNorm() * inverse_determinant * inverse_determinant / r.squaredNorm()))
              : 1;
      const Mat3 next = 0.5 * scale * r + 0.5 * inverse_determinant / scale * cofactor;
      const double change = (next - r).squaredNorm();
      r = next;
      if (change < 1e-15) return r;  // the error of `next` is half the square of the step
      far = change > 0.01;
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

// dR/dF: dR = R [w]x with (tr(S) I - S) w = axial(R'dF - dF'R); the block of dR's column j and dF's column l is
// U_j (tr(S) I - S)^-1 U_l', U_j = R [e_j]x'.
void rotation_derivative(const Mat3& r, const Mat3& strain, Mat9& out) {
  Mat3 spin = -strain;
  spin.diagonal().array() += strain.trace() + 2;
  const Mat3 spin_inverse = spin.inverse();
  Mat3 u[3];
  u[0] << Vec3::Zero(), -r.col(2), r.col(1);
  u[1] << r.col(2), Vec3::Zero(), -r.col(0);
  u[2] << -r.col(1), r.col(0), Vec3::Zero();
  for (int j = 0; j < 3; ++j) {
    const Mat3 left = u[j] * spin_inverse;
    for (int l = 0; l <= j; ++l) {
      const Mat3 block = left * u[l].transpose();
      out.block<3, 3>(3 * j, 3 * l) = block;
      if (l < j) out.block<3, 3>(3 * l, 3 * j) = block.transpose();
    }
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
