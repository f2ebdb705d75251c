// SPDX-License-Identifier: Apache-2.0
// Implicit function theorem on body and tools together.
#include "palpate/core/error.hpp"
#include "palpate/fem/contact/contact_problem.hpp"

namespace palpate::fem {

ContactSensitivity sensitivity_of(ContactSystem& system, const ContactEquilibrium& at) {
  const auto count = system.contacts.size();
  if (at.displacement_m.size() != 3 * system.mesh.nodes_m.rows() || at.touches.size() != count || !at.memory)
    throw Error("is not a state of this mesh and these contacts", "sensitivity.at");
  for (std::size_t c = 0; c < count; ++c) {
    const Touch law = system.contacts[c].law;
    if (law == Touch::friction)
      throw Error("friction has no exact derivatives here: difference two solutions, or let the contact slide or stick",
                  "contacts[" + std::to_string(c) + "] '" + system.contacts[c].name + "'");
    if (law == Touch::sticking && at.increments_from_rest != 1)
      throw Error(
          "a sticking contact has exact derivatives after one increment from rest only (its anchors then do not depend "
          "on the path): set increments to 1",
          "contacts[" + std::to_string(c) + "] '" + system.contacts[c].name + "'");
  }
  const ContactProblem p = system.problem(at.young_modulus_pa, at.poisson_ratio, at.loads, at.extra);
  ContactState s;
  s.u = at.displacement_m;
  for (const TouchResult& touch : at.touches) s.poses.push_back(touch.T_base_tool);
  s.travelled = VectorX::Zero(system.first_axis.back());
  if (!system.evaluate(p, *at.memory, s)) throw Error("holds inverted elements", "sensitivity.at");
  ContactTangent t;
  system.tangent(p, *at.memory, s, false, t);
  if (!system.factorise(t, 0, 1e-9)) throw Error("the equilibrium is not stable: it has no derivative", "sensitivity.at");

  ContactSensitivity out;
  const Index forces = static_cast<Index>(system.boundary.forces.cols()), driven = static_cast<Index>(system.motions.cols());
  Index columns = 2;
  out.first_force = columns;
  columns += forces;
  out.first_motion = columns;
  columns += driven;
  for (std::size_t c = 0; c < count; ++c) {
    out.first_pose.push_back(columns);
    out.first_wrench.push_back(columns + 6);
    columns += 12;
    out.radius.push_back(system.contacts[c].shape->has_radius() ? columns++ : -1);
  }

  // Change of every force at fixed u and z: on nodes, and on the tools along all axes.
  MatrixX change = MatrixX::Zero(s.u.size(), columns), tool_rhs = MatrixX::Zero(system.first_axis.back(), columns);
  std::vector<MatrixX> gradient(count, MatrixX::Zero(6, columns));
  change.col(out.log_young) = s.internal + s.touching;  // all of it is proportional to E
  change.col(out.poisson) = system.assembly.forces_d_poisson(system.law, p.m, s.u);
  change.middleCols(out.first_force, forces) -= MatrixX(system.boundary.forces);
  for (Index k = 0; k < driven; ++k)
    change.col(out.first_motion + k) = system.assembly.multiply(t.blocks, system.motions.col(k));
  for (std::size_t c = 0; c < count; ++c) {
    const TouchingBody body = system.body(c, p.m, s.poses[c], *at.memory);
    gradient[c].col(out.log_young) = s.gradients[c];
    for (Index k = 0; k < driven; ++k)
      gradient[c].col(out.first_motion + k) = t.tools[c].coupling.transpose() * system.motions.col(k);
    MatrixX by_pose = t.tools[c].coupling;
    Eigen::Matrix<double, 6, 6> gradient_by_pose = t.tools[c].hessian;
    system.terms.anchors_d_pose(body, s.u, system.contacts[c].T_base_tool.linear(), by_pose, gradient_by_pose);
    change.middleCols(out.first_pose[c], 6) = by_pose;
    gradient[c].middleCols(out.first_pose[c], 6) = gradient_by_pose;
    const MatrixX& axes = system.contacts[c].free_axes;
    tool_rhs.block(system.first_axis[c], out.first_wrench[c], axes.cols(), 6) = axes.transpose();
    if (out.radius[c] < 0) continue;
    VectorX by_radius = VectorX::Zero(s.u.size());
    Vec6 gradient_by_radius = Vec6::Zero();
    system.terms.d_radius(body, s.u, by_radius, gradient_by_radius);
    change.col(out.radius[c]) = by_radius;
    gradient[c].col(out.radius[c]) = gradient_by_radius;
  }
  for (std::size_t c = 0; c < count; ++c)
    tool_rhs.middleRows(system.first_axis[c], system.contacts[c].free_axes.cols()) -=
        system.contacts[c].free_axes.transpose() * gradient[c];

  MatrixX du, dz;
  system.solve(t, -change, tool_rhs, false, du, dz);
  if (!du.allFinite() || !dz.allFinite()) throw Error("a tool touches nothing: it has no derivative", "sensitivity.at");
  out.motion_reaction.resize(driven, columns);
  for (Index k = 0; k < columns; ++k) {
    VectorX force = change.col(k) + system.assembly.multiply(t.blocks, du.col(k));
    if (dz.rows() > 0) force += t.coupling * dz.col(k);
    out.motion_reaction.col(k) = system.motions.transpose() * force;
  }
  for (std::size_t c = 0; c < count; ++c) {
    const MatrixX& axes = system.contacts[c].free_axes;
    const MatrixX twist = axes * dz.middleRows(system.first_axis[c], axes.cols());
    out.wrench.push_back(gradient[c] + t.tools[c].coupling.transpose() * du + t.tools[c].hessian * twist);
    out.motion.push_back(twist);
    out.motion.back().middleCols(out.first_pose[c], 6) += Eigen::Matrix<double, 6, 6>::Identity();
  }
  du.middleCols(out.first_motion, driven) += system.motions;
  out.displacement = std::move(du);
  return out;
}

}  // namespace palpate::fem
