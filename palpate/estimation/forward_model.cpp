// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/forward_model.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "palpate/core/error.hpp"
#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
namespace {

const std::vector<std::string> xyz{"_x", "_y", "_z"};

/// How hard each step presses: its force, or else its imposed travel, as a share of the recording's highest.
std::vector<double> efforts(const Recording& recording) {
  std::vector<double> force, travel;
  for (const auto& push : recording.pushes) {
    for (const auto& step : push.steps) {
      force.push_back(0);
      travel.push_back(0);
      for (const auto& load : step.loads) {
        force.back() += load.force_n.value_or(Vec3::Zero()).norm();
        travel.back() = std::max(travel.back(), std::abs(load.travel_m.value_or(0)));
      }
    }
  }
  const auto highest = [](const std::vector<double>& all) {
    return all.empty() ? 0 : *std::max_element(all.begin(), all.end());
  };
  const double most_n = highest(force), most_m = highest(travel);
  for (std::size_t s = 0; s < force.size(); ++s)
    force[s] = force[s] > 0 ? force[s] / most_n : travel[s] > 0 ? travel[s] / most_m : 0;
  return force;
}

}  // namespace

ForwardModel::~ForwardModel() = default;

bool ForwardModel::Solved::holds_for(const Solved& other) const {
  const auto same = [](const VectorX& a, const VectorX& b) { return a.size() == b.size() && a == b; };
  return material == other.material && nodes == other.nodes && vertices == other.vertices && place_m == other.place_m &&
         supports == other.supports && spreads == other.spreads && options.dilatation == other.options.dilatation &&
         options.threads == other.options.threads && options.residual_tolerance == other.options.residual_tolerance &&
         options.region == other.options.region && same(options.region_stiffness, other.options.region_stiffness) &&
         poisson_lower == other.poisson_lower && poisson_upper == other.poisson_upper &&
         response_tolerance == other.response_tolerance && bodies.size() == other.bodies.size();
}

ForwardModel::ForwardModel(const Recording& recording, SimulatedObject object, Unknowns& unknowns, fem::StaticsOptions options,
                           std::shared_ptr<Solved> earlier, double response_tolerance)
    : recording_(&recording), object_(std::move(object)), options_(options) {
  // From a hundredth of a pascal to diamond: beyond that the fit has lost its way.
  unknowns.add({"young_modulus", "log Pa", 0, std::numeric_limits<double>::infinity(), std::log(1e-2), std::log(1.2e12)});
  unknowns.add({"poisson_ratio", "1", 0, std::numeric_limits<double>::infinity(), recording.model.poisson_lower,
                recording.model.poisson_upper});
  if (object_.region_names.size() > 1) {
    unknowns.add_ratios({object_.region_names.begin() + 1, object_.region_names.end()});
    options_.region = object_.region;
  }
  parameters_ = unknowns.parameter_count();
  force_scale_ = unknowns.add_block("force_scale", "1", recording.force_scale_std, {""});
  const bool weight_acts = recording.rest.state == RestState::stress_free && recording.environment.gravity_m_s2.norm() > 0;
  if (weight_acts) {
    if (!(recording.density_kg_m3 > 0)) throw Error("gravity acts, so the density is needed", "density_kg_m3");
    density_ = unknowns.add_block("density", "kg/m3", recording.density_std_kg_m3, {""});
    if (density_ >= 0) unknowns[density_].prior_mean = recording.density_kg_m3;
  }

  solved_ = std::make_shared<Solved>();
  if (recording.rest.surface_std_m > 0) {
    solved_->field_std_m = recording.rest.surface_std_m;
    solved_->field_correlation_m = recording.rest.surface_correlation_m;
    if (earlier && earlier->field && earlier->vertices == object_.surface.vertex_count() &&
        earlier->field_std_m == solved_->field_std_m && earlier->field_correlation_m == solved_->field_correlation_m) {
      solved_->field = std::move(earlier->field);
    } else {
      solved_->field =
          std::make_unique<SurfaceField>(object_.surface.rest(), solved_->field_std_m, solved_->field_correlation_m);
    }
    field_ = solved_->field.get();
    field_unknown_ = unknowns.size();
    for (Index k = 0; k < field_->modes(); ++k) unknowns.add({"rest_surface[" + std::to_string(k) + "]", "1", 0, 1});
  }

  // The clamp moves with everything that it holds: one rigid offset of the object in the base frame.
  const Support* clamp = nullptr;
  for (const auto& support : recording.supports) {
    if (support.pose_std_m > 0 || support.pose_std_rad > 0) {
      if (clamp != nullptr) throw Error("only one support may have an uncertain pose", "supports." + support.name);
      clamp = &support;
    }
  }
  const auto add_clamp = [&](const std::string& suffix) {
    const int first = unknowns.size();
    for (const auto& axis : xyz)
      unknowns.add({"clamp" + axis + suffix, "m", 0, clamp->pose_std_m, -1, 1, clamp->pose_std_m <= 0});
    for (const auto& axis : xyz) {
      unknowns.add({"clamp_rotation" + axis + suffix, "rad", 0, clamp->pose_std_rad, -1, 1, clamp->pose_std_rad <= 0});
    }
    return first;
  };
  if (clamp != nullptr) {
    const auto held = fem::support_nodes(object_.mesh, *clamp);
    for (Index node : held) clamp_pivot_m_ += object_.mesh.nodes_m.row(node).transpose() / static_cast<double>(held.size());
  }
  int common_clamp = clamp != nullptr && clamp->pose_varies == PoseVaries::never ? add_clamp("") : -1;

  for (const auto& support : recording.supports) {
    if (!recording.free && spreads(support))
      spread_.push_back(unknowns.add({"support_spread[" + support.name + "]", "m", 0, support.spread_std_m}));
  }

  std::map<std::string, int> radius_of;  // a tool's name: its unknown
  std::map<std::string, int> shift_of;   // a push's contact: first of two unknowns
  for (std::size_t p = 0; p < recording.pushes.size(); ++p) {
    const Push& push = recording.pushes[p];
    const std::string in_push = "[" + push.name + "]";
    int push_clamp = clamp != nullptr && clamp->pose_varies == PoseVaries::push ? add_clamp(in_push) : common_clamp;
    // A single-axis load cell has a tare along its axis only.
    Vec3 axis = Vec3::Zero();
    for (const auto& step : push.steps) {
      for (const auto& observation : step.observations) {
        if (const auto* wrench = std::get_if<Wrench>(&observation)) axis = wrench->along;
      }
    }
    tare_axis_.push_back(axis);
    tare_.push_back(unknowns.add_block("force_tare" + in_push, "N", push.force_tare_std_n,
                                       axis.norm() > 0 ? std::vector<std::string>{""} : xyz));
    const double offset_std_m =
        driven_tools(push).empty() ? 0 : push.travel_offset_std_m;  // else it belongs to the readings
    travel_offset_.push_back(unknowns.add_block("travel_offset" + in_push, "m", offset_std_m, {""}));
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      steps_.push_back({p, s});
      const std::string in_step = "[" + push.name + ":" + std::to_string(s) + "]";
      clamp_.push_back(clamp != nullptr && clamp->pose_varies == PoseVaries::step ? add_clamp(in_step) : push_clamp);
      std::vector<int> errors, shifts, radii;
      for (const auto& load : push.steps[s].loads) {
        const std::string shift = in_push + key_of(load);
        if (load.contact_std_m > 0 && has_place(recording, load) && shift_of.count(shift) == 0) {
          shift_of[shift] = unknowns.add_block("contact_shift" + in_push, "m", load.contact_std_m, {"_1", "_2"});
        }
        const auto known = shift_of.find(shift);
        shifts.push_back(known == shift_of.end() ? -1 : known->second);
        radii.push_back(-1);
        if (const Tool& touching = tool(load.tool); has_radius(touching, load)) {
          const auto [own, fresh] = radius_of.emplace(load.tool, 0);
          if (fresh) own->second = unknowns.add({"tool_radius[" + load.tool + "]", "m", 0, touching.radius_std_m});
          radii.back() = own->second;
        }
        const double std_n = load.force_n ? std::hypot(load.force_std_n, load.force_relative_std * load.force_n->norm()) : 0;
        errors.push_back(unknowns.add_block("force_error" + in_step, "N", std_n, xyz));
      }
      force_error_.push_back(errors);
      contact_shift_.push_back(shifts);
      patch_radius_.push_back(radii);
    }
  }
  effort_ = efforts(recording);
  memory_.resize(steps_.size());
  followed_.assign(steps_.size(), 0);
  contact_ = has_contacts(recording);
  path_ = depends_on_path(recording);
  workers_ = path_ ? 1 : std::clamp<std::size_t>(static_cast<std::size_t>(std::max(options_.threads, 1)), 1, steps_.size());
  // Unit responses are for one set of ratios; with regions a linear body is solved for at every step.
  linear_ = fem::material_law(object_.material).is_linear() && parameters_ == first_ratio && !contact_;
  poisson_lower_ = unknowns[poisson].lower;
  poisson_upper_ =
      recording.model.poisson_fixed ? poisson_lower_ : unknowns[poisson].upper;  // one ratio needs no polynomial
  // Steps share the threads; the solves in them use what is left over.
  if (!linear_) options_.threads = std::max(1, options_.threads / static_cast<int>(workers_));
  solved_->material = object_.material;
  solved_->nodes = static_cast<Index>(object_.mesh.nodes_m.rows());
  solved_->vertices = object_.surface.vertex_count();
  solved_->place_m = object_.mesh.nodes_m.sum();
  solved_->supports = recording.supports.size();
  solved_->spreads = spread_.size();
  solved_->options = options_;
  solved_->poisson_lower = poisson_lower_;
  solved_->poisson_upper = poisson_upper_;
  solved_->response_tolerance = response_tolerance;
  solved_->bodies.resize(linear_ ? 1 : workers_);
  if (earlier && !contact_ && solved_->holds_for(*earlier)) {
    solved_->bodies = std::move(earlier->bodies);
    for (auto& bodies : solved_->bodies) {
      for (const auto& push : recording.pushes) drop_if_unfit(bodies, push);
    }
  }
  solves_.assign(workers_, 0);
  for (std::size_t s = 0; s < steps_.size(); ++s) body_of(push(s), worker_of(s));
}

std::vector<int> ForwardModel::parameter_columns() const {
  std::vector<int> columns(static_cast<std::size_t>(parameters_));
  std::iota(columns.begin(), columns.end(), 0);
  return columns;
}

std::size_t ForwardModel::worker_of(std::size_t s) const {
  std::size_t worker = 0;
  while (first_step_of(worker + 1) <= s) ++worker;
  return worker;
}

int ForwardModel::solves() const {
  int sum = 0;
  for (int n : solves_) sum += n;
  return sum;
}

const Step& ForwardModel::step(std::size_t s) const { return push(s).steps[steps_[s].step]; }
const Push& ForwardModel::push(std::size_t s) const { return recording_->pushes[steps_[s].push]; }

const Tool& ForwardModel::tool(const std::string& name) const {
  for (const auto& tool : recording_->tools) {
    if (tool.name == name) return tool;
  }
  throw Error("no tool of this name", "loads.tool " + name);
}

void ForwardModel::forget() {
  for (auto& memory : memory_) memory = Memory{};
  for (auto& bodies : solved_->bodies) {
    for (auto& [tools, body] : bodies) {
      if (body->contact) body->contact->forget();
      body->lying = nullptr;
    }
  }
}

void ForwardModel::start_from(const ForwardModel& other) {
  for (std::size_t s = 0; s < memory_.size(); ++s) {
    const Memory& from = other.memory_[s];
    memory_[s] = Memory{};
    memory_[s].valid = from.valid;
    memory_[s].displacement_m = from.displacement_m;
    memory_[s].derivative.resize(from.displacement_m.size(), 0);
  }
}

ForwardModel::Watched ForwardModel::superpose(const Body& body, const Coefficients& c, const VectorX& unknowns,
                                              StepPrediction& out) const {
  const auto unit = body.response->at(unknowns(poisson));
  const double young_pa = std::exp(unknowns(log_young));
  const Index others = static_cast<Index>(c.columns.size()), rows = static_cast<Index>(unit->force.rows());
  const Index seen = rows - static_cast<Index>(body.forces.cols());
  const VectorX loaded = unit->force * (c.force / young_pa);
  const VectorX all = loaded + unit->motion * c.motion;
  MatrixX d(rows, 2 + others);
  d.col(0) = -loaded;
  d.col(1) = unit->force_d_poisson * (c.force / young_pa) + unit->motion_d_poisson * c.motion;
  d.rightCols(others) = unit->force * (c.d_force / young_pa) + unit->motion * c.d_motion;
  Watched watched;
  watched.moved_m = all.head(seen);
  watched.conjugate_m = all.tail(rows - seen);
  watched.d_moved = d.topRows(seen);
  watched.d_conjugate = d.bottomRows(rows - seen);
  watched.reaction_n = unit->reaction_force * c.force + young_pa * (unit->reaction_motion * c.motion);
  watched.d_reaction.resize(c.motion.size(), 2 + others);
  watched.d_reaction.col(0) = young_pa * (unit->reaction_motion * c.motion);
  watched.d_reaction.col(1) =
      unit->reaction_force_d_poisson * c.force + young_pa * (unit->reaction_motion_d_poisson * c.motion);
  watched.d_reaction.rightCols(others) = unit->reaction_force * c.d_force + young_pa * (unit->reaction_motion * c.d_motion);
  // Gradients add up at most; the polynomial knows them at its nodes only, hence the margin.
  const double gradient = c.force.cwiseAbs().dot(unit->largest_gradient_force) / young_pa +
                          c.motion.cwiseAbs().dot(unit->largest_gradient_motion);
  out.converged = true;
  out.inverted_elements = gradient < 0.7 ? 0 : -1;
  return watched;
}

double ForwardModel::reuse_error() const {
  const double furthest = *std::max_element(followed_.begin(), followed_.end());
  return furthest * furthest;
}

VectorX ForwardModel::Memory::change_to(const VectorX& there) const {
  VectorX change(static_cast<Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) change(static_cast<Index>(k)) = there(columns[k]) - unknowns(columns[k]);
  return change;
}

bool ForwardModel::follow(std::size_t s, const VectorX& unknowns, Watched& watched, StepPrediction& out) {
  const Memory& anchor = memory_[s];
  if (!anchor.valid || anchor.columns.empty()) return false;
  const VectorX change = anchor.change_to(unknowns);
  watched = anchor.watched;
  watched.moved_m += watched.d_moved * change;
  watched.reaction_n += watched.d_reaction * change;  // imposed motions do not move with E, but their reactions do
  double share = 0;
  const auto within = [&](const VectorX& now, const VectorX& before) {
    if (now.size() == 0) return true;
    const double moved = (now - before).lpNorm<Eigen::Infinity>(), size = before.lpNorm<Eigen::Infinity>();
    if (moved > reuse_ * size) return false;
    if (moved > 0) share = std::max(share, moved / size);
    return true;
  };
  if (!within(watched.moved_m, anchor.watched.moved_m) || !within(watched.reaction_n, anchor.watched.reaction_n)) return false;
  followed_[s] = share;
  watched.conjugate_m += watched.d_conjugate * change;
  out.converged = true;
  out.inverted_elements = anchor.inverted_elements;
  return true;
}

void ForwardModel::set_ratios(Body& body, const VectorX& unknowns) const {
  if (parameters_ == first_ratio) return;
  VectorX stiffness = VectorX::Ones(1 + parameters_ - first_ratio);
  stiffness.tail(stiffness.size() - 1) = unknowns.segment(first_ratio, parameters_ - first_ratio).array().exp();
  if (body.contact) {
    body.contact->set_region_stiffness(stiffness);
  } else {
    body.statics->set_region_stiffness(stiffness);
  }
}

int ForwardModel::inverted_elements(std::size_t s, const VectorX& unknowns) {
  Body& body = body_of(push(s), worker_of(s));
  if (body.contact) return predict(s, unknowns, false).inverted_elements;
  set_ratios(body, unknowns);
  const Coefficients c = coefficients(s, body, unknowns);
  const auto at = body.statics->solve(std::exp(unknowns(log_young)), unknowns(poisson), c.force, c.motion);
  return at.inverted_elements;
}

bool ForwardModel::solve_step(std::size_t s, Body& body, const Coefficients& c, const VectorX& unknowns, bool derivatives,
                              Watched& watched, StepPrediction& out) {
  const std::size_t worker = worker_of(s);
  followed_[s] = 0;
  if (body.contact) return solve_contact_step(s, body, c, unknowns, derivatives, watched, out);
  // Start from the last solution of this step, or else of the step before, moved along its derivatives.
  Memory& memory = memory_[s];
  const Memory* from = memory.valid ? &memory : nullptr;
  VectorX start;
  if (from != nullptr) {
    start = from->displacement_m;
    start += from->derivative * from->change_to(unknowns);
    // A straight line is no good guess for a far step.
    const double moved_m = (start - from->displacement_m).lpNorm<Eigen::Infinity>();
    if (moved_m > 0.2 * from->displacement_m.lpNorm<Eigen::Infinity>()) start = from->displacement_m;
  } else if (s > first_step_of(worker) && steps_[s - 1].push == steps_[s].push && memory_[s - 1].valid) {
    start = memory_[s - 1].displacement_m;
  }

  set_ratios(body, unknowns);
  const double young_pa = std::exp(unknowns(log_young));
  const auto solve = [&](const VectorX* guess) {
    auto at = body.statics->solve(young_pa, unknowns(poisson), c.force, c.motion, guess);
    ++solves_[worker];
    return at;
  };
  fem::Equilibrium at = solve(start.size() > 0 ? &start : nullptr);
  if (!at.converged && start.size() > 0) at = solve(nullptr);
  out.converged = at.converged;
  out.reason = at.reason;
  out.inverted_elements = at.inverted_elements;
  if (!at.converged) return false;

  watched.moved_m = object_.surface.restrict(at.displacement_m);
  if (!derivatives) {
    memory = {true, unknowns, at.displacement_m, {}, MatrixX(at.displacement_m.size(), 0), {}, at.inverted_elements, {}};
    return true;
  }
  const fem::SensitivityAlong d = body.statics->sensitivity_along(at, c.d_force, c.d_motion);
  const Index others = static_cast<Index>(c.columns.size());
  const Index ratios = parameters_ - first_ratio;  // of the further regions: the first one's stiffness is E itself
  MatrixX field(at.displacement_m.size(), parameters_ + others);
  field << d.d_log_young, d.d_poisson, d.d_log_stiffness.rightCols(ratios), d.d_along;
  watched.d_moved = object_.surface.restrict(field);
  watched.conjugate_m = body.forces.transpose() * at.displacement_m;
  watched.d_conjugate = body.forces.transpose() * field;
  watched.reaction_n = at.motion_reaction;
  watched.d_reaction.resize(c.motion.size(), parameters_ + others);
  watched.d_reaction << d.reaction_d_log_young, d.reaction_d_poisson, d.reaction_d_log_stiffness.rightCols(ratios),
      d.reaction_d_along;
  memory = {true, unknowns, at.displacement_m, parameter_columns(), std::move(field), watched, at.inverted_elements, {}};
  memory.columns.insert(memory.columns.end(), c.columns.begin(), c.columns.end());
  return true;
}

/// Into the base frame: x = T(X + b n + u).
void ForwardModel::place_surface(std::size_t s, const VectorX& unknowns, const VectorX& moved_m, StepPrediction& out) const {
  const RigidOffset clamp = clamp_offset(s, unknowns);
  out.surface_m = object_.surface.rest().vertices_m;
  for (Index v = 0; v < out.surface_m.rows(); ++v) {
    out.surface_m.row(v) = clamp.apply(out.surface_m.row(v).transpose() + moved_m.segment<3>(3 * v));
  }
  if (!field_) return;
  out.field = field_;
  out.field_unknown = field_unknown_;
  out.material_m = out.surface_m;
  out.field_directions = field_->normals() * clamp.rotation().transpose();
  const VectorX offset_m = field_->basis() * unknowns.segment(field_unknown_, field_->modes());
  out.surface_m += offset_m.asDiagonal() * out.field_directions;
}

StepPrediction ForwardModel::predict(std::size_t s, const VectorX& unknowns, bool derivatives) {
  const std::size_t worker = worker_of(s);
  Body& body = body_of(push(s), worker);
  Coefficients c = coefficients(s, body, unknowns);
  if (body.contact && path_) add_path_columns(s, body, unknowns, c);

  StepPrediction out;
  Watched at;
  if (linear_) {
    at = superpose(body, c, unknowns, out);
    ++solves_[worker];
  } else if (!(reuse_ > 0 && derivatives && follow(s, unknowns, at, out)) &&
             !solve_step(s, body, c, unknowns, derivatives, at, out)) {
    return out;
  }

  place_surface(s, unknowns, at.moved_m, out);
  if (!derivatives) return out;

  out.columns = parameter_columns();
  out.columns.insert(out.columns.end(), c.columns.begin(), c.columns.end());
  const Index count = static_cast<Index>(out.columns.size());

  const RigidOffset clamp = clamp_offset(s, unknowns);
  const Mat3 rotation = clamp.rotation();
  out.d_surface = std::move(at.d_moved);
  if (clamp_[s] >= 0) {
    for (Index v = 0; v < out.surface_m.rows(); ++v) {
      out.d_surface.middleRows<3>(3 * v) = (rotation * out.d_surface.middleRows<3>(3 * v)).eval();
    }
    const auto add_rigid = [&](const Points& at_m, MatrixX& derivative) {
      for (Index v = 0; v < at_m.rows(); ++v) {
        const auto rigid = clamp.derivative(clamp.apply_inverse(at_m.row(v)));
        for (Index k = parameters_; k < count; ++k) {
          const int component = out.columns[static_cast<std::size_t>(k)] - clamp_[s];
          if (component >= 0 && component < 6) derivative.block<3, 1>(3 * v, k) += rigid.col(component);
        }
      }
    };
    if (field_) {
      out.d_material = out.d_surface;
      add_rigid(out.material_m, out.d_material);
    }
    add_rigid(out.surface_m, out.d_surface);
  }

  // What the tools should read.
  const std::size_t p = steps_[s].push;
  const Step& now = step(s);
  const Index loads = static_cast<Index>(now.loads.size());
  out.travel_m = VectorX::Zero(loads);
  out.d_travel = MatrixX::Zero(loads, count);
  out.force_n.assign(now.loads.size(), Vec3::Zero());
  out.d_force.assign(now.loads.size(), Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, count));
  const double scale = force_scale_ >= 0 ? 1 + unknowns(force_scale_) : 1;
  for (Index l = 0; l < loads; ++l) {
    const auto at_load = static_cast<std::size_t>(l);
    const Load& load = now.loads[at_load];
    if (load.travel_m) {
      const Vec3 direction = load.direction.normalized();
      const int m = body.motion_column.at(load.tool);
      const double reaction = at.reaction_n(m);
      const Eigen::RowVectorXd d_reaction = at.d_reaction.row(m);
      out.force_n[at_load] = scale * reaction * direction;
      out.d_force[at_load] = scale * direction * d_reaction;
      for (Index k = parameters_; k < count; ++k) {
        if (out.columns[static_cast<std::size_t>(k)] == force_scale_) out.d_force[at_load].col(k) += reaction * direction;
      }
      out.travel_m(l) = c.motion(m);
      for (Index k = parameters_; k < count; ++k) out.d_travel(l, k) = c.d_motion(m, k - parameters_);
    } else {
      out.force_n[at_load] = load.force_n.value_or(Vec3::Zero());
      const std::vector<LoadPart> parts = load_parts(s, at_load, body, unknowns);
      if (parts.empty()) continue;
      const Vec3 direction = rotation.transpose() * load.direction.normalized();
      Vec3 mean_motion_m = Vec3::Zero();
      for (const LoadPart& part : parts) {
        const Vec3 conjugate_m = at.conjugate_m.segment<3>(part.first);
        mean_motion_m += part.weight * conjugate_m;
        out.d_travel.row(l) += part.weight * direction.transpose() * at.d_conjugate.middleRows<3>(part.first);
        if (part.unknown < 0) continue;
        const auto own = std::find(out.columns.begin(), out.columns.end(), part.unknown);
        out.d_travel(l, own - out.columns.begin()) += direction.dot(conjugate_m);
      }
      out.travel_m(l) = direction.dot(mean_motion_m);
      if (clamp_[s] < 0) continue;
      // A turned clamp turns the object under the tool's direction.
      const Mat3 turn = clamp.inverse_rotation_derivative(load.direction.normalized());
      for (Index k = parameters_; k < count; ++k) {
        const int component = out.columns[static_cast<std::size_t>(k)] - clamp_[s] - 3;
        if (component >= 0 && component < 3) out.d_travel(l, k) += mean_motion_m.dot(turn.col(component));
      }
    }
  }

  // The readings of a driven platen carry the sensor's tare and scale; those of an imposed force are the load itself.
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
    widen(out.d_travel);
    for (auto& block : out.d_force) widen(block);
    return wider - 1;
  };
  for (std::size_t l = 0; l < now.loads.size(); ++l) {
    if (!now.loads[l].travel_m) continue;
    if (force_scale_ >= 0 && std::find(c.columns.begin(), c.columns.end(), force_scale_) == c.columns.end()) {
      const Index at_scale = reading_column(force_scale_);
      out.d_force[l].col(at_scale) += out.force_n[l] / scale;
    }
    if (tare_[p] < 0) continue;
    const bool along = tare_axis_[p].norm() > 0;
    for (int k = 0; k < (along ? 1 : 3); ++k) {
      const Index at_tare = reading_column(tare_[p] + k);
      const Vec3 axis = along ? tare_axis_[p] : Vec3(Vec3::Unit(k));
      out.force_n[l] += unknowns(tare_[p] + k) * axis;
      out.d_force[l].col(at_tare) += axis;
    }
  }
  return out;
}

}  // namespace palpate::estimation
