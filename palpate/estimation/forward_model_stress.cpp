// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/fem/von_mises.hpp"

namespace palpate::estimation {

VectorX ForwardModel::von_mises_pa(std::size_t s, const VectorX& unknowns) {
  const double young_pa = std::exp(unknowns(log_young));
  const SolvedAtPtr known = memory_[s].seen;
  VectorX displacement_m;
  if (known && known->unknowns.size() == unknowns.size() && known->unknowns == unknowns) {
    displacement_m = known->state.solution->displacement_m;
  } else if (contact_) {
    if (!predict(s, unknowns, false).converged) return {};
    displacement_m = memory_[s].seen->state.solution->displacement_m;
  } else {
    VectorX guess_m;
    if (known) {
      guess_m = known->state.solution->displacement_m;
      if (known->differentiated()) guess_m += known->state.solution->derivative * known->change_to(unknowns);
    }
    // Along the derivatives the square of the share is lost: a hundredth of the motion at most, which no picture shows.
    constexpr double far = 0.1;
    const bool near = known && known->differentiated() &&
                      (guess_m - known->state.solution->displacement_m).lpNorm<Eigen::Infinity>() <=
                          far * guess_m.lpNorm<Eigen::Infinity>();
    if (near) {
      displacement_m = guess_m;
    } else {
      const Body& body = body_of(push(s), worker_of(s));
      fem::ResponseStart start;
      if (known) start.displacement_m = &guess_m;
      const fem::ResponseState at = body.response->solve(query(coefficients(s, body, unknowns), unknowns, false), start);
      if (!at.converged) return {};
      displacement_m = at.solution->displacement_m;
    }
  }
  const VectorX of_region = region_stiffness(unknowns), nu_of_region = region_poisson(unknowns);
  VectorX stiffness, nu;  // an element
  if (of_region.size() > 0) stiffness = of_region(object_.region);
  if (nu_of_region.size() > 0) {
    nu = nu_of_region(object_.region);
    nu = nu.array().isNaN().select(unknowns(poisson), nu);
  }
  const VectorX at_nodes =
      fem::von_mises(object_.mesh, object_.material, young_pa, unknowns(poisson), {}, displacement_m, stiffness, nu);
  // The surface hangs on the nodes by weights that serve any nodal field: stresses travel as first components.
  VectorX carried = VectorX::Zero(3 * at_nodes.size());
  for (Index n = 0; n < at_nodes.size(); ++n) carried(3 * n) = at_nodes(n);
  const MatrixX on_surface = object_.surface.restrict(carried);
  VectorX out(object_.surface.vertex_count());
  // Quadratic shape functions may undershoot between nodes; a von Mises stress is never negative.
  for (Index v = 0; v < out.size(); ++v) out(v) = std::max(0.0, on_surface(3 * v, 0));
  return out;
}

}  // namespace palpate::estimation
