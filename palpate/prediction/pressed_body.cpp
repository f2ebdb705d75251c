// SPDX-License-Identifier: Apache-2.0
#include "palpate/prediction/pressed_body.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate::prediction {
namespace {

fem::Response response_of(const TetMesh& mesh, const Elasticity& elasticity, fem::Boundary boundary, const NewPush& push,
                          fem::StaticsOptions statics, const Surroundings& around) {
  const Eigen::Index of_patch = around.moves_a_tool() ? 0 : 3;
  if (boundary.forces.cols() < of_patch) throw Error("needs three columns for the patch", "boundary.forces");
  if (push.background.size() != 0 && push.background.size() != boundary.forces.cols() - of_patch)
    throw Error("has another size than the boundary's other columns", "push.background");
  fem::Response::Options options;
  options.statics = std::move(statics);
  if (elasticity.region_stiffness.size() > 0) options.statics.region = elasticity.region;
  options.statics.region_stiffness = elasticity.region_stiffness;
  options.statics.region_poisson = elasticity.region_poisson;
  options.contacts = around.contacts;
  if (around.tool) options.driven = {{*around.tool, push.direction}};
  options.friction_tolerance = std::min(fem::ContactOptions().friction_tolerance, 100 * options.statics.residual_tolerance);
  return fem::Response(mesh, elasticity.material, std::move(boundary), Eigen::SparseMatrix<double>(0, 3 * mesh.nodes_m.rows()), options);
}

Mat3 cross_matrix(const Vec3& a) {
  Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

double size_m(const TetMesh& mesh) { return (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).norm(); }

}  // namespace

Mat3 RigidWay::at(const Vec3& place_m) const {
  return per_newton.topRows<3>() - cross_matrix(place_m - pivot_m) * per_newton.bottomRows<3>();
}

PressedBody::PressedBody(const TetMesh& mesh, const Elasticity& elasticity, fem::Boundary boundary, const NewPush& push,
                         fem::StaticsOptions options, Surroundings around)
    : around_(std::move(around)),
      push_(push),
      elasticity_(elasticity),
      moves_tool_(around_.moves_a_tool()),
      nodes_(static_cast<Index>(mesh.nodes_m.rows())),
      moduli_(static_cast<Index>(elasticity.covariance.rows())),
      columns_(static_cast<Index>(boundary.forces.cols())),
      motions_(static_cast<Index>(boundary.motions.cols()) + (around_.tool ? 1 : 0)),
      // What a patch of a twentieth of the object's size meets on a half-space: the right order for a first guess.
      half_space_n_m_(2 * elasticity.young_modulus_pa * 0.05 * size_m(mesh)),
      response_(response_of(mesh, elasticity, std::move(boundary), push, std::move(options), around_)) {
  if (around_.platen) moved_ = *around_.platen;
  if (around_.tool) moved_ = motions_ - 1;
  path_ = std::any_of(around_.contacts.begin(), around_.contacts.end(),
                      [](const fem::RigidContact& one) { return one.law != fem::Touch::frictionless; });
  // Where something touches and nothing acts, rest is known, and nothing but the push tells what touches.
  if (touches() && push.background.isZero(0)) {
    before_ = at_rest();
    return;
  }
  fem::ResponseStart start;
  start.on_path = touches() && path_;
  const double share = touches() ? 0 : 1;  // alone it is asked what the push does to it, for a first guess
  const fem::ResponseState at = response_.solve(query(0, share), start);
  if (at.converged && at.parameters != moduli_) throw Error("has not one row and column for each of the moduli", "elasticity.covariance");
  before_ = read(at, 0, share);
}

fem::ResponseQuery PressedBody::query(double control, double share) const {
  fem::ResponseQuery query{elasticity_.young_modulus_pa, elasticity_.poisson_ratio, VectorX::Zero(columns_), VectorX::Zero(motions_)};
  query.extra = elasticity_.extra;
  if (push_.background.size() > 0) query.force.tail(push_.background.size()) = push_.background;
  fem::LoadDirections along{MatrixX::Zero(columns_, 1), MatrixX::Zero(motions_, 1)};
  if (moves_tool_) {
    query.motion(moved_) = share * control;
    along.motion(moved_, 0) = share;
  } else {
    query.force.head<3>() = share * control * push_.direction;
    along.force.col(0).head<3>() = share * push_.direction;
  }
  query.along = along;
  return query;
}

PressedState PressedBody::at_rest() const {
  PressedState out;
  out.converged = true;
  out.displacement_m = VectorX::Zero(3 * nodes_);
  out.d_displacement = MatrixX::Zero(3 * nodes_, moduli_ + 1);
  out.d_along = VectorX::Zero(moduli_ + 1);
  return out;
}

PressedState PressedBody::read(const fem::ResponseState& at, double control, double share) const {
  PressedState out;
  out.converged = at.converged;
  out.reason = at.reason;
  out.inverted_elements = at.inverted_elements;
  if (!at.converged) return out;
  const Index count = moduli_ + 1;
  if (at.parameters != moduli_) throw Error("has not one row and column for each of the moduli", "elasticity.covariance");
  out.solution = at.solution;
  out.displacement_m = at.solution->displacement_m;
  out.d_displacement = at.solution->derivative;
  out.d_pressed.setZero(3, count);
  VectorX d_control = VectorX::Zero(count);
  d_control(moduli_) = share;
  if (around_.tool) {
    out.pressed_n = at.driven_force_n.head<3>();
    out.d_pressed = at.d_driven_force.topRows<3>();
  } else if (around_.platen) {
    out.pressed_n = at.reaction_n(moved_) * push_.direction;
    out.d_pressed = push_.direction * at.d_reaction.row(moved_);
  } else {
    out.pressed_n = share * control * push_.direction;
    out.d_pressed = push_.direction * d_control.transpose();
  }
  if (moves_tool_) {
    out.along_m = share * control;
    out.d_along = d_control;
  } else {
    out.along_m = push_.direction.dot(at.conjugate_m.head<3>());
    out.d_along = at.d_conjugate.topRows<3>().transpose() * push_.direction;
  }
  out.force_n = {push_.direction.dot(out.pressed_n), out.d_pressed.transpose() * push_.direction};
  if (!moves_tool_) out.force_n.value = share * control;
  out.travel_m = {out.along_m - before_.along_m, out.d_along};
  if (!moves_tool_ && before_.d_along.size() > 0) out.travel_m.d.head(moduli_) -= before_.d_along.head(moduli_);
  if (around_.gives_way.moves()) {
    const Vec3 row = around_.gives_way.at(around_.contact_m).transpose() * push_.direction;
    out.travel_m.value += row.dot(out.pressed_n);
    out.travel_m.d += out.d_pressed.transpose() * row;
  }
  return out;
}

PressedState PressedBody::solve(double control, const PressedState& warm) const {
  fem::ResponseStart start;
  if (!touches()) {
    start.displacement_m = &warm.displacement_m;
    return read(response_.solve(query(control, 1), start), control, 1);
  }
  if (!path_) {
    start.from = warm.solution;
    return read(response_.solve(query(control, 1), start), control, 1);
  }
  // What slides and sticks depends on the way there.
  constexpr int parts = 4;
  start.on_path = true;
  start.from = before_.solution;
  fem::ResponseState at;
  for (int k = 1; k <= parts; ++k) {
    at = response_.solve(query(control, k / double(parts)), start);
    if (!at.converged) break;
    start.from = at.solution;
  }
  return read(at, control, 1);
}

double PressedBody::first_guess(bool force, double value, const PressedState& before) const {
  if (touches()) return force == moves_tool_ ? (force ? value / half_space_n_m_ : value * half_space_n_m_) : value;
  const Reading& reading = force ? before.force_n : before.travel_m;
  return value / reading.by_control();
}

}  // namespace palpate::prediction
