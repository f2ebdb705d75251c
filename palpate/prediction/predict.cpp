// SPDX-License-Identifier: Apache-2.0
#include "palpate/prediction/predict.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

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

/// Standard deviation of a quantity with these derivatives to the moduli.
double std_of(const VectorX& d, const MatrixX& covariance) { return std::sqrt(std::max(0.0, d.dot(covariance * d))); }

/// The patch's mean motion along the push, work-conjugate to its force.
double travel_of(const fem::ResponseState& state, const Vec3& direction) { return direction.dot(state.conjugate_m.head<3>()); }
VectorX d_travel_of(const fem::ResponseState& state, const Vec3& direction) {
  return state.d_conjugate.topRows<3>().transpose() * direction;
}

}  // namespace

double Elasticity::young_modulus_of(Index of) const { return region_stiffness(of) * young_modulus_pa; }

double Elasticity::poisson_ratio_of(Index of) const {
  return of > 0 && region_poisson.size() > 0 ? region_poisson(of) : poisson_ratio;
}

double Elasticity::highest_young_modulus_pa() const {
  return young_modulus_pa * (region_stiffness.size() > 0 ? std::max(1.0, region_stiffness.maxCoeff()) : 1.0);
}

double Elasticity::highest_poisson_ratio() const {
  return region_poisson.size() > 1 ? std::max(poisson_ratio, region_poisson.tail(region_poisson.size() - 1).maxCoeff()) : poisson_ratio;
}

Elasticity elasticity_of(const Identification& answer) {
  Elasticity elasticity;
  elasticity.material = answer.material;
  std::vector<Index> young, poisson;  // places among the parameters
  std::vector<double> extra;
  const auto value = [&](Index at) { return answer.parameters[static_cast<std::size_t>(at)].value; };
  for (std::size_t i = 0; i < answer.parameters.size(); ++i) {
    const Parameter& one = answer.parameters[i];
    if (one.name == "young_modulus")
      young.push_back(static_cast<Index>(i));
    else if (one.name == "poisson_ratio")
      poisson.push_back(static_cast<Index>(i));
    else if (one.region.empty())
      extra.push_back(one.value);
  }
  if (young.empty() || poisson.empty() || (poisson.size() > 1 && poisson.size() != young.size()))
    throw Error("holds no Young's modulus and Poisson ratio of the whole object, or of all its regions", "result: parameters");
  const Index regions = static_cast<Index>(young.size());
  elasticity.young_modulus_pa = value(young[0]);
  elasticity.poisson_ratio = value(poisson[0]);
  if (regions > 1) {
    elasticity.region_stiffness.resize(regions);
    for (Index r = 0; r < regions; ++r) {
      const Index at = young[static_cast<std::size_t>(r)];
      elasticity.regions.push_back(answer.parameters[static_cast<std::size_t>(at)].region);
      elasticity.region_stiffness(r) = value(at) / elasticity.young_modulus_pa;
    }
  }
  if (poisson.size() > 1) {
    elasticity.region_poisson = VectorX::Constant(regions, std::numeric_limits<double>::quiet_NaN());
    for (Index r = 1; r < regions; ++r) elasticity.region_poisson(r) = value(poisson[static_cast<std::size_t>(r)]);
  }
  elasticity.extra = Eigen::Map<const VectorX>(extra.data(), Index(extra.size()));
  // Of log E of each region, as an answer has it, to ratios.
  std::vector<Index> places{young[0], poisson[0]};
  places.insert(places.end(), young.begin() + 1, young.end());
  places.insert(places.end(), poisson.begin() + 1, poisson.end());
  const Index size = static_cast<Index>(places.size());
  elasticity.covariance = MatrixX::Zero(size, size);
  if (*std::max_element(places.begin(), places.end()) >= answer.covariance.rows()) return elasticity;
  MatrixX over_first = MatrixX::Identity(size, size);
  over_first.block(2, 0, regions - 1, 1).setConstant(-1);
  elasticity.covariance = over_first * MatrixX(answer.covariance(places, places)) * over_first.transpose();
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
  if (elasticity.region_stiffness.size() > 0 && static_cast<Index>(elasticity.region.size()) != static_cast<Index>(mesh.tetrahedra.rows()))
    throw Error("needs one region an element", "elasticity.region");
  fem::Response::Options response_options;
  response_options.statics = std::move(options);
  if (elasticity.region_stiffness.size() > 0) response_options.statics.region = elasticity.region;
  response_options.statics.region_stiffness = elasticity.region_stiffness;
  response_options.statics.region_poisson = elasticity.region_poisson;
  const fem::Response response(mesh, elasticity.material, std::move(boundary),
                               Eigen::SparseMatrix<double>(0, 3 * mesh.nodes_m.rows()), response_options);
  const double e = elasticity.young_modulus_pa, nu = elasticity.poisson_ratio;

  Prediction out;
  fem::ResponseQuery query{e, nu, VectorX::Zero(columns), VectorX::Zero(motions)};
  query.extra = elasticity.extra;
  if (push.background.size() > 0) query.force.tail(columns - 3) = push.background;
  // Derivatives: the moduli, the push's force.
  fem::LoadDirections pushing{MatrixX::Zero(columns, 1), MatrixX::Zero(motions, 1)};
  pushing.force.col(0).head(3) = push.direction;
  query.along = pushing;
  const Index moduli = static_cast<Index>(elasticity.covariance.rows()), by_force = moduli;
  const auto fail = [&](const fem::ResponseState& at) {
    out.reason = at.reason;
    return out;
  };
  // The state from which the push starts: under the background alone.
  const fem::ResponseState before = response.solve(query);
  if (!before.converged) return fail(before);
  if (before.parameters != moduli) throw Error("has not one row and column for each of the moduli", "elasticity.covariance");
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

  // Derivatives to the moduli of the displacement since the start; with the travel imposed, the force gives way so that it stays.
  const double travel_m = travel_of(at, push.direction) - start_m;
  MatrixX whole = at.solution->derivative.leftCols(moduli);  // of the displacement from rest: what stress depends on
  MatrixX d = whole - before.solution->derivative.leftCols(moduli);
  VectorX d_travel = (d_travel_of(at, push.direction) - d_travel_of(before, push.direction)).head(moduli);
  VectorX d_force = VectorX::Zero(moduli);
  if (push.travel_m) {
    d_force = -d_travel / compliance_m_n;
    const MatrixX gives_way = at.solution->derivative.col(by_force) * d_force.transpose();
    d += gives_way;
    whole += gives_way;
    d_travel.setZero();
  }
  const MatrixX& covariance = elasticity.covariance;
  out.converged = true;
  out.reason = at.reason;
  out.inverted_elements = at.inverted_elements;
  out.force_n = positive_band(force_n, std_of(d_force, covariance));
  out.travel_m = positive_band(travel_m, std_of(d_travel, covariance));
  const VectorX& displaced_m = at.solution->displacement_m;
  out.displacement_m = displaced_m - before.solution->displacement_m;
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
  out.stiffness_n_m = 1 / compliance_m_n;
  return out;
}

}  // namespace palpate::prediction
