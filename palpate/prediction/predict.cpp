// SPDX-License-Identifier: Apache-2.0
#include "palpate/prediction/predict.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/response.hpp"
#include "palpate/fem/von_mises.hpp"

namespace palpate::prediction {
namespace {

constexpr double quantile_975 = 1.959963984540054;

/// A positive quantity whose logarithm is normal.
Band positive_band(double value, double std) {
  const double log_std = value != 0 ? std / std::abs(value) : 0;
  const double a = value * std::exp(-quantile_975 * log_std), b = value * std::exp(quantile_975 * log_std);
  return {value, std, std::min(a, b), std::max(a, b)};
}

/// Standard deviation of a quantity with these derivatives to (log E, nu).
double std_of(double d_log_young, double d_poisson, const Eigen::Matrix2d& covariance) {
  const Eigen::Vector2d d(d_log_young, d_poisson);
  return std::sqrt(std::max(0.0, d.dot(covariance * d)));
}

/// The patch's mean motion along the push, work-conjugate to its force.
double travel_of(const fem::ResponseState& state, const Vec3& direction) { return direction.dot(state.conjugate_m.head<3>()); }
VectorX d_travel_of(const fem::ResponseState& state, const Vec3& direction) {
  return state.d_conjugate.topRows<3>().transpose() * direction;
}

}  // namespace

Elasticity elasticity_of(const Identification& answer) {
  Elasticity elasticity;
  elasticity.material = answer.material;
  int young = -1, poisson = -1;
  std::vector<double> extra;
  for (std::size_t i = 0; i < answer.parameters.size(); ++i) {
    const Parameter& parameter = answer.parameters[i];
    if (!parameter.region.empty()) continue;
    if (parameter.name == "young_modulus") {
      young = int(i);
      elasticity.young_modulus_pa = parameter.value;
    } else if (parameter.name == "poisson_ratio") {
      poisson = int(i);
      elasticity.poisson_ratio = parameter.value;
    } else {
      extra.push_back(parameter.value);
    }
  }
  const bool by_region = std::any_of(answer.parameters.begin(), answer.parameters.end(), [](const Parameter& parameter) {
    return parameter.name == "young_modulus" && !parameter.region.empty();
  });
  if (young < 0 && by_region)
    throw Error("E was estimated by region, and only objects of one stiffness are taken on so far: estimate it without regions, or "
                "take the moduli and elements from model/object.vtu",
                "result: regions");
  if (young < 0 || poisson < 0)
    throw Error("holds no Young's modulus and Poisson ratio of the whole object", "result: parameters");
  elasticity.extra = Eigen::Map<const VectorX>(extra.data(), Index(extra.size()));
  const Eigen::Index size = answer.covariance.rows();
  const int index[] = {young, poisson};
  for (int a = 0; a < 2; ++a)
    for (int b = 0; b < 2; ++b)
      if (index[a] < size && index[b] < size) elasticity.covariance(a, b) = answer.covariance(index[a], index[b]);
  if (!elasticity.covariance.allFinite()) elasticity.covariance.setZero();
  return elasticity;
}

Prediction predict(const TetMesh& mesh, const Elasticity& elasticity, fem::Boundary boundary, const NewPush& push,
                   fem::StaticsOptions options) {
  if (push.force_n.has_value() == push.travel_m.has_value())
    throw Error("give either the force or the travel of the push", "push");
  if (std::abs(push.direction.norm() - 1) > 1e-6) throw Error("must have unit length", "push.direction");
  if (boundary.forces.cols() < 3) throw Error("needs three columns for the patch", "boundary.forces");
  const Eigen::Index columns = boundary.forces.cols(), motions = boundary.motions.cols();
  if (push.background.size() != 0 && push.background.size() != columns - 3)
    throw Error("has another size than the boundary's other columns", "push.background");
  fem::Response::Options response_options;
  response_options.statics = std::move(options);
  const fem::Response response(mesh, elasticity.material, std::move(boundary),
                               Eigen::SparseMatrix<double>(0, 3 * mesh.nodes_m.rows()), response_options);
  const double e = elasticity.young_modulus_pa, nu = elasticity.poisson_ratio;

  Prediction out;
  fem::ResponseQuery query{e, nu, VectorX::Zero(columns), VectorX::Zero(motions)};
  query.extra = elasticity.extra;
  if (push.background.size() > 0) query.force.tail(columns - 3) = push.background;
  // Derivatives: log E, nu, the push's force.
  fem::LoadDirections pushing{MatrixX::Zero(columns, 1), MatrixX::Zero(motions, 1)};
  pushing.force.col(0).head(3) = push.direction;
  query.along = pushing;
  constexpr Index by_young = 0, by_poisson = 1, by_force = 2;
  const auto fail = [&](const fem::ResponseState& at) {
    out.reason = at.reason;
    return out;
  };
  // The state from which the push starts: under the background alone.
  const fem::ResponseState before = response.solve(query);
  if (!before.converged) return fail(before);
  const double start_m = travel_of(before, push.direction);

  // Travel imposed: Newton on the force, with the exact compliance of each state.
  double force_n = push.force_n.value_or(0);
  if (push.travel_m) force_n = *push.travel_m / d_travel_of(before, push.direction)(by_force);
  fem::ResponseState at = before;
  double stood_n = 0, compliance_m_n = 0;  // stood_n: the force of `at`
  constexpr int most_corrections = 30;
  for (int k = 0; k < most_corrections; ++k) {
    query.force.head(3) = force_n * push.direction;
    fem::ResponseStart start;
    start.displacement_m = &at.solution->displacement_m;
    const fem::ResponseState next = response.solve(query, start);
    if (!next.converged) {
      if (!push.travel_m || k + 1 == most_corrections) return fail(next);
      force_n = 0.5 * (force_n + stood_n);  // half the way from the last that stood
      continue;
    }
    at = next;
    stood_n = force_n;
    compliance_m_n = d_travel_of(at, push.direction)(by_force);
    if (!push.travel_m) break;
    const double short_m = *push.travel_m - (travel_of(at, push.direction) - start_m);
    if (std::abs(short_m) < 1e-9 * std::max(1e-6, std::abs(*push.travel_m))) break;
    if (k + 1 == most_corrections) {
      out.reason = "no force was found that moves the patch so far";
      return out;
    }
    force_n += short_m / compliance_m_n;
  }

  // Derivatives to (log E, nu) of the displacement since the start; with the travel imposed, the force gives way so that it
  // stays.
  const double travel_m = travel_of(at, push.direction) - start_m;
  const MatrixX& change = at.solution->derivative;
  const MatrixX& from = before.solution->derivative;
  VectorX whole[2] = {change.col(by_young), change.col(by_poisson)};  // of the displacement from rest: what stress depends on
  VectorX d[2] = {whole[0] - from.col(by_young), whole[1] - from.col(by_poisson)};
  const VectorX d_way = d_travel_of(at, push.direction) - d_travel_of(before, push.direction);
  double d_force[2] = {0, 0}, d_travel[2];
  const VectorX push_column = change.col(by_force);
  for (int p = 0; p < 2; ++p) {
    d_travel[p] = d_way(p);
    if (!push.travel_m) continue;
    d_force[p] = -d_travel[p] / compliance_m_n;
    d[p] += d_force[p] * push_column;
    whole[p] += d_force[p] * push_column;
    d_travel[p] = 0;
  }
  const Eigen::Matrix2d& covariance = elasticity.covariance;
  out.converged = true;
  out.reason = at.reason;
  out.inverted_elements = at.inverted_elements;
  out.force_n = positive_band(force_n, std_of(d_force[0], d_force[1], covariance));
  out.travel_m = positive_band(travel_m, std_of(d_travel[0], d_travel[1], covariance));
  const VectorX& displaced_m = at.solution->displacement_m;
  out.displacement_m = displaced_m - before.solution->displacement_m;
  out.displacement_std_m.resize(out.displacement_m.size());
  for (Eigen::Index i = 0; i < out.displacement_m.size(); ++i)
    out.displacement_std_m(i) = std_of(d[0](i), d[1](i), covariance);

  // Stress and stiffness: differences along the exact derivative of the state, over a tenth of a standard deviation.
  const auto stress = [&](double log_step, double nu_step, double sign) {
    const VectorX u = displaced_m + sign * (log_step * whole[0] + nu_step * whole[1]);
    return fem::von_mises(mesh, elasticity.material, e * std::exp(sign * log_step), nu + sign * nu_step, elasticity.extra, u);
  };
  out.von_mises_pa = stress(0, 0, 1);
  const double log_step = 1e-4, nu_step = 1e-5;
  const VectorX d_stress_young = (stress(log_step, 0, 1) - stress(log_step, 0, -1)) / (2 * log_step);
  const VectorX d_stress_poisson = (stress(0, nu_step, 1) - stress(0, nu_step, -1)) / (2 * nu_step);
  out.von_mises_std_pa.resize(out.von_mises_pa.size());
  for (Eigen::Index i = 0; i < out.von_mises_pa.size(); ++i)
    out.von_mises_std_pa(i) = std_of(d_stress_young(i), d_stress_poisson(i), covariance);
  Eigen::Index most = 0;
  out.von_mises_pa.maxCoeff(&most);
  out.largest_von_mises_pa = positive_band(out.von_mises_pa(most), out.von_mises_std_pa(most));
  double largest = -1;
  for (Eigen::Index i = 0; i + 2 < out.displacement_m.size(); i += 3) {
    const Vec3 u = out.displacement_m.segment<3>(i);
    if (u.norm() <= largest) continue;
    largest = u.norm();
    const Vec3 way = largest > 0 ? Vec3(u / largest) : Vec3(Vec3::Zero());
    out.largest_displacement_m =
        positive_band(largest, std_of(way.dot(d[0].segment<3>(i)), way.dot(d[1].segment<3>(i)), covariance));
  }
  out.stiffness_n_m = 1 / compliance_m_n;
  return out;
}

}  // namespace palpate::prediction
