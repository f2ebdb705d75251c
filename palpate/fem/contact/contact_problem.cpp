// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/contact/contact_problem.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::fem {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

bool leaves_motions(const TetMesh& mesh, const Boundary& boundary) {
  if (boundary.inertia_relief) return false;
  try {
    check_supported(mesh, boundary.constraints);
  } catch (const Error&) {
    return true;
  }
  return false;
}

}  // namespace

Pose moved(const Pose& pose, const Vec6& twist) {
  Pose out = pose;
  out.translation() += twist.head<3>();
  const Vec3 turn = twist.tail<3>();
  const double angle = turn.norm();
  if (angle > 0) out.linear() = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() * pose.linear();
  return out;
}

ContactSystem::ContactSystem(const TetMesh& mesh_in, const std::string& material, Boundary boundary_in,
                             std::vector<RigidContact> contacts_in, ContactOptions options_in)
    : mesh(mesh_in),
      law(material_law(material)),
      options(options_in),
      assembly(mesh_in, options_in.statics.dilatation, options_in.statics.region),
      boundary(checked(mesh_in, std::move(boundary_in))),
      floating(leaves_motions(mesh_in, boundary)),
      system(assembly.pattern(), boundary.constraints,
             boundary.inertia_relief ? mass_times(mesh_in, rigid_motions(mesh_in.nodes_m))
                                     : MatrixX::Zero(3 * mesh_in.nodes_m.rows(), 0),
             mesh_in.nodes_m, options_in.statics.threads),
      terms(mesh_in, assembly.pattern(), options_in.points_per_edge),
      contacts(std::move(contacts_in)) {
  if (!(options.stiffness > 0)) throw Error("must be positive", "options.stiffness");
  if (options.increments < 1) throw Error("must be at least 1", "options.increments");
  if (floating && contacts.empty()) check_supported(mesh, boundary.constraints);
  first_axis.push_back(0);
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    const RigidContact& contact = contacts[c];
    const std::string where =
        "contacts[" + std::to_string(c) + "]" + (contact.name.empty() ? "" : " '" + contact.name + "'");
    if (!contact.shape) throw Error("has no shape", where);
    if (contact.free_axes.rows() != 6) throw Error("needs 6 rows (translation, rotation)", where + ".free_axes");
    if (contact.law == Touch::friction && !(contact.friction_coefficient >= 0))
      throw Error("must not be negative", where + ".friction_coefficient");
    if (contact.free_axes.cols() > 0 && Eigen::FullPivLU<MatrixX>(contact.free_axes).rank() < contact.free_axes.cols())
      throw Error("are linearly dependent", where + ".free_axes");
    first_axis.push_back(first_axis.back() + static_cast<Index>(contact.free_axes.cols()));
    TouchingBody start;
    start.shape = contact.shape.get();
    start.T_base_tool = contact.T_base_tool;
    seats_.push_back(contact.seat_m > 0 ? terms.seats(start, contact.seat_m) : std::vector<double>());
  }
  motions = MatrixX(boundary.motions);
  for (Index k = 0; k < motions.cols(); ++k) motions.col(k) = system.prescribed_part(motions.col(k));
  if (assembly.region_count() > 0) {
    const VectorX given = options.statics.region_stiffness;
    set_region_stiffness(given.size() > 0 ? given : VectorX::Ones(assembly.region_count()));
    set_region_poisson(options.statics.region_poisson);
  }
  double volume43 = 0;
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    const auto corner = [&](int k) { return Vec3(mesh.nodes_m.row(mesh.tetrahedra(e, k))); };
    const double volume = std::abs((corner(1) - corner(0)).cross(corner(2) - corner(0)).dot(corner(3) - corner(0))) / 6;
    volume43 += std::pow(volume, 4.0 / 3);
    volume_m3 += volume;
  }
  element_area_m2 = std::sqrt(volume43);
  diameter_m = (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).norm();
}

void ContactSystem::set_region_stiffness(const VectorX& stiffness) {
  assembly.set_region_stiffness(stiffness);
  terms.set_regions(options.statics.region, stiffness);
  body_blocks_.clear();
}

void ContactSystem::set_region_poisson(const VectorX& poisson) {
  assembly.set_region_poisson(poisson);
  body_blocks_.clear();
}

TouchingBody ContactSystem::body(std::size_t contact, const Moduli& m, const Pose& pose,
                                 const std::vector<TouchMemory>& memory) const {
  double k = contacts[contact].stiffness > 0 ? contacts[contact].stiffness : options.stiffness;
  if (softest > 0) k = std::min(k, softest);
  const auto* seat = seats_[contact].empty() ? nullptr : &seats_[contact];
  return {contacts[contact].shape.get(), contacts[contact].law, pose, &memory[contact], k * m.young_pa, seat};
}

ContactProblem ContactSystem::problem(double young, double poisson, const ContactLoads& loads, const VectorX& extra) const {
  const auto need = [](Eigen::Index found, Eigen::Index wanted, const char* name) {
    if (found != wanted) throw Error("needs " + std::to_string(wanted) + " values, has " + std::to_string(found), name);
  };
  need(loads.force_coefficients.size(), boundary.forces.cols(), "loads.force_coefficients");
  need(loads.motion_coefficients.size(), motions.cols(), "loads.motion_coefficients");
  need(static_cast<Eigen::Index>(loads.motion.size()), static_cast<Eigen::Index>(contacts.size()), "loads.motion");
  need(static_cast<Eigen::Index>(loads.wrench.size()), static_cast<Eigen::Index>(contacts.size()), "loads.wrench");
  const auto further = law.extra_parameters();
  VectorX values = extra;
  if (values.size() == 0) {
    values.resize(static_cast<Index>(further.size()));
    for (std::size_t i = 0; i < further.size(); ++i) values(static_cast<Index>(i)) = further[i].initial;
  }
  need(values.size(), static_cast<Eigen::Index>(further.size()), "extra");
  ContactProblem p;
  p.m = moduli(young, poisson, values);
  p.external = boundary.forces * loads.force_coefficients;
  p.prescribed = motions * loads.motion_coefficients;
  p.wrench.resize(first_axis.back());
  for (std::size_t c = 0; c < contacts.size(); ++c)
    p.wrench.segment(first_axis[c], contacts[c].free_axes.cols()) = contacts[c].free_axes.transpose() * loads.wrench[c];
  if (!p.external.allFinite() || !p.prescribed.allFinite() || !p.wrench.allFinite())
    throw Error("holds NaN or infinity", "loads");
  return p;
}

bool ContactSystem::evaluate(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s) const {
  const double strain = assembly.energy_and_forces(law, p.m, s.u, s.internal, &s.inverted);
  if (!(strain < kUnlimited)) return false;
  s.touching = VectorX::Zero(s.u.size());
  s.gradients.assign(contacts.size(), Vec6::Zero());
  s.energy = strain - p.external.dot(s.u) - p.wrench.dot(s.travelled);
  s.unbalanced_tool = -p.wrench;
  double tool_force = p.wrench.size() > 0 ? p.wrench.norm() : 0;
  // F = I + grad u is rounded as 1 is, and so are stresses.
  const double stress_pa = std::numeric_limits<double>::epsilon() * (p.m.lambda + 2 * p.m.mu);
  double rounding2_n2 = std::pow(stress_pa * element_area_m2, 2);
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    s.energy += terms.energy_and_forces(body(c, p.m, s.poses[c], memory), s.u, s.touching, s.gradients[c],
                                        &rounding2_n2);
    s.unbalanced_tool.segment(first_axis[c], contacts[c].free_axes.cols()) +=
        contacts[c].free_axes.transpose() * s.gradients[c];
    tool_force = std::max(tool_force, s.gradients[c].head<3>().norm());
  }
  s.unbalanced = system.free_part(s.internal + s.touching - p.external);
  s.scale_n = std::max({p.external.norm(), s.internal.norm(), s.touching.norm()});
  s.tool_scale_n = tool_force;
  s.rounding_n = std::sqrt(rounding2_n2);
  s.rounding_j = stress_pa * volume_m3;
  s.tool_residual = 0;
  for (std::size_t c = 0; c < contacts.size(); ++c)
    for (Index k = 0; k < contacts[c].free_axes.cols(); ++k) {
      const auto axis = contacts[c].free_axes.col(k);
      const double arm = axis.head<3>().norm() + axis.tail<3>().norm() * diameter_m;
      if (tool_force > 0)
        s.tool_residual = std::max(s.tool_residual, std::abs(s.unbalanced_tool(first_axis[c] + k)) / (arm * tool_force));
    }
  s.residual = std::max(s.scale_n > 0 ? s.unbalanced.norm() / s.scale_n : 0, s.tool_residual);
  return std::isfinite(s.energy) && std::isfinite(s.residual);
}

void ContactSystem::tangent(const ContactProblem& p, const std::vector<TouchMemory>& memory, const ContactState& s,
                            bool convex, ContactTangent& t) {
  if (law.is_linear()) {
    if (body_blocks_.empty() || linear_.young_pa != p.m.young_pa || linear_.poisson != p.m.poisson)
      assembly.tangent(law, p.m, s.u, body_blocks_);
    linear_ = p.m;
    t.blocks = body_blocks_;
  } else {
    assembly.tangent(law, p.m, s.u, t.blocks);
  }
  t.tools.resize(contacts.size());
  t.coupling.resize(s.u.size(), first_axis.back());
  t.tool.setZero(first_axis.back(), first_axis.back());
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    terms.tangent(body(c, p.m, s.poses[c], memory), s.u, convex, t.blocks, t.tools[c]);
    const MatrixX& axes = contacts[c].free_axes;
    t.coupling.middleCols(first_axis[c], axes.cols()) = t.tools[c].coupling * axes;
    t.tool.block(first_axis[c], first_axis[c], axes.cols(), axes.cols()) = axes.transpose() * t.tools[c].hessian * axes;
  }
}

bool ContactSystem::factorise(const ContactTangent& t, double shift, double proximal) {
  proximal_ = 0;
  if (!floating || proximal == 0)
    return has_factor_ = system.factorise(assembly.pattern(), t.blocks, shift, assembly.expected_negative_pivots());
  shifted_ = t.blocks;
  const BlockPattern& pattern = assembly.pattern();
  diagonal_ = 0;
  const auto block = [&](Index i) { return &shifted_[9 * static_cast<std::size_t>(pattern.column_start[i])]; };
  for (Index i = 0; i < assembly.node_count(); ++i) diagonal_ += (block(i)[0] + block(i)[4] + block(i)[8]);
  diagonal_ /= 3.0 * assembly.node_count();
  for (Index i = 0; i < assembly.node_count(); ++i)
    for (int k = 0; k < 9; k += 4) block(i)[k] += proximal * diagonal_;
  proximal_ = proximal;
  return has_factor_ = system.factorise(pattern, shifted_, shift, assembly.expected_negative_pivots());
}

void ContactSystem::solve(const ContactTangent& t, const MatrixX& ru, const MatrixX& rz, bool definite, MatrixX& du,
                          MatrixX& dz) const {
  const Index z = first_axis.back(), cases = static_cast<Index>(ru.cols());
  MatrixX rhs(ru.rows(), cases + z), tool_rhs = rz;
  rhs << ru, t.coupling;
  const MatrixX x = system.solve(rhs);
  du = x.leftCols(cases);
  dz.setZero(z, cases);
  MatrixX schur = t.tool - t.coupling.transpose() * x.rightCols(z);
  if (z > 0 && definite) {
    // A tool in the air, or one that may roll, has no stiffness: it gets that of a small contact, so that it moves on.
    const MatrixX symmetric = 0.5 * (schur + schur.transpose());
    const Eigen::SelfAdjointEigenSolver<MatrixX> eigen(symmetric);
    const double largest = std::max(std::abs(eigen.eigenvalues()(z - 1)), 1e-6 * t.tool.diagonal().cwiseAbs().maxCoeff());
    const double floor = largest > 0 ? 1e-7 * largest : 1e-3 * t.blocks[0] * diameter_m;
    const VectorX values = eigen.eigenvalues().cwiseAbs().cwiseMax(floor);
    if (eigen.eigenvalues()(0) < floor)
      schur = eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
  }
  if (z > 0) {
    dz = schur.partialPivLu().solve(tool_rhs - t.coupling.transpose() * du);
    du -= x.rightCols(z) * dz;
  }
  if (proximal_ == 0 || definite) return;
  // Iterative refinement takes the proximal terms out again.
  for (int round = 0; round < 30; ++round) {
    MatrixX left = ru - t.coupling * dz;
    for (Index c = 0; c < cases; ++c) left.col(c) -= assembly.multiply(t.blocks, du.col(c));
    MatrixX left_tool = z > 0 ? MatrixX(rz - t.coupling.transpose() * du - t.tool * dz) : rz;
    for (Index c = 0; c < cases; ++c) left.col(c) = system.free_part(left.col(c));
    const double size = std::max(ru.norm(), 1e-300);
    if (left.norm() < 1e-13 * size) break;
    MatrixX correction = system.solve(left);
    if (z > 0) {
      const MatrixX more = schur.partialPivLu().solve(left_tool - t.coupling.transpose() * correction);
      correction -= x.rightCols(z) * more;
      dz += more;
    }
    du += correction;
  }
}

void ContactSystem::move(ContactState& s, const VectorX& dz) const {
  s.travelled += dz;
  for (std::size_t c = 0; c < contacts.size(); ++c)
    if (contacts[c].free_axes.cols() > 0)
      s.poses[c] = moved(s.poses[c], contacts[c].free_axes * dz.segment(first_axis[c], contacts[c].free_axes.cols()));
}

bool ContactSystem::approach(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s) const {
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    const MatrixX& axes = contacts[c].free_axes;
    const VectorX wrench = p.wrench.segment(first_axis[c], axes.cols());
    if (axes.cols() == 0 || contacts[c].law == Touch::bonded || wrench.norm() == 0) continue;
    const Vec6 twist = axes * wrench;
    const double length = twist.head<3>().norm();
    if (!(length > 0)) continue;
    const VectorX dz = wrench / length;  // one metre of travel
    const Pose start = s.poses[c];
    // Force along the wrench with a layer as soft as the body: a guess of how far the tool goes in.
    const auto force = [&](double travel) {
      TouchingBody b = body(c, p.m, moved(start, axes * (travel * dz)), memory);
      b.stiffness_pa = p.m.young_pa;
      VectorX forces = VectorX::Zero(s.u.size());
      Vec6 gradient = Vec6::Zero();
      terms.energy_and_forces(b, s.u, forces, gradient);
      return wrench.normalized().dot(axes.transpose() * gradient);
    };
    if (force(0) > 0) continue;
    const double stride = std::min(0.02 * diameter_m, 0.25 * contacts[c].shape->bounding_radius_m());
    const double far = 3 * diameter_m + 2 * (start.translation() - mesh.nodes_m.colwise().mean().transpose()).norm();
    double low = 0, high = stride;
    while (force(high) <= 0) {
      low = high;
      high += stride;
      if (low > far) return false;
    }
    while (force(high) < wrench.norm() && high - low < 0.1 * diameter_m) high += 0.25 * stride;
    for (int i = 0; i < 30; ++i) {
      const double middle = 0.5 * (low + high);
      (force(middle) < wrench.norm() ? low : high) = middle;
    }
    VectorX all = VectorX::Zero(first_axis.back());
    all.segment(first_axis[c], axes.cols()) = high * dz;
    move(s, all);
  }
  return true;
}

}  // namespace palpate::fem
