// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/pressed_balloon.hpp"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate::lab {
namespace {

using Vec4 = Eigen::Vector4d;
using Mat4 = Eigen::Matrix4d;

/// Energy of a membrane per stress-free area over thickness and shear modulus, in a and b: squared stretches along and around.
struct Density {
  double value, a, b, aa, bb, ab;
};

Density density(double a, double b) {
  if (a < 1 && b < 1) return {0, 0, 0, 0, 0, 0};  // slack
  if (b < 1 / std::sqrt(a)) {                       // wrinkled around: as wide as one pull leaves it
    const double root = std::sqrt(a);
    return {0.5 * (a + 2 / root - 3), 0.5 * (1 - 1 / (a * root)), 0, 0.75 / (a * a * root), 0, 0};
  }
  if (a < 1 / std::sqrt(b)) {
    const double root = std::sqrt(b);
    return {0.5 * (b + 2 / root - 3), 0, 0.5 * (1 - 1 / (b * root)), 0, 0.75 / (b * b * root), 0};
  }
  const double ab = a * b;
  return {0.5 * (a + b + 1 / ab - 3), 0.5 * (1 - 1 / (a * ab)), 0.5 * (1 - 1 / (b * ab)), 1 / (a * a * ab), 1 / (b * b * ab),
          0.5 / (ab * ab)};
}

}  // namespace

struct PressedBalloon::Impl {
  explicit Impl(const PressedBalloonOptions& given) : options(given) {
    const auto need = [](bool good, const char* field, const char* rule) {
      if (!good) throw Error(rule, std::string("PressedBalloonOptions.") + field);
    };
    need(options.radius_m > 0, "radius_m", "must be positive");
    need(std::abs(options.centre_height_m) < options.radius_m, "centre_height_m", "must cut the table");
    need(options.stretch > 1.01 && options.stretch < 6, "stretch", "must be from 1.01 to 6");
    need(options.thickness_m > 0 && options.thickness_m < 0.05 * options.radius_m, "thickness_m", "must be positive and thin");
    need(options.young_modulus_pa > 0, "young_modulus_pa", "must be positive");
    need(options.air_pa > 0, "air_pa", "must be positive");
    need(options.pad_radius_m > 0 && options.pad_radius_m < 0.6 * options.radius_m, "pad_radius_m",
         "must be positive and smaller than 0.6 of the balloon's");
    need(options.elements >= 20, "elements", "must be at least 20");
    need(options.sides >= 8, "sides", "must be at least 8");
    const Index n = options.elements;
    const double end = std::acos(-options.centre_height_m / options.radius_m);
    rest.resize(n + 1, 2);
    for (Index i = 0; i <= n; ++i) {
      const double angle = end * static_cast<double>(i) / static_cast<double>(n);
      rest.row(i) << options.radius_m * std::sin(angle), options.centre_height_m + options.radius_m * std::cos(angle);
    }
    // Uniform pressure on the rest shape's cap under the pad; linear between nodes, so shares are exact for the pad's rim.
    share = VectorX::Zero(n + 1);
    for (Index e = 0; e < n; ++e) {
      constexpr int parts = 16;
      for (int k = 0; k < parts; ++k) {
        const double t = (k + 0.5) / parts;
        const double r = (1 - t) * rest(e, 0) + t * rest(e + 1, 0);
        if (r > options.pad_radius_m) continue;
        const double area = r * (rest.row(e + 1) - rest.row(e)).norm() / parts;
        share(e) += (1 - t) * area;
        share(e + 1) += t * area;
      }
    }
    share /= share.sum();
    shear_pa = options.young_modulus_pa / 3;
    const double s = options.stretch, r0 = options.radius_m / s;
    // Pressure of an inflated Neo-Hookean sphere (e.g. Ogden 1997, Non-linear Elastic Deformations, section 5.3.2).
    over_pa = 2 * shear_pa * options.thickness_m / r0 * (1 / s - std::pow(s, -7));
    volume0 = volume(rest);
    now = rest;
    solve(0);
    unloaded = now;
  }

  static double volume(const MatrixX& x) {
    double sum = 0;
    for (Index e = 0; e + 1 < static_cast<Index>(x.rows()); ++e) {
      const double r = x(e, 0), s = x(e + 1, 0);
      sum += EIGEN_PI / 3 * (x(e, 1) - x(e + 1, 1)) * (r * r + r * s + s * s);
    }
    return sum;
  }
  double pressure(double v) const { return (options.air_pa + over_pa) * volume0 / v - options.air_pa; }
  double air_energy(double v) const {
    return -(options.air_pa + over_pa) * volume0 * std::log(v / volume0) + options.air_pa * (v - volume0);
  }

  double energy(const MatrixX& x, double load_n) const {
    double sum = air_energy(volume(x));
    for (Index e = 0; e + 1 < static_cast<Index>(x.rows()); ++e) sum += skin(x, e, nullptr, nullptr);
    return sum - load_n * share.dot(rest.col(1) - x.col(1));
  }

  double skin(const MatrixX& x, Index e, Vec4* gradient, Mat4* hessian) const {
    const Eigen::RowVector2d along = rest.row(e + 1) - rest.row(e), d = x.row(e + 1) - x.row(e);
    const double length = along.norm(), radius = 0.5 * (rest(e, 0) + rest(e + 1, 0)), around = x(e, 0) + x(e + 1, 0);
    const double s2 = options.stretch * options.stretch, fa = s2 / (length * length), fb = s2 / (4 * radius * radius);
    const Density w = density(fa * d.squaredNorm(), fb * around * around);
    const double scale = shear_pa * options.thickness_m * 2 * EIGEN_PI * radius * length / s2;
    if (gradient == nullptr) return scale * w.value;
    const Vec4 da = 2 * fa * Vec4(-d(0), -d(1), d(0), d(1)), db = 2 * fb * around * Vec4(1, 0, 1, 0);
    *gradient = scale * (w.a * da + w.b * db);
    Mat4 haa = Mat4::Zero(), hbb = Mat4::Zero();
    haa.diagonal().setConstant(2 * fa);
    haa(0, 2) = haa(2, 0) = haa(1, 3) = haa(3, 1) = -2 * fa;
    hbb(0, 0) = hbb(2, 2) = hbb(0, 2) = hbb(2, 0) = 2 * fb;
    *hessian = scale * (w.aa * da * da.transpose() + w.bb * db * db.transpose() +
                        w.ab * (da * db.transpose() + db * da.transpose()) + w.a * haa + w.b * hbb);
    return scale * w.value;
  }

  /// All degrees of freedom, held ones too: r and z of each node in turn.
  VectorX derivatives(const MatrixX& x, double load_n, MatrixX& hessian) const {
    const Index n = static_cast<Index>(x.rows());
    VectorX gradient = VectorX::Zero(2 * n), of_volume = VectorX::Zero(2 * n);
    hessian = MatrixX::Zero(2 * n, 2 * n);
    const double v = volume(x), p = pressure(v);
    for (Index e = 0; e + 1 < n; ++e) {
      Vec4 g;
      Mat4 h;
      skin(x, e, &g, &h);
      const double r = x(e, 0), s = x(e + 1, 0), drop = x(e, 1) - x(e + 1, 1), c = EIGEN_PI / 3;
      const Vec4 gv = c * Vec4(drop * (2 * r + s), r * r + r * s + s * s, drop * (r + 2 * s), -(r * r + r * s + s * s));
      Mat4 hv = Mat4::Zero();
      hv(0, 0) = hv(2, 2) = 2 * drop;
      hv(0, 2) = hv(2, 0) = drop;
      hv(0, 1) = hv(1, 0) = 2 * r + s;
      hv(2, 1) = hv(1, 2) = r + 2 * s;
      hv(0, 3) = hv(3, 0) = -(2 * r + s);
      hv(2, 3) = hv(3, 2) = -(r + 2 * s);
      gradient.segment<4>(2 * e) += g - p * gv;
      of_volume.segment<4>(2 * e) += gv;
      hessian.block<4, 4>(2 * e, 2 * e) += h - p * c * hv;
    }
    hessian += (options.air_pa + over_pa) * volume0 / (v * v) * of_volume * of_volume.transpose();
    for (Index i = 0; i < n; ++i) gradient(2 * i + 1) += load_n * share(i);
    return gradient;
  }

  /// The pole stays on the axis, the last ring on the table.
  std::vector<Index> moving() const {
    std::vector<Index> out;
    for (Index k = 1; k < 2 * static_cast<Index>(rest.rows()) - 2; ++k) out.push_back(k);
    return out;
  }

  void solve(double load_n) {
    const std::vector<Index> free = moving();
    const double scale_n = 2 * EIGEN_PI * options.radius_m * shear_pa * options.thickness_m;
    MatrixX hessian;
    for (int iteration = 0; iteration < 100; ++iteration) {
      const VectorX gradient = derivatives(now, load_n, hessian)(free);
      if (gradient.lpNorm<Eigen::Infinity>() < 1e-11 * scale_n) {
        force = load_n;
        return;
      }
      MatrixX system = hessian(free, free);
      VectorX step;
      for (double shift = 0; shift < 1e6; shift = std::max(1e-4, 10 * shift)) {
        MatrixX shifted = system;
        shifted.diagonal().array() += shift * system.diagonal().cwiseAbs().mean();
        const Eigen::LLT<MatrixX> factor(shifted);
        if (factor.info() != Eigen::Success) continue;
        step = factor.solve(-gradient);
        break;
      }
      if (step.size() == 0) break;
      const double before = energy(now, load_n);
      double length = std::min(1.0, 0.1 * options.radius_m / std::max(1e-12, step.lpNorm<Eigen::Infinity>()));
      MatrixX next;
      bool accepted = false;
      for (int half = 0; half < 40 && !accepted; ++half, length *= 0.5) {
        next = now;
        for (std::size_t k = 0; k < free.size(); ++k) next(free[k] / 2, free[k] % 2) += length * step(static_cast<Index>(k));
        const double after = energy(next, load_n);
        accepted = std::isfinite(after) && after <= before + 1e-12 * std::abs(before);
      }
      if (!accepted) break;
      now = next;
    }
    throw Error("the true balloon found no equilibrium under " + std::to_string(load_n) + " N: press less deep", "PressedBalloon");
  }

  PressedBalloonOptions options;
  MatrixX rest, now, unloaded;  // nodes of the meridian from the pole to the foot: r, z
  VectorX share;                // of the pad's force, a node
  double shear_pa = 0, over_pa = 0, volume0 = 0, force = 0;
};

PressedBalloon::PressedBalloon(const PressedBalloonOptions& options) : impl_(std::make_unique<Impl>(options)) {}
PressedBalloon::~PressedBalloon() = default;
void PressedBalloon::press(double force_n) { impl_->solve(force_n); }
double PressedBalloon::force_n() const { return impl_->force; }
double PressedBalloon::travel_m() const { return impl_->share.dot(impl_->unloaded.col(1) - impl_->now.col(1)); }
Index PressedBalloon::nodes() const { return static_cast<Index>(impl_->rest.rows()); }
double PressedBalloon::pressure_pa() const { return impl_->pressure(Impl::volume(impl_->now)); }

TriMesh PressedBalloon::surface() const {
  const Impl& b = *impl_;
  const Index rings = static_cast<Index>(b.rest.rows()) - 1, sides = b.options.sides;
  TriMesh mesh;
  mesh.vertices_m.resize(rings * sides + 2, 3);
  mesh.triangles.resize(2 * rings * sides, 3);
  const Index pole = rings * sides, foot = pole + 1;
  const MatrixX at = b.rest + b.now - b.unloaded;
  const auto put = [&](Index v, double r, double z, double angle) {
    mesh.vertices_m.row(v) = b.options.base_centre_m + Vec3(r * std::cos(angle), r * std::sin(angle), z);
  };
  put(pole, 0, at(0, 1), 0);
  put(foot, 0, 0, 0);
  for (Index i = 0; i < rings; ++i)
    for (Index k = 0; k < sides; ++k)
      put(i * sides + k, at(i + 1, 0), i + 1 == rings ? 0 : at(i + 1, 1), 2 * EIGEN_PI * static_cast<double>(k) / static_cast<double>(sides));
  Index t = 0;
  for (Index k = 0; k < sides; ++k) {
    const Index next = (k + 1) % sides;
    mesh.triangles.row(t++) << pole, k, next;
    mesh.triangles.row(t++) << foot, (rings - 1) * sides + next, (rings - 1) * sides + k;
    for (Index i = 0; i + 1 < rings; ++i) {
      const Index a = i * sides + k, c = i * sides + next;
      mesh.triangles.row(t++) << a, a + sides, c + sides;
      mesh.triangles.row(t++) << a, c + sides, c;
    }
  }
  return mesh;
}

}  // namespace palpate::lab
