// SPDX-License-Identifier: Apache-2.0
// Load steps as paths of increments, and the parameters that every contact has.
#include <algorithm>

#include "palpate/core/error.hpp"
#include "palpate/fem/contact/contact_path.hpp"

namespace palpate::fem {
namespace {

void widen(MatrixX& matrix, Index columns) {
  const Index had = static_cast<Index>(matrix.cols());
  matrix.conservativeResize(matrix.rows(), columns);
  matrix.rightCols(columns - had).setZero();
}

void widen(VectorX& vector, Index size) {
  const Index had = static_cast<Index>(vector.size());
  vector.conservativeResize(size);
  vector.tail(size - had).setZero();
}

void widen(ContactPathSensitivity& d, Index q) {
  widen(d.displacement, q);
  widen(d.motion_reaction, q);
  for (auto& each : d.wrench) widen(each, q);
  for (auto& each : d.motion) widen(each, q);
  for (auto& each : d.anchors) {
    widen(each.anchor, q);
    widen(each.normal, q);
  }
  widen(d.loads.log_young, q);
  widen(d.loads.poisson, q);
  widen(d.loads.log_layer, q);
  widen(d.loads.log_stiffness, q);
  widen(d.loads.region_poisson, q);
  widen(d.loads.force_coefficients, q);
  widen(d.loads.motion_coefficients, q);
  for (auto& each : d.loads.motion) widen(each, q);
  for (auto& each : d.loads.wrench) widen(each, q);
  for (auto& each : d.loads.radius) widen(each, q);
}

ContactLoadsAlong along_between(const ContactLoadsAlong& a, const ContactLoadsAlong& b, double t) {
  ContactLoadsAlong out = b;  // E, nu, radii, layers and regions are those of the whole step
  out.force_coefficients = (1 - t) * a.force_coefficients + t * b.force_coefficients;
  out.motion_coefficients = (1 - t) * a.motion_coefficients + t * b.motion_coefficients;
  for (std::size_t c = 0; c < b.motion.size(); ++c) {
    out.motion[c] = (1 - t) * a.motion[c] + t * b.motion[c];
    out.wrench[c] = (1 - t) * a.wrench[c] + t * b.wrench[c];
  }
  return out;
}

bool remembers(Touch law) { return law == Touch::friction || law == Touch::sticking; }

// The way from rest to a state; where nothing remembers, as if it had been gone in one go.
std::vector<ContactIncrement> path_from_rest(const ContactSystem& system, const ContactStatics& statics,
                                             const ContactEquilibrium& at) {
  const auto count = system.contacts.size();
  if (at.displacement_m.size() != 3 * system.mesh.nodes_m.rows() || at.touches.size() != count || !at.path ||
      at.path->size() < 2)
    throw Error("is not a state of this mesh and these contacts", "sensitivity.at");
  bool path_matters = false;
  for (std::size_t c = 0; c < count; ++c) {
    if (!remembers(system.contacts[c].law)) continue;
    path_matters = true;
    if (at.increments_from_rest != at.increments)
      throw Error("depends on the steps before: hand the derivatives on from step to step with sensitivity_along",
                  "contacts[" + std::to_string(c) + "] '" + system.contacts[c].name + "'");
  }
  if (path_matters) return *at.path;
  std::vector<ContactIncrement> path{at.path->front(), at.path->back()};
  path.front().displacement_m.setZero();
  path.front().loads = statics.no_loads();
  for (std::size_t c = 0; c < count; ++c) path.front().poses[c] = system.contacts[c].T_base_tool;
  return path;
}

}  // namespace

ContactPathSensitivity path_sensitivity(ContactSystem& system, const ContactEquilibrium& at,
                                        const std::vector<ContactIncrement>& path, const ContactLoadsAlong& along,
                                        const ContactPathSensitivity& from) {
  const Index q = static_cast<Index>(along.log_young.size());
  if (from.displacement.rows() != 3 * static_cast<Index>(system.mesh.nodes_m.rows()) || from.displacement.cols() > q)
    throw Error("has other nodes than the mesh, or more parameters than `along`", "sensitivity_along.from");
  if (along.motion.size() != system.contacts.size() || along.wrench.size() != system.contacts.size())
    throw Error("needs one entry a contact: start from no_loads_along", "sensitivity_along.along");
  ContactPathSensitivity d = from;
  widen(d, q);
  const ContactLoadsAlong start = d.loads;
  ContactLoadsAlong last = start;
  for (std::size_t i = 1; i < path.size(); ++i) {
    const ContactLoadsAlong next = along_between(start, along, path[i].share);
    advance(system, at, path[i - 1], path[i], last, next, d);
    last = next;
  }
  d.loads = along;
  return d;
}

VectorX layer_travel_of(ContactSystem& system, const ContactStatics& statics, const ContactEquilibrium& at) {
  const Index count = static_cast<Index>(system.contacts.size());
  const std::vector<ContactIncrement> path = path_from_rest(system, statics, at);
  // The layers together, then the travel of every tool whose pose is prescribed.
  ContactLoadsAlong along = statics.no_loads_along(1 + count);
  ContactPathSensitivity rest = statics.rest_along(1 + count);
  along.log_layer(0) = 1;
  std::vector<Vec3> into(system.contacts.size(), Vec3::Zero());
  for (Index c = 0; c < count; ++c) {
    const auto k = static_cast<std::size_t>(c);
    const Vec3 force = at.touches[k].wrench.head<3>();
    if (force.norm() > 0) into[k] = force.normalized();
    if (system.contacts[k].free_axes.cols() == 0) rest.motion[k].col(1 + c).head<3>() = into[k];
  }
  const ContactPathSensitivity d = path_sensitivity(system, at, path, along, rest);
  VectorX travel = VectorX::Zero(count);
  for (Index c = 0; c < count; ++c) {
    const auto k = static_cast<std::size_t>(c);
    if (system.contacts[k].free_axes.cols() > 0) {
      travel(c) = -into[k].dot(d.motion[k].col(0).head<3>());
    } else {
      const double stiffness = into[k].dot(d.wrench[k].col(1 + c).head<3>());
      if (stiffness > 0) travel(c) = into[k].dot(d.wrench[k].col(0).head<3>()) / stiffness;
    }
  }
  return travel;
}

ContactSensitivity sensitivity_of(ContactSystem& system, const ContactStatics& statics, const ContactEquilibrium& at) {
  const auto count = system.contacts.size();
  const std::vector<ContactIncrement> path = path_from_rest(system, statics, at);
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
  const Index regions = system.assembly.region_count();
  out.first_stiffness = columns;
  columns += regions;
  ContactLoadsAlong along = statics.no_loads_along(columns);
  along.log_stiffness.middleCols(out.first_stiffness, regions).setIdentity();
  along.log_young(out.log_young) = along.poisson(out.poisson) = 1;
  along.force_coefficients.middleCols(out.first_force, forces).setIdentity();
  along.motion_coefficients.middleCols(out.first_motion, driven).setIdentity();
  ContactPathSensitivity rest = statics.rest_along(columns);
  for (std::size_t c = 0; c < count; ++c) {
    rest.motion[c].middleCols(out.first_pose[c], 6).setIdentity();
    along.wrench[c].middleCols(out.first_wrench[c], 6).setIdentity();
    if (out.radius[c] >= 0) along.radius[c](out.radius[c]) = 1;
  }
  ContactPathSensitivity d = path_sensitivity(system, at, path, along, rest);
  out.displacement = std::move(d.displacement);
  out.wrench = std::move(d.wrench);
  out.motion = std::move(d.motion);
  out.motion_reaction = std::move(d.motion_reaction);
  return out;
}

}  // namespace palpate::fem
