// SPDX-License-Identifier: Apache-2.0
// Steps of an object that touches tables, walls and rigid tools: contact is solved for, and where there is friction every
// step starts from the one before.
#include <algorithm>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/load_columns.hpp"

namespace palpate::estimation {

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

/// Columns of `from` in the order of `wanted`; zero where it has none of an unknown.
MatrixX in_order(const MatrixX& from, const std::vector<int>& columns, const std::vector<int>& wanted) {
  MatrixX out = MatrixX::Zero(from.rows(), static_cast<Index>(wanted.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const auto at = std::find(wanted.begin(), wanted.end(), columns[k]);
    if (at != wanted.end()) out.col(at - wanted.begin()) = from.col(static_cast<Index>(k));
  }
  return out;
}

/// True where some push says that it does not exactly know where this tool, whose motion is imposed, touches.
bool stands_uncertainly(const Recording& recording, const Tool& tool) {
  if (tool.shape == ToolShape::platen) return false;
  for (const auto& push : recording.pushes)
    for (const auto& step : push.steps)
      for (const auto& load : step.loads)
        if (load.tool == tool.name && load.travel_m && load.contact_std_m > 0) return true;
  return false;
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

void ForwardModel::add_contacts(Body& body, const Push& push, std::vector<fem::RigidContact> supports,
                                fem::Response::Options& options) {
  options.contacts = std::move(supports);
  for_each_driven(*recording_, push, [&](const Tool& tool, const Load& load) {
    const auto next_column = [&] { return body.node_motions + static_cast<int>(options.driven.size()); };
    body.motion_column[tool.name] = next_column();
    options.driven.push_back({options.contacts.size(), push_direction(tool, load)});
    if (stands_uncertainly(*recording_, tool)) {
      body.standing[tool.name] = {next_column(), load.direction};
      for (const Vec3& tangent : tangents(load.direction))
        options.driven.push_back({options.contacts.size(), way_along_surface(object_.mesh, tool, load, tangent)});
    }
    options.contacts.push_back(rigid_tool(object_.mesh, tool, load));
  });
  options.friction_tolerance = std::min(fem::ContactOptions().friction_tolerance, 100 * options_.residual_tolerance);
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

ForwardModel::SolvedAtPtr ForwardModel::solve_contact(Body& body, const Coefficients& c, const VectorX& unknowns, bool derivatives,
                                                      const SolvedAtPtr& start, const SolvedAtPtr& before, const SolvedAtPtr& known,
                                                      std::size_t worker) {
  auto now = std::make_shared<SolvedAt>(SolvedAt{unknowns, {}, {}});
  fem::ResponseQuery q = query(c, unknowns, derivatives);
  if (derivatives) {  // those of the step before come first
    now->columns = before ? before->columns : parameter_columns();
    std::vector<int> own = parameter_columns();
    own.insert(own.end(), c.columns.begin(), c.columns.end());
    for (int column : own)
      if (std::find(now->columns.begin(), now->columns.end(), column) == now->columns.end()) now->columns.push_back(column);
    const std::vector<int> beside(now->columns.begin() + parameters_, now->columns.end());
    q.along = fem::LoadDirections{in_order(c.d_force, c.columns, beside), in_order(c.d_motion, c.columns, beside)};
  }
  fem::ResponseStart from;
  from.on_path = path_;
  if (start) from.from = start->state.solution;
  VectorX guess_m;
  if (path_ && known && known->state.converged) {
    from.nearby = known->state.solution;
    guess_m = known->displacement_at(unknowns);
    from.displacement_m = &guess_m;
  }
  now->state = body.response->solve(q, from);
  ++solves_[worker];
  return now;
}

/// The object under its weight alone; nullptr where no weight acts.
ForwardModel::SolvedAtPtr ForwardModel::lying(std::size_t s, Body& body, const VectorX& unknowns, bool derivatives) {
  if (body.gravity_column < 0) return nullptr;
  const std::size_t in_push = steps_[s].push;
  const bool of_this_push = body.standing.empty() || body.lying_in == in_push;
  if (body.lying && of_this_push && body.lying->unknowns == unknowns && (body.lying->differentiated() || !derivatives)) return body.lying;
  body.lying_in = in_push;
  const Coefficients loaded = coefficients(first_step_of_push(s), body, unknowns);
  Coefficients c;
  c.force = VectorX::Zero(loaded.force.size());
  c.force.segment<3>(body.gravity_column) = loaded.force.segment<3>(body.gravity_column);
  c.motion = VectorX::Zero(loaded.motion.size());
  c.d_force.resize(c.force.size(), 0);
  c.d_motion.resize(c.motion.size(), 0);
  for (const auto& [tool, stands] : body.standing) c.motion.segment<2>(stands.column) = loaded.motion.segment<2>(stands.column);
  for (std::size_t k = 0; k < loaded.columns.size(); ++k) {
    const Index column = static_cast<Index>(k);
    const Vec3 d = loaded.d_force.block<3, 1>(body.gravity_column, column);
    VectorX standing = VectorX::Zero(c.motion.size());
    for (const auto& [tool, stands] : body.standing)
      standing.segment<2>(stands.column) = loaded.d_motion.block<2, 1>(stands.column, column);
    if (d.norm() == 0 && standing.isZero(0)) continue;
    c.columns.push_back(loaded.columns[k]);
    c.d_force.conservativeResize(c.force.size(), static_cast<Index>(c.columns.size()));
    c.d_motion.conservativeResize(c.motion.size(), static_cast<Index>(c.columns.size()));
    c.d_force.rightCols<1>().setZero();
    c.d_force.rightCols<1>().segment<3>(body.gravity_column) = d;
    c.d_motion.rightCols<1>() = standing;
  }
  body.lying =
      solve_contact(body, c, unknowns, derivatives, path_ ? nullptr : body.lying, nullptr, body.lying, worker_of(s));
  return body.lying;
}

ForwardModel::SolvedAtPtr ForwardModel::contact_state(std::size_t s, Body& body, const VectorX& unknowns, bool derivatives) {
  SolvedAtPtr& known = memory_[s].contact;
  if (known && known->unknowns == unknowns && (known->differentiated() || !derivatives)) return known;
  SolvedAtPtr before = lying(s, body, unknowns, derivatives && path_);
  if (path_ && steps_[s].step > 0) before = contact_state(s - 1, body, unknowns, derivatives);
  if (before && !before->state.converged) return before;
  const SolvedAtPtr start = path_ ? before : known ? known : before;
  known = solve_contact(body, coefficients(s, body, unknowns), unknowns, derivatives, start, path_ ? before : nullptr, known,
                        worker_of(s));
  return known;
}

bool ForwardModel::solve_contact_step(std::size_t s, Body& body, const Coefficients& c, const VectorX& unknowns,
                                      bool derivatives, fem::ResponseState& seen) {
  const SolvedAtPtr now = contact_state(s, body, unknowns, derivatives);
  // A shape that was seen as it lies has the weight's share in it already.
  const bool seen_lying = recording_->rest.state != RestState::stress_free;
  const SolvedAtPtr rest = seen_lying ? lying(s, body, unknowns, derivatives) : nullptr;
  seen = now->state;
  if (!now->state.converged) return false;
  if (rest && !rest->state.converged) {
    seen.converged = false;
    seen.reason = rest->state.reason;
    return false;
  }

  auto solution = std::make_shared<fem::ResponseSolution>();
  solution->displacement_m = now->state.solution->displacement_m;
  if (rest) {
    solution->displacement_m -= rest->state.solution->displacement_m;
    seen.watched_m -= rest->state.watched_m;
    seen.conjugate_m -= rest->state.conjugate_m;
  }
  solution->derivative.resize(solution->displacement_m.size(), 0);
  std::vector<int> columns;
  if (derivatives) {
    columns = parameter_columns();
    columns.insert(columns.end(), c.columns.begin(), c.columns.end());
    const auto less_rest = [&](const MatrixX& of_now, const MatrixX* of_rest) {
      MatrixX d = in_order(of_now, now->columns, columns);
      if (of_rest) d -= in_order(*of_rest, rest->columns, columns);
      return d;
    };
    solution->derivative = less_rest(now->state.solution->derivative, rest ? &rest->state.solution->derivative : nullptr);
    seen.d_watched = less_rest(now->state.d_watched, rest ? &rest->state.d_watched : nullptr);
    seen.d_conjugate = less_rest(now->state.d_conjugate, rest ? &rest->state.d_conjugate : nullptr);
    seen.d_reaction = in_order(now->state.d_reaction, now->columns, columns);
    seen.d_driven_force = in_order(now->state.d_driven_force, now->columns, columns);
  }
  seen.solution = std::move(solution);
  memory_[s].seen = std::make_shared<SolvedAt>(SolvedAt{unknowns, std::move(columns), seen});
  return true;
}

}  // namespace palpate::estimation
