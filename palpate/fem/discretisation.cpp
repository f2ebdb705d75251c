// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/discretisation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::fem {
namespace {

// The error left after two changes, where it falls as C h^p: (h0^p - h1^p) / (h1^p - h2^p) is the changes' ratio. Orders
// beyond 2 are not believed: then the second change is small by chance, and the first one says what is left. Or the first is a
// coarse mesh's that says nothing. The depth alone does not tell; where the area of the contact came to rest too, no chance is
// at work (`settled`), and the error lies between what the first change says and what the second promises at order 2.
double error_left(double first_change, double change, double h0, double h1, double h2, bool settled) {
  const auto left = [&](double p) { return change / (std::pow(h1 / h2, p) - 1); };
  const auto excess = [&](double p) {
    return (std::pow(h0, p) - std::pow(h1, p)) * change - (std::pow(h1, p) - std::pow(h2, p)) * first_change;
  };
  double low = 0.6, high = 2;
  if (excess(low) >= 0) return left(low);  // slower still
  if (excess(high) <= 0) {
    const double by_first = first_change * std::pow(h2, high) / (std::pow(h0, high) - std::pow(h1, high));
    return settled ? std::sqrt(by_first * left(high)) : by_first;
  }
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) < 0 ? low : high) = middle;
  }
  return left(low);
}

}  // namespace

double longest_edge_near(const TetMesh& mesh, const ContactPatch& patch) {
  double longest = 0, nearest_m = std::numeric_limits<double>::infinity(), of_nearest = 0;
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    double distance = std::numeric_limits<double>::infinity(), edge = 0;
    for (int a = 0; a < 4; ++a) {
      const Vec3 x = mesh.nodes_m.row(mesh.tetrahedra(e, a)).transpose();
      distance = std::min(distance, patch.distance_m(x));
      for (int b = 0; b < a; ++b) edge = std::max(edge, (x - mesh.nodes_m.row(mesh.tetrahedra(e, b)).transpose()).norm());
    }
    if (distance <= patch.radius_m) longest = std::max(longest, edge);
    if (distance < nearest_m) nearest_m = distance, of_nearest = edge;
  }
  return longest > 0 ? longest : of_nearest;
}

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
    return ContactAnswer{force.dot(forces.transpose() * e.displacement_m), e.displacement_m, 0, 0};
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
  double area_m2 = 0;
  const auto work = [&](const RefinedMesh& linear, const TetMesh& quadratic) {
    const ContactAnswer answer = solve(quadratic, linear);
    for (std::size_t i = 0; i < seen.size(); ++i)
      surface.segment<3>(3 * static_cast<Index>(i)) = answer.displacement_m.segment<3>(3 * seen[i]);
    // A mesh that is much coarser than the patch finds a few points of it, and no radius.
    if (longest_edge_near(linear.mesh, patch) <= 2 * answer.patch_radius_m) patch.radius_m = answer.patch_radius_m;
    area_m2 = answer.patch_area_m2;
    return answer.depth_m;
  };

  Discretisation out;
  out.linear = {base, {}};
  out.mesh = to_quadratic(base);
  double last = work(out.linear, out.mesh);
  if (!(std::abs(last) > 0)) throw Error("does no work: is the force zero or held by the supports?", "force");
  // The first level already resolves the disc: quadratic tetrahedra need about two edges a radius.
  const double base_edge = longest_edge_near(base, patch);
  double edge = std::min(base_edge / 2, patch.radius_m);
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
    const double last_area_m2 = area_m2;
    const double now = work(finer, quadratic);
    out.surface_change = surface.norm() > 0 ? (surface - last_surface).norm() / surface.norm() : 0;
    const double previous_change = change;
    change = std::abs(now - last) / std::abs(now);
    const bool settled = area_m2 > 0 && std::abs(area_m2 - last_area_m2) <= options.tolerance * area_m2;
    out.young_error = level == 1 ? change / 2
                                 : error_left(previous_change, change, level == 2 ? base_edge : 4 * edge, 2 * edge, edge, settled);
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
