// SPDX-License-Identifier: Apache-2.0
// Where a known force acts on the object, as a wrist sensor feels it: the resultant's lever about the tip.
#include <algorithm>

#include "palpate/estimation/forward_model_parts.hpp"

namespace palpate::estimation {
namespace {

bool same_contact(const Load& a, const Load& b) {
  return a.tool == b.tool && a.contact_m == b.contact_m && b.force_n && b.force_n->norm() > 0;
}

/// Where the tip met the object: what the recording says of it under the push's first load, before anything was dragged along;
/// without that the contact point.
Vec3 tip_at_contact_m(const Push& push, const Load& load) {
  for (const Step& step : push.steps) {
    const bool touches = std::any_of(step.loads.begin(), step.loads.end(), [&](const Load& one) { return same_contact(load, one); });
    if (touches && step.T_base_tip) return step.T_base_tip->translation();
  }
  return load.contact_m;
}

/// Sum of the columns' nodal shares times the nodes' places: the middle of a patch, or what moves it.
Vec3 middle_m(const Eigen::SparseMatrix<double>& forces, int first, const Points& nodes_m) {
  Vec3 sum = Vec3::Zero();
  for (Eigen::SparseMatrix<double>::InnerIterator it(forces, first); it; ++it) {
    if (it.row() % 3 == 0) sum += it.value() * nodes_m.row(it.row() / 3).transpose();
  }
  return sum;
}

}  // namespace

std::optional<ActingForce> ForwardModel::acting_force(std::size_t s, std::size_t l, const VectorX& unknowns) const {
  const Load& load = step(s).loads[l];
  if (load.travel_m || !has_place(*recording_, load)) return std::nullopt;
  const Body& body = body_of(s);
  const std::vector<LoadPart> parts = load_parts(s, l, body, unknowns);
  if (parts.empty()) return std::nullopt;

  ActingForce out;
  TrueForce force = true_force(s, l, unknowns);
  out.force_n = force.force_n;
  const Vec3 along = load.direction.normalized();
  const auto across = [&](const Vec3& x) { return Vec3(x - along.dot(x) * along); };
  // The tool is where the arm has it; a clamp has moved the object, and the patch on it, under the tool. A support that gives way
  // takes the tool along.
  const RigidOffset clamp = clamp_pose(s, unknowns);
  const Mat3 rotation = clamp.rotation();
  Vec3 place_m = Vec3::Zero();  // in the object's frame
  std::vector<std::pair<int, Vec3>> moves;
  for (const LoadPart& part : parts) {
    const Vec3 middle = middle_m(body.forces, part.first, object_.mesh.nodes_m);
    place_m += part.weight * middle;
    if (part.unknown < 0) continue;
    const Vec3 way = part.per_unknown * across(rotation * middle);
    const auto own = std::find_if(moves.begin(), moves.end(), [&](const auto& one) { return one.first == part.unknown; });
    own == moves.end() ? void(moves.emplace_back(part.unknown, way)) : void(own->second += way);
  }
  const auto by_clamp = clamp.derivative(place_m);
  for (int k = 0; clamp_[s] >= 0 && k < 6; ++k) moves.emplace_back(clamp_[s] + k, across(by_clamp.col(k)));
  out.lever_m = across(clamp.apply(place_m) - tip_at_contact_m(push(s), load));

  const Index forces = static_cast<Index>(force.derivatives.size()), count = forces + static_cast<Index>(moves.size());
  out.d_force.setZero(3, count);
  out.d_lever.setZero(3, count);
  for (Index k = 0; k < count; ++k) {
    const auto& [unknown, d] = k < forces ? force.derivatives[static_cast<std::size_t>(k)] : moves[static_cast<std::size_t>(k - forces)];
    out.unknowns.push_back(unknown);
    (k < forces ? out.d_force : out.d_lever).col(k) = d;
  }
  return out;
}

}  // namespace palpate::estimation
