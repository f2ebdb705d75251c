// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/discretisation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::fem {
namespace {

double longest_edge_near(const TetMesh& mesh, const ContactPatch& patch) {
  double longest = 0;
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    double distance = std::numeric_limits<double>::infinity(), edge = 0;
    for (int a = 0; a < 4; ++a) {
      const Vec3 x = mesh.nodes_m.row(mesh.tetrahedra(e, a)).transpose();
      distance = std::min(distance, patch.distance_m(x));
      for (int b = 0; b < a; ++b) edge = std::max(edge, (x - mesh.nodes_m.row(mesh.tetrahedra(e, b)).transpose()).norm());
    }
    if (distance <= patch.radius_m) longest = std::max(longest, edge);
  }
  return longest;
}

}  // namespace

Discretisation discretise(const TetMesh& base, const Vec3& contact_m, double radius_m, const BoundaryOn& boundary_on,
                          const VectorX& force, const DiscretisationOptions& options) {
  return discretise(base, ContactPatch{contact_m, radius_m, Vec3::Zero()}, boundary_on, force, options);
}

Discretisation discretise(const TetMesh& base, const ContactPatch& patch, const BoundaryOn& boundary_on,
                          const VectorX& force, const DiscretisationOptions& options) {
  StaticsOptions statics;
  statics.dilatation = options.dilatation;
  const auto solve = [&](const TetMesh& quadratic, const RefinedMesh& linear) {
    const Boundary boundary = boundary_on(quadratic, linear);
    const Eigen::SparseMatrix<double> forces = boundary.forces;
    const Statics body(quadratic, "linear", boundary, statics);
    const Equilibrium e =
        body.solve(1.0, options.poisson_ratio, force, VectorX::Zero(static_cast<Index>(boundary.motions.cols())));
    return ContactAnswer{force.dot(forces.transpose() * e.displacement_m), e.displacement_m, 0};
  };
  return discretise(base, patch, SolveOn(solve), options);
}

Discretisation discretise(const TetMesh& base, const ContactPatch& given, const SolveOn& solve,
                          const DiscretisationOptions& options) {
  ContactPatch patch = given;
  if (!(patch.radius_m > 0)) throw Error("must be positive, is " + std::to_string(patch.radius_m), "radius_m");
  if (!(options.tolerance > 0))
    throw Error("must be positive, is " + std::to_string(options.tolerance), "options.tolerance");
  // What cameras see, on the corners that all levels share.
  std::vector<Index> seen;
  std::vector<char> counted(static_cast<std::size_t>(base.nodes_m.rows()), 0);
  const Tetrahedra faces = boundary_faces(base);
  for (Index k = 0; k < faces.size(); ++k) {
    const Index node = faces.data()[k];
    if (counted[static_cast<std::size_t>(node)]++) continue;
    if (given.distance_m(base.nodes_m.row(node).transpose()) > given.radius_m) seen.push_back(node);
  }
  VectorX surface(3 * static_cast<Index>(seen.size()));
  const auto work = [&](const RefinedMesh& linear, const TetMesh& quadratic) {
    const ContactAnswer answer = solve(quadratic, linear);
    for (std::size_t i = 0; i < seen.size(); ++i)
      surface.segment<3>(3 * static_cast<Index>(i)) = answer.displacement_m.segment<3>(3 * seen[i]);
    if (answer.patch_radius_m > 0) patch.radius_m = answer.patch_radius_m;
    return answer.depth_m;
  };

  Discretisation out;
  out.linear = {base, {}};
  out.mesh = to_quadratic(base);
  double last = work(out.linear, out.mesh);
  if (!(std::abs(last) > 0)) throw Error("does no work: is the force zero or held by the supports?", "force");
  // The first level already resolves the disc: quadratic tetrahedra need about two edges a radius.
  double edge = std::min(longest_edge_near(base, patch) / 2, patch.radius_m);
  double change = 0;
  const double base_work = last;
  double growth = 0.5;
  for (int level = 1; level <= options.max_levels; ++level, edge /= 2, growth *= 0.7) {
    RefinedMesh finer = refine_near(
        base, [&](const Vec3& x) { return patch.distance_m(x) - 1.2 * patch.radius_m; }, edge, growth, options.node_limit);
    const bool full = finer.mesh.nodes_m.rows() >= options.node_limit;
    if (full && level > 1) break;
    TetMesh quadratic = to_quadratic(finer.mesh);
    const VectorX last_surface = surface;
    const double now = work(finer, quadratic);
    out.surface_change = surface.norm() > 0 ? (surface - last_surface).norm() / surface.norm() : 0;
    const double previous_change = change;
    change = std::abs(now - last) / std::abs(now);
    const double ratio = level == 1 ? 1.0 / 3 : std::clamp(change / std::max(previous_change, 1e-12), 0.2, 0.67);
    out.young_error = change * ratio / (1 - ratio);
    out.base_young_error = std::abs(base_work - now) / std::abs(now);
    out.linear = std::move(finer);
    out.mesh = std::move(quadratic);
    out.levels = level;
    last = now;
    if (out.young_error <= options.tolerance && (level > 1 || full)) {
      out.tolerance_met = true;
      break;
    }
    if (full) break;
  }
  out.edge_m = longest_edge_near(out.linear.mesh, patch);
  return out;
}

}  // namespace palpate::fem
