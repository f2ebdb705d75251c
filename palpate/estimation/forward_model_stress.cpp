// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/fem/von_mises.hpp"

namespace palpate::estimation {

VectorX ForwardModel::von_mises_pa(std::size_t s, const VectorX& unknowns) {
  const double young_pa = std::exp(unknowns(log_young));
  const Memory& memory = memory_[s];
  VectorX displacement_m;
  if (memory.valid && memory.unknowns == unknowns) {
    displacement_m = memory.displacement_m;
  } else if (Body& body = body_of(push(s), worker_of(s)); body.contact) {
    if (!predict(s, unknowns, false).converged) return {};
    displacement_m = memory.displacement_m;
  } else {
    const Coefficients c = coefficients(s, body, unknowns);
    set_ratios(body, unknowns);
    VectorX start;
    if (memory.valid) start = memory.displacement_m + memory.derivative * memory.change_to(unknowns);
    // Along the derivatives the square of the share is lost: a hundredth of the motion at most, which no picture shows.
    constexpr double far = 0.1;
    const bool near = memory.valid && !memory.columns.empty() &&
                      (start - memory.displacement_m).lpNorm<Eigen::Infinity>() <= far * start.lpNorm<Eigen::Infinity>();
    if (near) {
      displacement_m = start;
    } else {
      const auto at =
          body.statics->solve(young_pa, unknowns(poisson), c.force, c.motion, memory.valid ? &start : nullptr);
      if (!at.converged) return {};
      displacement_m = at.displacement_m;
    }
  }
  VectorX stiffness;
  if (parameters_ > first_ratio) {
    stiffness = VectorX::Ones(object_.mesh.tetrahedra.rows());
    for (Index e = 0; e < stiffness.size(); ++e) {
      const int region = object_.region[static_cast<std::size_t>(e)];
      if (region > 0) stiffness(e) = std::exp(unknowns(first_ratio + region - 1));
    }
  }
  const VectorX at_nodes =
      fem::von_mises(object_.mesh, object_.material, young_pa, unknowns(poisson), {}, displacement_m, stiffness);
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
