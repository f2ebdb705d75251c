// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/statics/static_system.hpp"

#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::fem {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

// Share of the boundary that a uniform pressure gives each node: a third of a face to its corners, or to its midpoints where
// it has some (the corners of a quadratic face then carry none of it).
VectorX surface_shares(const TetMesh& mesh) {
  VectorX area = VectorX::Zero(mesh.nodes_m.rows());
  const Tetrahedra faces = boundary_faces(mesh);
  for (Index f = 0; f < faces.rows(); ++f) {
    const Vec3 a = mesh.nodes_m.row(faces(f, 0)), b = mesh.nodes_m.row(faces(f, 1)), c = mesh.nodes_m.row(faces(f, 2));
    const double third = (b - a).cross(c - a).norm() / 6;
    for (int k = 0; k < 3; ++k) area(faces(f, faces.cols() == 6 ? 3 + k : k)) += third;
  }
  return area;
}

}  // namespace

StaticSystem::StaticSystem(const TetMesh& mesh_in, const std::string& material, Boundary boundary_in,
                           StaticsOptions options_in)
    : mesh(mesh_in),
      law(material_law(material)),
      options(options_in),
      assembly(mesh_in, options_in.dilatation, options_in.region),
      boundary(checked(mesh_in, std::move(boundary_in))),
      free(boundary.inertia_relief),
      system(assembly.pattern(), boundary.constraints,
             free ? mass_times(mesh_in, rigid_motions(mesh_in.nodes_m)) : MatrixX::Zero(3 * mesh_in.nodes_m.rows(), 0),
             mesh_in.nodes_m, options_in.threads, law.is_linear() ? options_in.loads_expected : 0) {
  if (!free) check_supported(mesh, boundary.constraints);
  motions = MatrixX(boundary.motions);
  for (Index k = 0; k < motions.cols(); ++k) motions.col(k) = system.prescribed_part(motions.col(k));
  node_area_m2 = surface_shares(mesh);
  diameter_m = (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).norm();
  if (options.region_stiffness.size() > 0) assembly.set_region_stiffness(options.region_stiffness);
  if (options.region_poisson.size() > 0) assembly.set_region_poisson(options.region_poisson);
  assemble_linear();
}

void StaticSystem::assemble_linear() {
  if (!law.is_linear() || assembly.is_mixed() || assembly.has_own_poisson()) return;
  Moduli unit;
  const VectorX rest = VectorX::Zero(3 * assembly.node_count());
  unit.lambda = 1;
  assembly.tangent(law, unit, rest, blocks_lambda);
  unit.lambda = 0;
  unit.mu = 1;
  assembly.tangent(law, unit, rest, blocks_mu);
}

void StaticSystem::set_region_stiffness(const VectorX& stiffness) {
  if (stiffness.size() == options.region_stiffness.size() && stiffness == options.region_stiffness) return;
  assembly.set_region_stiffness(stiffness);
  options.region_stiffness = stiffness;
  forget_factors();
}

void StaticSystem::set_region_poisson(const VectorX& poisson) {
  const VectorX& now = options.region_poisson;
  if (poisson.size() == now.size() && ((poisson.array() == now.array()) || (poisson.array().isNaN() && now.array().isNaN())).all()) return;
  assembly.set_region_poisson(poisson);
  options.region_poisson = poisson;
  forget_factors();
}

void StaticSystem::forget_factors() {
  factored_u.resize(0);
  linear_poisson = std::numeric_limits<double>::quiet_NaN();
  assemble_linear();
}

bool StaticSystem::evaluate(const StaticProblem& p, StaticState& s) const {
  const double strain_energy = assembly.energy_and_forces(law, p.m, s.u, s.internal, &s.inverted);
  if (!(strain_energy < kUnbounded)) return false;
  s.energy = strain_energy - p.external.dot(s.u);
  s.unbalanced = system.free_part(s.internal - p.external);
  const double scale = std::max(p.external.norm(), s.internal.norm());
  s.residual = scale > 0 ? s.unbalanced.norm() / scale : 0;
  return std::isfinite(s.energy) && std::isfinite(s.residual);
}

int StaticSystem::inverted_elements(const VectorX& displacement_m) const {
  if (displacement_m.size() != 3 * assembly.node_count()) throw Error("needs three values a node", "inverted_elements: displacement_m");
  VectorX forces;
  int inverted = 0;
  assembly.energy_and_forces(law, moduli(1.0, 0.0), displacement_m, forces, &inverted);
  return inverted;
}

StaticProblem StaticSystem::problem(double young, double poisson, const VectorX& a, const VectorX& b,
                                    const VectorX& extra) const {
  if (a.size() != boundary.forces.cols())
    throw Error("needs " + std::to_string(boundary.forces.cols()) + " values, has " + std::to_string(a.size()),
                "force_coefficients");
  if (b.size() != motions.cols())
    throw Error("needs " + std::to_string(motions.cols()) + " values, has " + std::to_string(b.size()),
                "motion_coefficients");
  if (!a.allFinite() || !b.allFinite()) throw Error("holds NaN or infinity", "coefficients");
  const auto further = law.extra_parameters();
  VectorX values = extra;
  if (values.size() == 0) {
    values.resize(static_cast<Index>(further.size()));
    for (std::size_t i = 0; i < further.size(); ++i) values(static_cast<Index>(i)) = further[i].initial;
  }
  if (values.size() != static_cast<Index>(further.size()))
    throw Error("needs " + std::to_string(further.size()) + " values, has " + std::to_string(values.size()), "extra");
  StaticProblem p;
  p.m = moduli(young, poisson, values);
  p.external = boundary.forces * a;
  p.prescribed = motions * b;
  return p;
}

Equilibrium StaticSystem::blank(double young, double poisson, const VectorX& a, const VectorX& b,
                                const VectorX& extra) const {
  Equilibrium out;
  out.young_modulus_pa = young;
  out.poisson_ratio = poisson;
  out.force_coefficients = a;
  out.motion_coefficients = b;
  out.extra = extra;
  return out;
}

void StaticSystem::finish(const StaticProblem& p, StaticState& s, Equilibrium& out) const {
  out.displacement_m = s.u;
  out.residual = s.residual;
  out.inverted_elements = s.inverted;
  out.motion_reaction = motions.transpose() * (s.internal - p.external);
  double forces = 0, squares = 0;
  for (Index i = 0; i < node_area_m2.size(); ++i) {
    const double force = p.external.segment<3>(3 * i).norm();
    if (force == 0 || node_area_m2(i) == 0) continue;
    forces += force;
    squares += force * force / node_area_m2(i);
  }
  out.pressure_over_young = forces > 0 ? squares / (forces * p.m.young_pa) : 0;
}

}  // namespace palpate::fem
