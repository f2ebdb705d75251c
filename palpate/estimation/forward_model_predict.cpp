// SPDX-License-Identifier: Apache-2.0
// From the body's own frame to what cameras see and tools read in a step.
#include <algorithm>

#include "palpate/estimation/forward_model_parts.hpp"

namespace palpate::estimation {

/// Into the base frame: x = T(X + b n + u).
void ForwardModel::place_surface(std::size_t s, const VectorX& unknowns, const VectorX& moved_m, StepPrediction& out) const {
  const RigidOffset clamp = clamp_offset(s, unknowns);
  out.surface_m = object_.surface.rest().vertices_m + Eigen::Map<const Points>(moved_m.data(), object_.surface.vertex_count(), 3);
  if (moves_as_a_whole(s)) {
    const RigidMap moved(clamp);
    for (Index v = 0; v < out.surface_m.rows(); ++v) out.surface_m.row(v) = moved.apply(out.surface_m.row(v));
  }
  if (!field_) return;
  out.field = field_;
  out.field_unknown = field_unknown_;
  out.material_m = out.surface_m;
  out.field_directions = field_->normals() * clamp.rotation().transpose();
  const auto offset_m = field_->offset_m(unknowns.segment(field_unknown_, field_->modes()));
  out.surface_m += offset_m->asDiagonal() * out.field_directions;
}

StepPrediction ForwardModel::predict(std::size_t s, const VectorX& unknowns, bool derivatives) {
  StepPrediction out = unchanged(s, unknowns, derivatives ? Wanted::derivatives : Wanted::surface);
  if (out.converged && s < changes_.size() && changes_[s]) changes_[s]->add_to(out, unknowns, derivatives);
  return out;
}

StepPrediction ForwardModel::predict_in_span(std::size_t s, const VectorX& unknowns, SurfacePart part) {
  if (!linear_ || !changes_.empty()) return predict(s, unknowns);
  if (part == SurfacePart::coordinates) return unchanged(s, unknowns, Wanted::coordinates);
  if (part == SurfacePart::place) return unchanged(s, unknowns, Wanted::in_span);
  StepPrediction out = predict(s, unknowns);
  const Body& body = body_of(push(s), worker_of(s));
  out.in_span = place_in_span(s, body, coefficients(s, body, unknowns), unknowns);
  if (out.in_span) {  // what only readings depend on does not move the surface
    MatrixX& d_at = out.in_span->d_at;
    const Index known = static_cast<Index>(d_at.cols()), count = static_cast<Index>(out.columns.size());
    d_at.conservativeResize(d_at.rows(), count);
    d_at.rightCols(count - known).setZero();
  }
  return out;
}

void ForwardModel::add_surface(std::size_t s, const VectorX& unknowns, StepPrediction& predicted) const {
  place_surface(s, unknowns, predicted.in_span->moved_m(), predicted);
}

Vec3 ForwardModel::tare_n(const ToolErrors& errors, const VectorX& unknowns) {
  if (errors.tare < 0) return Vec3::Zero();
  return errors.tare_axis.norm() > 0 ? Vec3(unknowns(errors.tare) * errors.tare_axis) : Vec3(unknowns.segment<3>(errors.tare));
}

/// Of a rigid body all of it, whichever way its push goes: what a face without friction takes is along its normal. Of a platen whose
/// nodes are moved the part along its motion.
Vec3 ForwardModel::driven_force_n(const Body& body, const Load& load, const fem::ResponseState& at) {
  const int m = body.motion_column.at(load.tool), contact = m - body.node_motions;
  if (contact < 0) return at.reaction_n(m) * load.direction.normalized();
  return at.driven_force_n.segment<3>(3 * contact);
}

Eigen::Matrix<double, 3, Eigen::Dynamic> ForwardModel::d_driven_force(const Body& body, const Load& load, const fem::ResponseState& at) {
  const int m = body.motion_column.at(load.tool), contact = m - body.node_motions;
  if (contact < 0) return load.direction.normalized() * at.d_reaction.row(m);
  return at.d_driven_force.middleRows<3>(3 * contact);
}

double ForwardModel::read_of_true(const VectorX& unknowns) const { return force_scale_ >= 0 ? 1 / (1 + unknowns(force_scale_)) : 1; }

void ForwardModel::undeform(std::size_t s, const VectorX& unknowns, StepPrediction& predicted) const {
  place_surface(s, unknowns, VectorX::Zero(3 * object_.surface.vertex_count()), predicted);
}

Vec3 ForwardModel::mean_motion(const std::vector<LoadPart>& parts, const fem::ResponseState& at) {
  Vec3 motion_m = Vec3::Zero();
  for (const LoadPart& part : parts) motion_m += part.weight * at.conjugate_m.segment<3>(part.first);
  return motion_m;
}

void ForwardModel::add_readings(std::size_t s, const Body& body, const Coefficients& c, const VectorX& unknowns,
                                const fem::ResponseState& at, StepPrediction& out) const {
  const Step& now = step(s);
  const double read_share = read_of_true(unknowns);
  out.travel_m = VectorX::Zero(static_cast<Index>(now.loads.size()));
  out.force_n.assign(now.loads.size(), Vec3::Zero());
  for (std::size_t l = 0; l < now.loads.size(); ++l) {
    const Load& load = now.loads[l];
    const Vec3 direction = load.direction.normalized();
    double& travel_m = out.travel_m(static_cast<Index>(l));
    if (load.travel_m) {
      const int m = body.motion_column.at(load.tool);
      travel_m = c.motion(m) + support_compliance(unknowns) * given_way_along(s, load);
      out.force_n[l] = read_share * (driven_force_n(body, load, at) - tare_n(errors_of(s, l), unknowns));
      if (time_offset_ >= 0) out.force_n[l] -= unknowns(time_offset_) * load.force_rate_n_s;
    } else {
      out.force_n[l] = load.force_n.value_or(Vec3::Zero());
      const std::vector<LoadPart> parts = load_parts(s, l, body, unknowns);
      if (!parts.empty())
        travel_m = (clamp_offset(s, unknowns).rotation().transpose() * direction).dot(mean_motion(parts, at)) +
                   support_compliance(unknowns) * given_way_along(s, load);
    }
  }
}

StepPrediction ForwardModel::unchanged(std::size_t s, const VectorX& unknowns, Wanted wanted) {
  const bool derivatives = wanted != Wanted::surface;
  const std::size_t worker = worker_of(s);
  Body& body = body_of(push(s), worker);
  Coefficients c = coefficients(s, body, unknowns);
  if (path_) add_path_columns(s, body, unknowns, c);

  StepPrediction out;
  fem::ResponseState at;
  if (linear_) {
    if (wanted == Wanted::in_span || wanted == Wanted::coordinates) out.in_span = place_in_span(s, body, c, unknowns);
    if (out.in_span) {
      at = body.response->readings(query(c, unknowns, derivatives));
      if (wanted == Wanted::in_span) at.watched_m = out.in_span->moved_m();
    } else {
      at = body.response->at(query(c, unknowns, derivatives));
    }
    ++solves_[worker];
  } else if (!(reuse_ > 0 && derivatives && follow(s, unknowns, at))) {
    solve_step(s, body, c, unknowns, derivatives, at);
  }
  out.converged = at.converged;
  out.reason = at.reason;
  out.inverted_elements = at.inverted_elements;
  if (!at.converged) return out;

  slide(s, body, unknowns, c.columns, derivatives, at);
  if (out.in_span && wanted == Wanted::coordinates) {
    out.field = field_;
    out.field_unknown = field_unknown_;
  } else {
    place_surface(s, unknowns, at.watched_m, out);
  }
  add_readings(s, body, c, unknowns, at, out);
  if (!derivatives) return out;

  out.columns = parameter_columns();
  out.columns.insert(out.columns.end(), c.columns.begin(), c.columns.end());
  const Index count = static_cast<Index>(out.columns.size());

  const RigidOffset clamp = clamp_offset(s, unknowns);
  const Mat3 rotation = clamp.rotation();
  out.d_surface = std::move(at.d_watched);
  std::vector<std::pair<Index, RigidMotion>> whole;  // by column
  for (const auto& [unknown, along] : whole_motions(s))
    whole.emplace_back(std::find(out.columns.begin() + parameters_, out.columns.end(), unknown) - out.columns.begin(), along);
  if (moves_as_a_whole(s)) {
    for (Index v = 0; v < out.surface_m.rows(); ++v) {
      out.d_surface.middleRows<3>(3 * v) = (rotation * out.d_surface.middleRows<3>(3 * v)).eval();
    }
    const auto add_rigid = [&](const Points& at_m, MatrixX& derivative) {
      for (Index v = 0; v < at_m.rows(); ++v) {
        const auto rigid = clamp.derivative(clamp.apply_inverse(at_m.row(v)));
        for (const auto& [k, along] : whole) derivative.block<3, 1>(3 * v, k) += rigid * along;
      }
    };
    if (field_) {
      out.d_material = out.d_surface;
      add_rigid(out.material_m, out.d_material);
    }
    add_rigid(out.surface_m, out.d_surface);
  }

  // What the readings depend on.
  const Step& now = step(s);
  const Index loads = static_cast<Index>(now.loads.size());
  out.d_travel = MatrixX::Zero(loads, count);
  out.d_force.assign(now.loads.size(), Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, count));
  const double read_share = read_of_true(unknowns);
  for (Index l = 0; l < loads; ++l) {
    const auto at_load = static_cast<std::size_t>(l);
    const Load& load = now.loads[at_load];
    if (load.travel_m) {
      const int m = body.motion_column.at(load.tool);
      out.d_force[at_load] = read_share * d_driven_force(body, load, at);
      for (Index k = parameters_; k < count; ++k) {
        out.d_travel(l, k) = c.d_motion(m, k - parameters_);
        if (out.columns[static_cast<std::size_t>(k)] == support_compliance_unknown_) out.d_travel(l, k) += given_way_along(s, load);
      }
    } else {
      const std::vector<LoadPart> parts = load_parts(s, at_load, body, unknowns);
      if (parts.empty()) continue;
      const Vec3 direction = rotation.transpose() * load.direction.normalized();
      for (const LoadPart& part : parts) {
        out.d_travel.row(l) += part.weight * direction.transpose() * at.d_conjugate.middleRows<3>(part.first);
        if (part.unknown < 0) continue;
        const auto own = std::find(out.columns.begin(), out.columns.end(), part.unknown);
        out.d_travel(l, own - out.columns.begin()) += part.per_unknown * direction.dot(at.conjugate_m.segment<3>(part.first));
      }
      if (whole.empty()) continue;
      // A turned clamp turns the object under the tool's direction.
      const Vec3 mean_motion_m = mean_motion(parts, at);
      const Mat3 turn = clamp.inverse_rotation_derivative(load.direction.normalized());
      for (const auto& [k, along] : whole) {
        out.d_travel(l, k) += mean_motion_m.dot(turn * along.tail<3>());
        if (out.columns[static_cast<std::size_t>(k)] == support_compliance_unknown_) out.d_travel(l, k) += given_way_along(s, load);
      }
    }
  }

  // The readings of a driven tool carry the sensor's tare, scale and clock; those of an imposed force are the load itself.
  const auto reading_column = [&](int unknown) {
    const auto it = std::find(out.columns.begin(), out.columns.end(), unknown);
    if (it != out.columns.end()) return static_cast<Index>(it - out.columns.begin());
    out.columns.push_back(unknown);
    const Index wider = static_cast<Index>(out.columns.size());
    const auto widen = [&](auto& matrix) {
      matrix.conservativeResize(matrix.rows(), wider);
      matrix.rightCols(1).setZero();
    };
    widen(out.d_surface);
    if (out.d_material.size() > 0) widen(out.d_material);
    if (out.in_span) widen(out.in_span->d_at);
    widen(out.d_travel);
    for (auto& block : out.d_force) widen(block);
    return wider - 1;
  };
  for (std::size_t l = 0; l < now.loads.size(); ++l) {
    if (!now.loads[l].travel_m) continue;
    if (force_scale_ >= 0) {
      const Index at_scale = reading_column(force_scale_);
      out.d_force[l].col(at_scale) -=
          read_share * read_share * (driven_force_n(body, now.loads[l], at) - tare_n(errors_of(s, l), unknowns));
    }
    if (time_offset_ >= 0) {
      const Index at_offset = reading_column(time_offset_);
      out.d_force[l].col(at_offset) -= now.loads[l].force_rate_n_s;
    }
    const ToolErrors& errors = errors_of(s, l);
    if (errors.tare < 0) continue;
    const bool along = errors.tare_axis.norm() > 0;
    for (int k = 0; k < (along ? 1 : 3); ++k) {
      const Index at_tare = reading_column(errors.tare + k);
      const Vec3 axis = along ? errors.tare_axis : Vec3(Vec3::Unit(k));
      out.d_force[l].col(at_tare) -= read_share * axis;
    }
  }
  return out;
}

}  // namespace palpate::estimation
