// SPDX-License-Identifier: Apache-2.0
// Steps of an object that touches tables, walls and rigid tools: contact is solved for, and where there is friction every
// step starts from the one before.
#include <algorithm>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/rigid_tool.hpp"

namespace palpate::estimation {

bool touches_rigidly(const Tool& tool) {
  if (tool.shape == ToolShape::platen) return tool.contact == ContactLaw::friction;
  return tool.shape != ToolShape::vertices;
}

namespace {

/// Calls visit for every tool whose motion is imposed and that touches as a rigid body.
template <typename Visit>
void for_each_driven(const Recording& recording, const Push& push, Visit&& visit) {
  for (const auto& tool : recording.tools) {
    if (!touches_rigidly(tool)) continue;
    for (const auto& step : push.steps) {
      const auto load = std::find_if(step.loads.begin(), step.loads.end(),
                                     [&](const Load& each) { return each.tool == tool.name && each.travel_m; });
      if (load == step.loads.end()) continue;
      visit(tool, *load);
      break;
    }
  }
}

/// Columns of `from` (the parameters, then the unknowns of `columns`) in the order of the parameters and `wanted`.
MatrixX in_order(const MatrixX& from, Index parameters, const std::vector<int>& columns, const std::vector<int>& wanted) {
  MatrixX out = MatrixX::Zero(from.rows(), parameters + static_cast<Index>(wanted.size()));
  out.leftCols(parameters) = from.leftCols(parameters);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const auto at = std::find(wanted.begin(), wanted.end(), columns[k]);
    if (at != wanted.end()) out.col(parameters + (at - wanted.begin())) = from.col(parameters + static_cast<Index>(k));
  }
  return out;
}

}  // namespace

bool has_contacts(const Recording& recording) {
  if (std::any_of(recording.supports.begin(), recording.supports.end(), lifts_off)) return true;
  bool any = false;
  for (const auto& push : recording.pushes) for_each_driven(recording, push, [&](const Tool&, const Load&) { any = true; });
  return any;
}

bool depends_on_path(const Recording& recording) {
  bool any = std::any_of(recording.supports.begin(), recording.supports.end(), [](const Support& support) {
    return lifts_off(support) && support.contact == ContactLaw::friction;
  });
  for (const auto& push : recording.pushes)
    for_each_driven(recording, push,
                    [&](const Tool& tool, const Load&) { any = any || tool.contact != ContactLaw::frictionless; });
  return any;
}

void ForwardModel::add_contacts(Body& body, const Push& push, fem::Boundary boundary,
                                std::vector<fem::RigidContact> supports) {
  std::vector<fem::RigidContact> contacts = std::move(supports);
  for_each_driven(*recording_, push, [&](const Tool& tool, const Load& load) {
    const int column = body.node_motions + static_cast<int>(body.driven.size());
    body.motion_column[tool.name] = column;
    body.driven.push_back({contacts.size(), push_direction(tool, load), column});
    contacts.push_back(rigid_tool(object_.mesh, tool, load));
  });
  fem::ContactOptions options;
  options.statics = options_;
  options.friction_tolerance = std::min(options.friction_tolerance, 100 * options_.residual_tolerance);
  body.contact = std::make_unique<fem::ContactStatics>(object_.mesh, object_.material, std::move(boundary),
                                                       std::move(contacts), options);
}

/// With friction a step depends on everything that the steps before it depend on.
void ForwardModel::add_path_columns(std::size_t s, const Body& body, const VectorX& unknowns, Coefficients& c) const {
  for (std::size_t before = first_step_of_push(s); before < s; ++before) {
    for (int column : coefficients(before, body, unknowns).columns) {
      if (std::find(c.columns.begin(), c.columns.end(), column) == c.columns.end()) c.columns.push_back(column);
    }
  }
  const auto widen = [&](MatrixX& d) {
    const Index had = static_cast<Index>(d.cols());
    d.conservativeResize(d.rows(), static_cast<Index>(c.columns.size()));
    d.rightCols(d.cols() - had).setZero();
  };
  widen(c.d_force);
  widen(c.d_motion);
}

/// The same state at other unknowns, moved along its derivatives where it has them; a straight line is no guess for a far
/// step.
fem::ContactEquilibrium ForwardModel::ContactState::moved_to(const VectorX& there) const {
  fem::ContactEquilibrium guess = at;
  if (!differentiated) return guess;
  VectorX change(d.displacement.cols());
  for (Index k = 0; k < change.size(); ++k) {
    const Index unknown = k < parameters ? k : columns[static_cast<std::size_t>(k - parameters)];
    change(k) = there(unknown) - unknowns(unknown);
  }
  const VectorX moved_m = d.displacement * change;
  if (moved_m.lpNorm<Eigen::Infinity>() < 0.2 * at.displacement_m.lpNorm<Eigen::Infinity>()) guess.displacement_m += moved_m;
  return guess;
}

ForwardModel::ContactStatePtr ForwardModel::solve_contact(Body& body, const Coefficients& c, const VectorX& unknowns,
                                                          bool derivatives, const ContactStatePtr& start,
                                                          const ContactStatePtr& before, const ContactStatePtr& known,
                                                          std::size_t worker) {
  const fem::ContactStatics& statics = *body.contact;
  fem::ContactLoads loads = statics.no_loads();
  loads.force_coefficients = c.force;
  loads.motion_coefficients = c.motion.head(body.node_motions);
  for (const auto& tool : body.driven) loads.motion[tool.contact].head<3>() = c.motion(tool.motion_column) * tool.direction;
  auto state = std::make_shared<ContactState>();
  state->unknowns = unknowns;
  state->parameters = parameters_;
  set_ratios(body, unknowns);
  std::optional<fem::ContactEquilibrium> guess;
  if (path_ && known && known->at.converged) guess = known->moved_to(unknowns);
  const auto solve = [&](const fem::ContactEquilibrium* from) {
    ++solves_[worker];
    return statics.solve(std::exp(unknowns(log_young)), unknowns(poisson), loads, from, {}, guess ? &*guess : nullptr);
  };
  state->at = solve(start ? &start->at : nullptr);
  // Without memory the way does not matter: a start that led nowhere is left.
  if (!state->at.converged && !path_ && start) state->at = solve(nullptr);
  if (!state->at.converged || !derivatives) return state;

  state->columns = before ? before->columns : std::vector<int>();
  for (int column : c.columns) {
    if (std::find(state->columns.begin(), state->columns.end(), column) == state->columns.end())
      state->columns.push_back(column);
  }
  const Index parameters = parameters_ + static_cast<Index>(state->columns.size());
  fem::ContactLoadsAlong along = statics.no_loads_along(parameters);
  along.log_young(log_young) = along.poisson(poisson) = 1;
  // The first region's stiffness is E itself.
  for (Index r = 1; r < along.log_stiffness.rows(); ++r) along.log_stiffness(r, first_ratio + r - 1) = 1;
  for (std::size_t k = 0; k < c.columns.size(); ++k) {
    const Index from = static_cast<Index>(k);
    const auto found = std::find(state->columns.begin(), state->columns.end(), c.columns[k]);
    const Index to = parameters_ + (found - state->columns.begin());
    along.force_coefficients.col(to) = c.d_force.col(from);
    along.motion_coefficients.col(to) = c.d_motion.col(from).head(body.node_motions);
    for (const auto& tool : body.driven)
      along.motion[tool.contact].col(to).head<3>() = c.d_motion(tool.motion_column, from) * tool.direction;
  }
  state->d = statics.sensitivity_along(state->at, along, before ? before->d : statics.rest_along(parameters));
  state->differentiated = true;
  return state;
}

/// The object under its weight alone; nullptr where no weight acts.
ForwardModel::ContactStatePtr ForwardModel::lying(std::size_t s, Body& body, const VectorX& unknowns, bool derivatives) {
  if (body.gravity_column < 0) return nullptr;
  if (body.lying && body.lying->unknowns == unknowns && (body.lying->differentiated || !derivatives)) return body.lying;
  const Coefficients loaded = coefficients(first_step_of_push(s), body, unknowns);
  Coefficients c;
  c.force = VectorX::Zero(loaded.force.size());
  c.force.segment<3>(body.gravity_column) = loaded.force.segment<3>(body.gravity_column);
  c.motion = VectorX::Zero(loaded.motion.size());
  c.d_force.resize(c.force.size(), 0);
  for (std::size_t k = 0; k < loaded.columns.size(); ++k) {
    const Vec3 d = loaded.d_force.block<3, 1>(body.gravity_column, static_cast<Index>(k));
    if (d.norm() == 0) continue;
    c.columns.push_back(loaded.columns[k]);
    c.d_force.conservativeResize(c.force.size(), static_cast<Index>(c.columns.size()));
    c.d_force.rightCols<1>().setZero();
    c.d_force.rightCols<1>().segment<3>(body.gravity_column) = d;
  }
  c.d_motion = MatrixX::Zero(c.motion.size(), static_cast<Index>(c.columns.size()));
  body.lying =
      solve_contact(body, c, unknowns, derivatives, path_ ? nullptr : body.lying, nullptr, body.lying, worker_of(s));
  return body.lying;
}

ForwardModel::ContactStatePtr ForwardModel::contact_state(std::size_t s, Body& body, const VectorX& unknowns,
                                                          bool derivatives) {
  ContactStatePtr& known = memory_[s].contact;
  if (known && known->unknowns == unknowns && (known->differentiated || !derivatives)) return known;
  ContactStatePtr before = lying(s, body, unknowns, derivatives && path_);
  if (path_ && steps_[s].step > 0) before = contact_state(s - 1, body, unknowns, derivatives);
  if (before && !before->at.converged) return before;
  const ContactStatePtr start = path_ ? before : known ? known : before;
  known = solve_contact(body, coefficients(s, body, unknowns), unknowns, derivatives, start, path_ ? before : nullptr, known,
                        worker_of(s));
  return known;
}

bool ForwardModel::solve_contact_step(std::size_t s, Body& body, const Coefficients& c, const VectorX& unknowns,
                                      bool derivatives, Watched& watched, StepPrediction& out) {
  const ContactStatePtr now = contact_state(s, body, unknowns, derivatives);
  // A shape that was seen as it lies has the weight's share in it already.
  const bool seen_lying = recording_->rest.state != RestState::stress_free;
  const ContactStatePtr rest = seen_lying ? lying(s, body, unknowns, derivatives) : nullptr;
  out.converged = now->at.converged && (!rest || rest->at.converged);
  out.reason = now->at.converged && rest ? rest->at.reason : now->at.reason;
  out.inverted_elements = now->at.inverted_elements;
  if (!out.converged) return false;

  const VectorX moved_m = rest ? VectorX(now->at.displacement_m - rest->at.displacement_m) : now->at.displacement_m;
  Memory& memory = memory_[s];
  memory.valid = true;
  memory.unknowns = unknowns;
  memory.displacement_m = moved_m;
  memory.inverted_elements = out.inverted_elements;
  memory.columns.clear();
  memory.derivative.resize(moved_m.size(), 0);
  watched.moved_m = object_.surface.restrict(moved_m);
  if (!derivatives) return true;

  const auto derivative = [&](const ContactState& state, const MatrixX& d) {
    return in_order(d, parameters_, state.columns, c.columns);
  };
  MatrixX field = derivative(*now, now->d.displacement);
  if (rest) field -= derivative(*rest, rest->d.displacement);
  watched.d_moved = object_.surface.restrict(field);
  watched.conjugate_m = body.forces.transpose() * moved_m;
  watched.d_conjugate = body.forces.transpose() * field;
  watched.reaction_n.resize(c.motion.size());
  watched.d_reaction.resize(c.motion.size(), field.cols());
  watched.reaction_n.head(body.node_motions) = now->at.motion_reaction;
  watched.d_reaction.topRows(body.node_motions) = derivative(*now, now->d.motion_reaction);
  for (const auto& tool : body.driven) {
    watched.reaction_n(tool.motion_column) = tool.direction.dot(now->at.touches[tool.contact].wrench.head<3>());
    watched.d_reaction.row(tool.motion_column) =
        tool.direction.transpose() * derivative(*now, now->d.wrench[tool.contact]).topRows<3>();
  }
  memory.columns = parameter_columns();
  memory.columns.insert(memory.columns.end(), c.columns.begin(), c.columns.end());
  memory.derivative = std::move(field);
  memory.watched = watched;
  return true;
}

}  // namespace palpate::estimation
