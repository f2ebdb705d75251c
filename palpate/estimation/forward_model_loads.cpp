// SPDX-License-Identifier: Apache-2.0
// Loads and supports of a step as columns of the solver, and their coefficients with derivatives.
#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::estimation {
namespace {

/// Pushes of one key share a body: the same platens, and rigid tools at the same places.
std::string body_key(const Push& push) {
  std::set<std::string> parts;
  for (const auto& step : push.steps) {
    for (const auto& load : step.loads) {
      if (load.travel_m) parts.insert(key_of(load) + "," + std::to_string(load.direction.x()) + "," + std::to_string(load.direction.y()) +
                                      "," + std::to_string(load.direction.z()));
    }
  }
  std::string key;
  for (const auto& part : parts) key += part + "\n";
  return key;
}

}  // namespace

Vec3 read_force_n(const Step& step, const Load& load) {
  for (const auto& observation : step.observations) {
    const auto* wrench = std::get_if<Wrench>(&observation);
    if (wrench != nullptr && (wrench->tool.empty() || wrench->tool == load.tool)) return wrench->force_n;
  }
  return Vec3::Zero();
}

std::string key_of(const Load& load) {
  std::string key = load.tool;
  const Vec3 place_m = touched_m(load);
  for (int d = 0; d < 3; ++d) key += "," + std::to_string(place_m(d));
  return key;
}

std::set<std::string> driven_tools(const Push& push) {
  std::set<std::string> names;
  for (const auto& step : push.steps) {
    for (const auto& load : step.loads) {
      if (load.travel_m) names.insert(load.tool);
    }
  }
  return names;
}

bool has_place(const Recording& recording, const Load& load) {
  const auto tool = std::find_if(recording.tools.begin(), recording.tools.end(), [&](const Tool& t) { return t.name == load.tool; });
  return tool != recording.tools.end() && tool->shape != ToolShape::vertices && tool->shape != ToolShape::platen;
}

bool has_radius(const Tool& tool, const Load& load) {
  return tool.radius_std_m > 0 && (tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc) && has_columns(load);
}

bool has_columns(const Load& load) {
  return !load.travel_m && load.force_n.value_or(Vec3::Zero()).norm() + load.force_std_n > 0;
}

void ForwardModel::drop_if_unfit(std::map<std::string, std::unique_ptr<Body>>& bodies) const {
  for (std::size_t s = 0; s < steps_.size(); ++s) {
    const std::vector<Load>& loads = step(s).loads;
    if (std::none_of(loads.begin(), loads.end(), has_columns)) continue;
    const auto known = bodies.find(body_key(push(s)));
    if (known == bodies.end()) continue;
    for (std::size_t l = 0; l < loads.size(); ++l) {
      if (!has_columns(loads[l])) continue;
      const auto at = known->second->contacts.find(key_of(loads[l]));
      if (at == known->second->contacts.end() || (contact_shift_[s][l] >= 0 && !at->second.shifts_across(shift_direction_.at(contact_shift_[s][l]))) ||
          (has_radius(tool(loads[l].tool), loads[l]) && at->second.radius < 0)) {
        bodies.erase(known);
        break;
      }
    }
  }
}

ForwardModel::Body& ForwardModel::body_of(const Push& push, std::size_t worker) {
  auto& bodies = solved_->bodies[linear_ ? 0 : worker];
  const auto known = bodies.find(body_key(push));
  if (known != bodies.end()) return *known->second;
  auto& body = bodies[body_key(push)];
  body = std::make_unique<Body>();

  std::vector<const Tool*> platens;
  for (const auto& tool : recording_->tools) {
    if (driven_tools(push).count(tool.name) == 0 || touches_rigidly(tool)) continue;
    if (tool.shape != ToolShape::platen) {
      throw Error("chosen vertices have no shape whose motion could be imposed; give the force on them and their travel as an "
                  "observation",
                  "tools." + tool.name);
    }
    body->motion_column[tool.name] = static_cast<int>(platens.size());
    platens.push_back(&tool);
  }

  // Columns of every contact of the pushes that share this body.
  std::vector<Eigen::SparseMatrix<double>> parts;
  std::size_t s = 0;
  for (const auto& other : recording_->pushes) {
    const bool shares = body_key(other) == body_key(push);
    for (std::size_t k = 0; k < other.steps.size(); ++k, ++s) {
      const std::vector<Load>& loads = other.steps[k].loads;
      for (std::size_t l = 0; shares && l < loads.size(); ++l) {
        const Load& load = loads[l];
        if (!has_columns(load)) continue;
        Body::Contact& contact = body->contacts[key_of(load)];
        const auto next_column = [&] { return static_cast<int>(3 * parts.size()); };
        const Tool& tool = this->tool(load.tool);
        if (contact.force < 0) {
          contact.force = next_column();
          parts.push_back(load_columns(object_.mesh, tool, load));
        }
        if (contact_shift_[s][l] >= 0) {
          const Vec3& direction = shift_direction_.at(contact_shift_[s][l]);
          if (contact.shift < 0) {
            contact.shift = next_column();
            contact.direction = direction;
            for (const Vec3& tangent : tangents(direction)) parts.push_back(shifted_columns(object_.mesh, tool, load, tangent));
          } else if (!contact.shifts_across(direction)) {
            contact.along = next_column();
            parts.push_back(shifted_columns(object_.mesh, tool, load, contact.direction.normalized()));
          }
        }
        if (contact.radius < 0 && has_radius(tool, load)) {
          contact.radius = next_column();
          parts.push_back(widened_columns(object_.mesh, tool, load));
        }
      }
    }
  }
  const bool lies = contact_ && recording_->density_kg_m3 > 0;  // its weight holds it down, whether or not it shows
  if ((recording_->rest.state == RestState::stress_free || lies) && recording_->environment.gravity_m_s2.norm() > 0) {
    body->gravity_column = static_cast<int>(3 * parts.size());
    parts.push_back(fem::body_force(object_.mesh));
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t part = 0; part < parts.size(); ++part) {
    for (int c = 0; c < 3; ++c) {
      for (Eigen::SparseMatrix<double>::InnerIterator it(parts[part], c); it; ++it) {
        entries.emplace_back(static_cast<int>(it.row()), static_cast<int>(3 * part) + c, it.value());
      }
    }
  }

  fem::Boundary boundary;
  boundary.forces.resize(3 * object_.mesh.nodes_m.rows(), static_cast<Index>(3 * parts.size()));
  boundary.forces.setFromTriplets(entries.begin(), entries.end());
  boundary.inertia_relief = recording_->free;
  std::vector<fem::RigidContact> tables;
  if (recording_->free) {
    if (!platens.empty())
      throw Error("a platen presses an object against something, and this one is free; say what holds it", "supports");
    boundary.motions.resize(3 * object_.mesh.nodes_m.rows(), 0);
  } else {
    HeldBody held = hold(object_.mesh, recording_->supports, platens);
    boundary.constraints = std::move(held.constraints);
    boundary.motions = std::move(held.motions);
    body->free_motions = std::move(held.free_motions);
    tables = std::move(held.contacts);
  }
  body->forces = boundary.forces;
  prepare_slide(*body);
  body->spreads = static_cast<int>(spread_.size());
  body->node_motions = static_cast<int>(platens.size()) + body->spreads;
  fem::Response::Options options;
  options.statics = options_;
  options.poisson_lower = poisson_lower_;
  options.poisson_upper = poisson_upper_;
  options.superposed_tolerance = solved_->response_tolerance;
  if (contact_) add_contacts(*body, push, std::move(tables), options);
  body->response = std::make_unique<fem::Response>(object_.mesh, object_.material, std::move(boundary),
                                                   object_.surface.rows(static_cast<Index>(object_.mesh.nodes_m.rows())), options);
  return *body;
}

const ForwardModel::Body& ForwardModel::body_of(std::size_t s) const {
  return *solved_->bodies[linear_ ? 0 : worker_of(s)].at(body_key(push(s)));
}

Vec3 ForwardModel::contact_found_m(std::size_t s, std::size_t l, const VectorX& unknowns) const {
  const int shift = contact_shift_[s][l];
  if (shift < 0) return Vec3::Zero();
  const std::array<Vec3, 2> across = tangents(shift_direction_.at(shift));
  return unknowns(shift) * across[0] + unknowns(shift + 1) * across[1];
}

std::vector<ForwardModel::LoadPart> ForwardModel::load_parts(std::size_t s, std::size_t l, const Body& body,
                                                             const VectorX& unknowns) const {
  const auto found = body.contacts.find(key_of(step(s).loads[l]));
  if (found == body.contacts.end()) return {};
  const Body::Contact& contact = found->second;
  std::vector<LoadPart> parts{{contact.force}};
  const int shift = contact_shift_[s][l];
  if (shift >= 0) {
    const Vec3& direction = shift_direction_.at(shift);
    const std::array<Vec3, 2> across = tangents(direction), known = tangents(contact.direction);
    for (int k = 0; k < 2; ++k) {
      const Vec3& way = across[static_cast<std::size_t>(k)];
      const double from_found_m = unknowns(shift + k) - way.dot(step(s).loads[l].contact_found_m);
      if (direction == contact.direction) {
        parts.push_back({contact.shift + 3 * k, from_found_m, shift + k});
        continue;
      }
      // A push another way at the same place: its tangents put together of the ways that there are columns of.
      const auto add = [&](int first, double share) { parts.push_back({first, share * from_found_m, shift + k, share}); };
      for (int j = 0; j < 2; ++j) add(contact.shift + 3 * j, way.dot(known[static_cast<std::size_t>(j)]));
      add(contact.along, way.dot(contact.direction.normalized()));
    }
  }
  if (const int radius = patch_radius_[s][l]; radius >= 0) parts.push_back({contact.radius, unknowns(radius), radius});
  return parts;
}

ForwardModel::TrueForce ForwardModel::true_force(std::size_t s, std::size_t l, const VectorX& unknowns) const {
  const ToolErrors& errors = errors_of(s, l);
  const Load& load = step(s).loads[l];
  const int error = force_error_[s][l];
  Vec3 measured = load.force_n.value_or(Vec3::Zero());
  if (error >= 0) measured += unknowns.segment<3>(error);
  if (time_offset_ >= 0) measured += unknowns(time_offset_) * load.force_rate_n_s;
  // What the sensor reads across of what acts along: a strain gauge's axes are not quite square.
  const int cross = errors.cross_talk;
  const Vec3 along = load.direction.normalized();
  const std::array<Vec3, 2> across = tangents(along);
  const Vec3 leaks = cross >= 0 ? Vec3(unknowns(cross) * across[0] + unknowns(cross + 1) * across[1]) : Vec3(Vec3::Zero());
  const double read_along_n = along.dot(measured);
  const auto straightened = [&](const Vec3& read) { return Vec3(read - along.dot(read) * leaks); };
  measured = straightened(measured);
  const double scale = force_scale_ >= 0 ? 1 + unknowns(force_scale_) : 1;
  TrueForce out;
  out.force_n = scale * measured;
  for (int k = 0; error >= 0 && k < 3; ++k) out.derivatives.emplace_back(error + k, scale * straightened(Vec3::Unit(k)));
  if (force_scale_ >= 0) out.derivatives.emplace_back(force_scale_, measured);
  if (time_offset_ >= 0) out.derivatives.emplace_back(time_offset_, scale * straightened(load.force_rate_n_s));
  for (int k = 0; cross >= 0 && k < 2; ++k) out.derivatives.emplace_back(cross + k, -scale * read_along_n * across[static_cast<std::size_t>(k)]);
  out.force_n += tare_n(errors, unknowns);
  if (errors.tare < 0) return out;
  const bool one_axis = errors.tare_axis.norm() > 0;
  for (int k = 0; k < (one_axis ? 1 : 3); ++k) {
    const Vec3 axis = one_axis ? errors.tare_axis : Vec3(Vec3::Unit(k));
    out.derivatives.emplace_back(errors.tare + k, axis);
  }
  return out;
}

ForwardModel::Coefficients ForwardModel::coefficients(std::size_t s, const Body& body, const VectorX& unknowns) const {
  Coefficients c;
  c.force = VectorX::Zero(body.forces.cols());
  c.motion = VectorX::Zero(body.response->motion_count());
  c.d_force.resize(c.force.size(), 0);
  c.d_motion.resize(c.motion.size(), 0);
  std::map<int, int> column_of;
  const auto column = [&](int unknown) {
    const auto [it, fresh] = column_of.emplace(unknown, static_cast<int>(c.columns.size()));
    if (fresh) {
      c.columns.push_back(unknown);
      c.d_force.conservativeResize(c.force.size(), static_cast<Index>(c.columns.size()));
      c.d_motion.conservativeResize(c.motion.size(), static_cast<Index>(c.columns.size()));
      c.d_force.rightCols<1>().setZero();
      c.d_motion.rightCols<1>().setZero();
    }
    return it->second;
  };
  const RigidOffset clamp = clamp_offset(s, unknowns);
  const std::vector<WholeMotion> whole = whole_motions(s);
  const Mat3 into_object = clamp.rotation().transpose();
  const auto add_vector = [&](int first, const Vec3& base) {
    c.force.segment<3>(first) += into_object * base;
    if (whole.empty()) return;
    const Mat3 d = clamp.inverse_rotation_derivative(base);
    for (const auto& [unknown, along] : whole) {
      const int at = column(unknown);
      c.d_force.block<3, 1>(first, at) += d * along.tail<3>();
    }
  };

  const std::size_t p = steps_[s].push;
  const Step& now = step(s);
  for (std::size_t l = 0; l < now.loads.size(); ++l) {
    const Load& load = now.loads[l];
    if (load.travel_m) {
      const int at = body.motion_column.at(load.tool);
      const double read_n = read_force_n(now, load).dot(load.direction.normalized());
      c.motion(at) = *load.travel_m - tool(load.tool).compliance_m_per_n * read_n;
      if (const int yields = compliance_unknown(load.tool); yields >= 0) {
        c.motion(at) -= unknowns(yields) * read_n;
        c.d_motion(at, column(yields)) = -read_n;
      }
      const double given_way = given_way_along(s, load);
      c.motion(at) -= support_compliance(unknowns) * given_way;
      if (support_compliance_unknown_ >= 0) {
        const int place = column(support_compliance_unknown_);
        c.d_motion(at, place) = -given_way;
      }
      for (const int off : {errors_of(s, l).travel_offset, force_error_[s][l]}) {
        if (off < 0) continue;
        c.motion(at) += unknowns(off);
        const int place = column(off);
        c.d_motion(at, place) = 1;
      }
      continue;
    }
    const std::vector<LoadPart> parts = load_parts(s, l, body, unknowns);
    if (parts.empty()) continue;
    const auto [force, derivatives] = true_force(s, l, unknowns);
    for (const auto& [first, weight, own_unknown, per_unknown] : parts) {
      add_vector(first, weight * force);
      for (const auto& [unknown, d] : derivatives) {
        const int at = column(unknown);
        c.d_force.block<3, 1>(first, at) += weight * (into_object * d);
      }
      if (own_unknown >= 0) {
        const int at = column(own_unknown);
        c.d_force.block<3, 1>(first, at) += per_unknown * (into_object * force);
      }
    }
  }
  // Where a rigid tool stands is the push's, also in steps in which it does not touch.
  const auto standing_shift = [&](const std::string& name) -> std::optional<std::pair<int, Vec3>> {
    for (std::size_t t = first_step_of_push(s); t < steps_.size() && steps_[t].push == p; ++t) {
      const std::vector<Load>& loads = step(t).loads;
      for (std::size_t l = 0; l < loads.size(); ++l)
        if (loads[l].tool == name && contact_shift_[t][l] >= 0) return std::pair(contact_shift_[t][l], loads[l].contact_found_m);
    }
    return std::nullopt;
  };
  for (const auto& [name, stands] : body.standing) {
    const std::array<Vec3, 2> across = tangents(stands.direction);
    const auto shift = standing_shift(name);
    for (int k = 0; shift && k < 2; ++k) {
      c.motion(stands.column + k) = unknowns(shift->first + k) - across[static_cast<std::size_t>(k)].dot(shift->second);
      const int place = column(shift->first + k);
      c.d_motion(stands.column + k, place) = 1;
    }
  }
  if (body.gravity_column >= 0) {
    const double density = density_ >= 0 ? unknowns(density_) : recording_->density_kg_m3;
    const Vec3& gravity = recording_->environment.gravity_m_s2;
    add_vector(body.gravity_column, density * gravity);
    if (density_ >= 0) {
      const int at = column(density_);
      c.d_force.block<3, 1>(body.gravity_column, at) += into_object * gravity;
    }
  }
  for (int k = 0; k < body.spreads; ++k) {
    const int unknown = spread_[static_cast<std::size_t>(k)], motion = body.node_motions - body.spreads + k;
    c.motion(motion) = effort_[s] * unknowns(unknown);
    c.d_motion(motion, column(unknown)) = effort_[s];
  }
  for (Index k = 0; s < slide_.size() && slide_[s] >= 0 && k < body.slide.cols(); ++k) column(slide_[s] + static_cast<int>(k));
  // The clamp moves the surface, whether or not a load depends on it.
  for (const WholeMotion& one : whole) column(one.unknown);
  drop_what_nothing_holds(s, body, unknowns, c);
  return c;
}

}  // namespace palpate::estimation
