// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/materials/laws.hpp"

namespace palpate::fem {
namespace {

// F = U diag(l) V' with l > 0, from C - I so that small strains keep their digits.
struct Stretches {
  Mat3 u, v;
  Vec3 stretch, log_stretch;
  double log_j = 0;
  explicit Stretches(const Mat3& h) {
    const Mat3 twice_strain = h + h.transpose() + h.transpose() * h;
    const Eigen::SelfAdjointEigenSolver<Mat3> eigen(twice_strain);
    v = eigen.eigenvectors();
    for (int i = 0; i < 3; ++i) log_stretch(i) = 0.5 * std::log1p(eigen.eigenvalues()(i));
    stretch = log_stretch.array().exp();
    log_j = log_stretch.sum();
    u = (Mat3::Identity() + h) * v * stretch.cwiseInverse().asDiagonal();
  }
};

class Foam final : public MaterialLaw {
 public:
  std::string_view name() const override { return "foam"; }
  std::string_view summary() const override {
    return "W = 2 mu/a^2 (l1^a + l2^a + l3^a - 3 + (J^(-a b) - 1)/b), b = nu/(1 - 2 nu), l = stretches (Ogden 1972, Hill "
           "1978, "
           "one term)";
  }
  std::vector<ExtraParameter> extra_parameters() const override { return {{"alpha", "-", 4.0, 0.5, 25.0}}; }

  double energy_and_stress(const Moduli& m, const Mat3& h, Mat3& stress) const override {
    if (!(volume_change(h) > -1)) return std::numeric_limits<double>::infinity();
    const Stretches s(h);
    const double a = alpha(m), b = beta(m);
    const double volume = -a * b * s.log_j;  // ln J^(-a b)
    double energy = std::abs(volume) < 1e-7 * std::abs(a * s.log_j) || b == 0 ? -a * s.log_j * (1 + 0.5 * volume)
                                                                              : std::expm1(volume) / b;
    Vec3 principal;
    for (int i = 0; i < 3; ++i) {
      const double growth = std::expm1(a * s.log_stretch(i));
      energy += growth;
      principal(i) = 2 * m.mu / (a * s.stretch(i)) * (growth - std::expm1(volume));
    }
    stress.noalias() = s.u * principal.asDiagonal() * s.v.transpose();
    return 2 * m.mu / (a * a) * energy;
  }

  // In the principal frame: second derivatives of W on the diagonal, divided differences of its first derivatives off it
  // (Ogden 1984, section 6.1.4).
  void tangent(const Moduli& m, const Mat3& h, Mat9& out) const override {
    const Stretches s(h);
    const double a = alpha(m), b = beta(m), c = 2 * m.mu / a, volume = std::exp(-a * b * s.log_j);
    Vec3 principal;
    for (int i = 0; i < 3; ++i)
      principal(i) = c / s.stretch(i) * (std::expm1(a * s.log_stretch(i)) - std::expm1(-a * b * s.log_j));
    Mat3 second;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        second(i, j) = c * a * b * volume / (s.stretch(i) * s.stretch(j));
        if (i == j) second(i, i) += c / (s.stretch(i) * s.stretch(i)) * ((a - 1) * std::exp(a * s.log_stretch(i)) + volume);
      }
    Mat9 frame;  // columns: u_i v_j' as vectors
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) {
        const Mat3 dyad = s.u.col(i) * s.v.col(j).transpose();
        frame.col(i + 3 * j) = as_vector(dyad);
      }
    Mat9 local = Mat9::Zero();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) local(4 * i, 4 * j) = second(i, j);
    for (int i = 0; i < 3; ++i)
      for (int j = i + 1; j < 3; ++j) {
        const double li = s.stretch(i), lj = s.stretch(j);
        const double difference = c * (power_difference(a - 1, s.log_stretch(i), s.log_stretch(j)) + volume / (li * lj));
        const double sum = (principal(i) + principal(j)) / (li + lj);
        const int ij = i + 3 * j, ji = j + 3 * i;
        local(ij, ij) = local(ji, ji) = 0.5 * (difference + sum);
        local(ij, ji) = local(ji, ij) = 0.5 * (difference - sum);
      }
    out.noalias() = frame * local * frame.transpose();
  }

  Mat3 stress_d_poisson(const Moduli& m, const Mat3& h) const override {
    Mat3 stress;
    energy_and_stress(m, h, stress);
    const Stretches s(h);
    const double a = alpha(m), b = beta(m), b_d_poisson = 1 / ((1 - 2 * m.poisson) * (1 - 2 * m.poisson));
    const double d = 2 * m.mu * s.log_j * std::exp(-a * b * s.log_j) * b_d_poisson;
    return m.mu_d_poisson / m.mu * stress + s.u * (d * s.stretch.cwiseInverse()).asDiagonal() * s.v.transpose();
  }

  Mat3 stress_d_extra(const Moduli& m, const Mat3& h, int) const override {
    Mat3 stress;
    energy_and_stress(m, h, stress);
    const Stretches s(h);
    const double a = alpha(m), b = beta(m);
    Vec3 d;
    for (int i = 0; i < 3; ++i)
      d(i) = 2 * m.mu / (a * s.stretch(i)) *
             (s.log_stretch(i) * std::exp(a * s.log_stretch(i)) + b * s.log_j * std::exp(-a * b * s.log_j));
    return s.u * d.asDiagonal() * s.v.transpose() - stress / a;
  }

 private:
  static double beta(const Moduli& m) { return m.poisson / (1 - 2 * m.poisson); }
  static double alpha(const Moduli& m) {
    if (m.extra.size() != 1 || m.extra(0) == 0) throw Error("needs one non-zero value", "foam.alpha");
    return m.extra(0);
  }
  // (x^p - y^p) / (x - y) from logarithms, also for x = y.
  static double power_difference(double p, double log_x, double log_y) {
    const double ratio = log_x - log_y;
    const double quotient = std::abs(ratio) < 1e-12 ? p : std::expm1(p * ratio) / std::expm1(ratio);
    return std::exp((p - 1) * log_y) * quotient;
  }
};

}  // namespace

const MaterialLaw& foam_law() {
  static const Foam law;
  return law;
}

}  // namespace palpate::fem
