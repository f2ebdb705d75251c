// SPDX-License-Identifier: Apache-2.0
// How the object moves as a whole: its clamp's pose is not exactly known, and what it stands on gives way under the loads.
#include <Eigen/QR>
#include <algorithm>

#include "palpate/core/error.hpp"
#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/held_patch.hpp"

namespace palpate::estimation {
void ForwardModel::prepare_yielding_support(Unknowns& unknowns) {
  const auto yields = [](const Support& one) { return one.compliance_m_per_n > 0 || one.compliance_std_m_per_n > 0; };
  const auto found = std::find_if(recording_->supports.begin(), recording_->supports.end(), yields);
  if (recording_->free || found == recording_->supports.end()) return;
  const Support& support = *found;
  if (recording_->supports.size() > 1)
    throw Error("gives way under the whole load, so it must be the only support; here are " + std::to_string(recording_->supports.size()) +
                    ". Say how far the others give way with it by leaving them out, or state no compliance_m_per_n",
                support.source.empty() ? "supports." + support.name : support.source);
  support_compliance_m_per_n_ = support.compliance_m_per_n;
  support_compliance_unknown_ =
      unknowns.add_block("support_compliance[" + support.name + "]", "m/N", support.compliance_std_m_per_n, {""});
  const HeldPatch patch(object_.mesh, support);
  const bool turns_about_clamp = std::any_of(clamp_.begin(), clamp_.end(), [](int first) { return first >= 0; });
  if (!turns_about_clamp) clamp_pivot_m_ = patch.middle_m;
  // Along an axis that a narrow support does not hold it against turning, it does not turn.
  const Eigen::CompleteOrthogonalDecomposition<Mat3> turning(patch.turning_m2);
  given_way_.assign(steps_.size(), RigidMotion::Zero());
  for (std::size_t s = 0; s < steps_.size(); ++s) {
    Vec3 force_n = Vec3::Zero(), torque_nm = Vec3::Zero();
    for (const Load& load : step(s).loads) {
      const Vec3 of_load_n = load.force_n ? *load.force_n : read_force_n(step(s), load);
      force_n += of_load_n;
      if (has_place(*recording_, load)) torque_nm += (load.contact_m + load.contact_found_m - patch.middle_m).cross(of_load_n);
    }
    const Vec3 turned = turning.solve(torque_nm);
    given_way_[s].tail<3>() = turned;
    given_way_[s].head<3>() = force_n + turned.cross(clamp_pivot_m_ - patch.middle_m);
  }
}

double ForwardModel::support_compliance(const VectorX& unknowns) const {
  return support_compliance_m_per_n_ + (support_compliance_unknown_ >= 0 ? unknowns(support_compliance_unknown_) : 0);
}

/// Along a load, of where it acts: per m/N of the support.
double ForwardModel::given_way_along(std::size_t s, const Load& load) const {
  if (given_way_.empty()) return 0;
  const Vec3 arm_m = has_place(*recording_, load) ? Vec3(load.contact_m + load.contact_found_m - clamp_pivot_m_) : Vec3(Vec3::Zero());
  return load.direction.normalized().dot(given_way_[s].head<3>() + given_way_[s].tail<3>().cross(arm_m));
}

RigidOffset ForwardModel::clamp_pose(std::size_t s, const VectorX& unknowns) const {
  RigidOffset offset;
  offset.pivot_m = clamp_pivot_m_;
  if (clamp_[s] >= 0) {
    offset.translation_m = unknowns.segment<3>(clamp_[s]);
    offset.rotation_rad = unknowns.segment<3>(clamp_[s] + 3);
  }
  return offset;
}

RigidOffset ForwardModel::clamp_offset(std::size_t s, const VectorX& unknowns) const {
  RigidOffset offset = clamp_pose(s, unknowns);
  if (!given_way_.empty()) {
    offset.translation_m += support_compliance(unknowns) * given_way_[s].head<3>();
    offset.rotation_rad += support_compliance(unknowns) * given_way_[s].tail<3>();
  }
  return offset;
}

std::vector<ForwardModel::WholeMotion> ForwardModel::whole_motions(std::size_t s) const {
  std::vector<WholeMotion> motions;
  for (int k = 0; clamp_[s] >= 0 && k < 6; ++k) motions.push_back({clamp_[s] + k, RigidMotion::Unit(k)});
  if (support_compliance_unknown_ >= 0) motions.push_back({support_compliance_unknown_, given_way_[s]});
  return motions;
}

}  // namespace palpate::estimation
