// SPDX-License-Identifier: Apache-2.0
#include "palpate/prediction/predict.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/fem/von_mises.hpp"
#include "palpate/prediction/pressed_body.hpp"

namespace palpate::prediction {
namespace {

constexpr double quantile_975 = 1.959963984540054;

/// A positive quantity whose logarithm is normal.
Band positive_band(double value, double std) {
  const double log_std = value != 0 ? std / std::abs(value) : 0;
  const double a = value * std::exp(-quantile_975 * log_std), b = value * std::exp(quantile_975 * log_std);
  return {value, std, std::min(a, b), std::max(a, b)};
}

/// Standard deviation of a quantity with these derivatives to the moduli.
double std_of(const VectorX& d, const MatrixX& covariance) { return std::sqrt(std::max(0.0, d.dot(covariance * d))); }

/// What is asked of the push: that its force or its travel is so much.
class Target {
 public:
  explicit Target(const NewPush& push) : of_force_(push.force_n.has_value()), value_(of_force_ ? *push.force_n : *push.travel_m) {}
  const Reading& of(const PressedState& at) const { return of_force_ ? at.force_n : at.travel_m; }
  bool of_force() const { return of_force_; }
  double value() const { return value_; }

 private:
  bool of_force_;
  double value_;
};

/// Newton's method on what drives the push, with the exact slope of each state.
/// @return why nothing was found; empty: `at` is the state, driven by `control`
std::string find(const PressedBody& body, const Target& target, PressedState& at) {
  constexpr int most_corrections = 30;
  const bool given = body.drives(target.of_force());
  // What touches is known to less, and the further the tool goes the stiffer it gets: it goes on by a few times at most.
  const double close = body.touches() ? 1e-6 * target.value() : 1e-9 * (target.of_force() ? target.value() : std::max(1e-6, target.value()));
  constexpr double furthest = 4;
  double control = given ? target.value() : body.first_guess(target.of_force(), target.value(), at), stood = 0;
  for (int k = 0; k < most_corrections; ++k) {
    PressedState next = body.solve(control, at);
    if (!next.converged) {
      if (given || k + 1 == most_corrections) return next.reason;
      control = 0.5 * (control + stood);  // half the way from the last that stood
      continue;
    }
    at = std::move(next);
    stood = control;
    if (given) return {};
    const Reading& reached = target.of(at);
    const double short_of = target.value() - reached.value, slope = reached.by_control();
    if (std::abs(short_of) < close) return {};
    if (body.touches()) {
      const double asked = slope > 0 ? control + short_of / slope : furthest * control;
      control = std::clamp(asked, control / furthest, control * furthest);
    } else {
      control += short_of / slope;
    }
  }
  return target.of_force() ? "no travel was found at which the tool presses so hard" : "no force was found that moves the patch so far";
}

}  // namespace

Prediction predict(const TetMesh& mesh, const Elasticity& elasticity, fem::Boundary boundary, const NewPush& push,
                   fem::StaticsOptions options, Surroundings around) {
  if (push.force_n.has_value() == push.travel_m.has_value())
    throw Error("give either the force or the travel of the push", "push");
  if (std::abs(push.direction.norm() - 1) > 1e-6) throw Error("must have unit length", "push.direction");
  if (elasticity.region_stiffness.size() > 0 && static_cast<Index>(elasticity.region.size()) != static_cast<Index>(mesh.tetrahedra.rows()))
    throw Error("needs one region an element", "elasticity.region");
  const Index moduli = static_cast<Index>(elasticity.covariance.rows());
  const PressedBody body(mesh, elasticity, std::move(boundary), push, std::move(options), std::move(around));
  const Target target(push);

  Prediction out;
  // The state from which the push starts: under the background alone.
  const PressedState before = body.before();
  out.reason = before.reason;
  if (!before.converged) return out;
  PressedState at = before;
  out.reason = find(body, target, at);
  if (!out.reason.empty()) return out;

  // Derivatives to the moduli; what was asked for stays, so what drives the push gives way.
  VectorX gives_way = VectorX::Zero(moduli);
  if (!body.drives(target.of_force())) gives_way = -target.of(at).by_moduli() / target.of(at).by_control();
  const auto with_control = [&](const MatrixX& d) { return MatrixX(d.leftCols(moduli) + d.col(moduli) * gives_way.transpose()); };
  const auto of_reading = [&](const Reading& one) -> VectorX {
    if (&one == &target.of(at)) return VectorX::Zero(moduli);
    return one.by_moduli() + one.by_control() * gives_way;
  };
  const MatrixX whole = with_control(at.d_displacement);  // of the displacement from rest: what stress depends on
  const RigidWay& whole_way = body.gives_way();
  MatrixX d = whole - before.d_displacement.leftCols(moduli);
  const MatrixX& covariance = elasticity.covariance;
  out.converged = true;
  out.reason = at.reason;
  out.inverted_elements = at.inverted_elements;
  out.force_n = positive_band(at.force_n.value, std_of(of_reading(at.force_n), covariance));
  out.travel_m = positive_band(at.travel_m.value, std_of(of_reading(at.travel_m), covariance));
  out.pressed_n = at.pressed_n;
  const VectorX& displaced_m = at.displacement_m;
  out.displacement_m = displaced_m - before.displacement_m;
  if (whole_way.moves()) {
    const MatrixX d_pressed = with_control(at.d_pressed);
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
      const Mat3 way = whole_way.at(mesh.nodes_m.row(i));
      out.displacement_m.segment<3>(3 * i) += way * at.pressed_n;
      d.middleRows<3>(3 * i) += way * d_pressed;
    }
  }
  out.displacement_std_m.resize(out.displacement_m.size());
  for (Eigen::Index i = 0; i < out.displacement_m.size(); ++i) out.displacement_std_m(i) = std_of(d.row(i).transpose(), covariance);

  // Stress: differences along the exact derivative of the state.
  const auto stress = [&](Index moved, double step) {
    Elasticity there = elasticity;
    if (moved == 0) there.young_modulus_pa *= std::exp(step);
    if (moved == 1) there.poisson_ratio += step;
    const Index ratios = static_cast<Index>(elasticity.regions.size()) - 1, own = moved - 2 - ratios;
    if (moved >= 2 && own < 0) there.region_stiffness(moved - 1) *= std::exp(step);
    if (moved >= 2 && own >= 0) there.region_poisson(1 + own) += step;
    VectorX stiffness, poisson;
    if (there.region_stiffness.size() > 0) stiffness = there.region_stiffness(there.region);
    if (there.region_poisson.size() > 0) {
      there.region_poisson(0) = there.poisson_ratio;
      poisson = there.region_poisson(there.region);
    }
    return fem::von_mises(mesh, elasticity.material, there.young_modulus_pa, there.poisson_ratio, elasticity.extra,
                          displaced_m + step * whole.col(moved), stiffness, poisson);
  };
  out.von_mises_pa = stress(0, 0);
  MatrixX d_stress(out.von_mises_pa.size(), moduli);
  for (Index k = 0; k < moduli; ++k) {
    const bool is_poisson = k == 1 || k >= 1 + std::max<Index>(1, static_cast<Index>(elasticity.regions.size()));
    const double step = is_poisson ? 1e-5 : 1e-4;
    d_stress.col(k) = (stress(k, step) - stress(k, -step)) / (2 * step);
  }
  out.von_mises_std_pa.resize(out.von_mises_pa.size());
  for (Eigen::Index i = 0; i < out.von_mises_pa.size(); ++i) out.von_mises_std_pa(i) = std_of(d_stress.row(i).transpose(), covariance);
  Eigen::Index most = 0;
  out.von_mises_pa.maxCoeff(&most);
  out.largest_von_mises_pa = positive_band(out.von_mises_pa(most), out.von_mises_std_pa(most));
  double largest = -1;
  for (Eigen::Index i = 0; i + 2 < out.displacement_m.size(); i += 3) {
    const Vec3 u = out.displacement_m.segment<3>(i);
    if (u.norm() <= largest) continue;
    largest = u.norm();
    const Vec3 way = largest > 0 ? Vec3(u / largest) : Vec3(Vec3::Zero());
    out.largest_displacement_m = positive_band(largest, std_of(d.middleRows<3>(i).transpose() * way, covariance));
  }
  out.stiffness_n_m = at.force_n.by_control() / at.travel_m.by_control();
  return out;
}

}  // namespace palpate::prediction
