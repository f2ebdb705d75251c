// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/response_contact.hpp"

#include <algorithm>

#include "palpate/core/error.hpp"

namespace palpate::fem {
namespace {

ContactOptions contact_options(const Response::Options& given) {
  ContactOptions options;
  options.statics = given.statics;
  if (given.friction_tolerance > 0) options.friction_tolerance = given.friction_tolerance;
  return options;
}

/// Of one contact only the first motion moves it. Further ones say where it stands before the first step, and so in every one.
std::vector<char> standing(const std::vector<DrivenContact>& driven) {
  std::vector<char> out;
  for (std::size_t t = 0; t < driven.size(); ++t)
    out.push_back(std::any_of(driven.begin(), driven.begin() + static_cast<std::ptrdiff_t>(t),
                              [&](const DrivenContact& before) { return before.contact == driven[t].contact; }));
  return out;
}

}  // namespace

TouchingResponse::TouchingResponse(const TetMesh& mesh, const std::string& material, Boundary boundary,
                                   const Response::Options& options, Index parameters)
    : node_motions_(static_cast<Index>(boundary.motions.cols())),
      parameters_(parameters),
      driven_(options.driven),
      standing_(standing(options.driven)),
      statics_(mesh, material, std::move(boundary), options.contacts, contact_options(options)) {}

/// The body at rest before the first step, tools where they stand: a tool that only came there while it touched would drag the
/// surface along.
std::optional<ContactEquilibrium> TouchingResponse::before_touching(const VectorX& motion) const {
  if (std::none_of(standing_.begin(), standing_.end(), [](char one) { return one != 0; })) return std::nullopt;
  ContactEquilibrium rest;
  rest.loads = statics_.no_loads();
  rest.displacement_m = VectorX::Zero(3 * statics_.mesh().nodes_m.rows());
  rest.converged = true;
  for (const RigidContact& contact : statics_.contacts()) {
    if (contact.law == Touch::bonded)
      throw Error("glued from the start, it cannot be looked for elsewhere; give contact_std_m: 0", "contacts '" + contact.name + "'");
    rest.touches.emplace_back();
    rest.touches.back().T_base_tool = contact.T_base_tool;
  }
  for (std::size_t t = 0; t < driven_.size(); ++t) {
    if (standing_[t] == 0) continue;
    const Vec3 way_m = motion(node_motions_ + static_cast<Index>(t)) * driven_[t].direction;
    rest.loads.motion[driven_[t].contact].head<3>() += way_m;
    rest.touches[driven_[t].contact].T_base_tool.translation() += way_m;
  }
  rest.memory = std::make_shared<const std::vector<TouchMemory>>(rest.touches.size());
  return rest;
}

/// And its derivatives.
ContactPathSensitivity TouchingResponse::before_touching_along(const MatrixX& motion, Index count) const {
  ContactPathSensitivity rest = statics_.rest_along(count);
  for (std::size_t t = 0; t < driven_.size(); ++t) {
    if (standing_[t] == 0) continue;
    auto of_tool = rest.loads.motion[driven_[t].contact].rightCols(motion.cols()).topRows<3>();
    of_tool += driven_[t].direction * motion.row(node_motions_ + static_cast<Index>(t));
    rest.motion[driven_[t].contact].rightCols(motion.cols()).topRows<3>() = of_tool;
  }
  return rest;
}

ResponseState TouchingResponse::solve(const ResponseQuery& query, const LoadDirections& along, const ResponseStart& start) {
  ContactLoads loads = statics_.no_loads();
  loads.force_coefficients = query.force;
  loads.motion_coefficients = query.motion.head(node_motions_);
  for (std::size_t t = 0; t < driven_.size(); ++t)
    loads.motion[driven_[t].contact].head<3>() += query.motion(node_motions_ + static_cast<Index>(t)) * driven_[t].direction;
  if (query.stiffness.size() > 0) statics_.set_region_stiffness(query.stiffness);
  if (query.region_poisson.size() > 0) statics_.set_region_poisson(query.region_poisson);

  std::optional<ContactEquilibrium> guess;
  if (start.on_path && start.nearby && start.nearby->touching) {
    guess = *start.nearby->touching;
    if (start.displacement_m != nullptr) guess->displacement_m = *start.displacement_m;
  }
  const auto solved_from = [&](const ContactEquilibrium* from) {
    return std::make_shared<ContactEquilibrium>(statics_.solve(query.young_modulus_pa, query.poisson_ratio, loads, from, query.extra,
                                                               guess ? &*guess : nullptr));
  };
  const std::optional<ContactEquilibrium> rest = before_touching(query.motion);
  const ContactEquilibrium* at_rest = rest ? &*rest : nullptr;
  const bool goes_on = start.from && start.from->touching;
  auto at = solved_from(goes_on ? start.from->touching.get() : at_rest);
  // Without memory the way does not matter: a start that led nowhere is left.
  if (!at->converged && !start.on_path && goes_on) at = solved_from(at_rest);

  ResponseState out;
  out.converged = at->converged;
  out.reason = at->reason;
  out.inverted_elements = at->inverted_elements;
  out.parameters = parameters_;
  auto solution = std::make_shared<ResponseSolution>();
  solution->touching = at;
  solution->displacement_m = at->displacement_m;
  solution->derivative.resize(at->displacement_m.size(), 0);
  if (at->converged) {
    out.reaction_n.resize(query.motion.size());
    out.reaction_n.head(node_motions_) = at->motion_reaction;
    out.driven_force_n.resize(3 * static_cast<Index>(driven_.size()));
    for (std::size_t t = 0; t < driven_.size(); ++t) {
      const Vec3 force_n = at->touches[driven_[t].contact].wrench.head<3>();
      out.driven_force_n.segment<3>(3 * static_cast<Index>(t)) = force_n;
      out.reaction_n(node_motions_ + static_cast<Index>(t)) = driven_[t].direction.dot(force_n);
    }
  }
  if (at->converged && query.derivatives) {
    const Index count = parameters_ + static_cast<Index>(along.force.cols());
    ContactLoadsAlong moved = statics_.no_loads_along(count);
    moved.log_young(0) = moved.poisson(1) = 1;
    // The first region's stiffness is E itself.
    const Index regions = static_cast<Index>(moved.log_stiffness.rows());
    for (Index r = 1; r < regions; ++r) moved.log_stiffness(r, 1 + r) = 1;
    for (Index r = 1; r < moved.region_poisson.rows(); ++r) moved.region_poisson(r, regions + r) = 1;
    moved.force_coefficients.rightCols(along.force.cols()) = along.force;
    moved.motion_coefficients.rightCols(along.motion.cols()) = along.motion.topRows(node_motions_);
    for (std::size_t t = 0; t < driven_.size(); ++t)
      moved.motion[driven_[t].contact].rightCols(along.motion.cols()).topRows<3>() +=
          driven_[t].direction * along.motion.row(node_motions_ + static_cast<Index>(t));
    const bool carries_on = start.on_path && goes_on;
    if (carries_on && !start.from->touching_along)
      throw Error("was solved without derivatives, which those of this step continue", "ResponseStart::from");
    auto d = std::make_shared<ContactPathSensitivity>(
        statics_.sensitivity_along(*at, moved, carries_on ? *start.from->touching_along : before_touching_along(along.motion, count)));
    solution->derivative = d->displacement;
    out.d_reaction = reactions_along(*d);
    out.d_driven_force.resize(out.driven_force_n.size(), d->displacement.cols());
    for (std::size_t t = 0; t < driven_.size(); ++t)
      out.d_driven_force.middleRows<3>(3 * static_cast<Index>(t)) = d->wrench[driven_[t].contact].topRows<3>();
    solution->touching_along = std::move(d);
  }
  out.solution = std::move(solution);
  return out;
}

MatrixX TouchingResponse::reactions_along(const ContactPathSensitivity& d) const {
  MatrixX out(node_motions_ + static_cast<Index>(driven_.size()), d.displacement.cols());
  out.topRows(node_motions_) = d.motion_reaction;
  for (std::size_t t = 0; t < driven_.size(); ++t)
    out.row(node_motions_ + static_cast<Index>(t)) = driven_[t].direction.transpose() * d.wrench[driven_[t].contact].topRows<3>();
  return out;
}

}  // namespace palpate::fem
