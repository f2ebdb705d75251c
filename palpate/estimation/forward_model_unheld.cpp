// SPDX-License-Identifier: Apache-2.0
// Forces along motions that no support holds.
#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/forward_model_parts.hpp"

namespace palpate::estimation {

/// Where the supports leave the object free to slide nothing can have pushed it, so a measured force's part that way is an
/// error of the measurement, as far as its stated uncertainty explains it.
void ForwardModel::drop_what_nothing_holds(std::size_t s, const Body& body, const VectorX& unknowns, Coefficients& c) const {
  if (body.free_motions.cols() == 0 || c.force.size() == 0) return;
  const MatrixX work = body.free_motions.transpose() * body.forces;
  const Step& now = step(s);
  struct Acting {
    const Load* load;
    std::vector<LoadPart> parts;  // the first: the whole force where it was thought to act
  };
  std::vector<Acting> acting;
  for (std::size_t l = 0; l < now.loads.size(); ++l) {
    if (now.loads[l].travel_m) continue;
    const std::vector<LoadPart> parts = load_parts(s, l, body, unknowns);
    if (!parts.empty()) acting.push_back({&now.loads[l], parts});
  }
  // Forces one below the other; all of them together may balance, as those of two fingers do.
  const Index rows = 3 * static_cast<Index>(acting.size());
  MatrixX of_forces(work.rows(), rows), d_force(rows, c.d_force.cols());
  VectorX force(rows);
  for (Index l = 0; 3 * l < rows; ++l) {
    const int first = acting[static_cast<std::size_t>(l)].parts[0].first;
    of_forces.middleCols<3>(3 * l) = work.middleCols<3>(first);
    force.segment<3>(3 * l) = c.force.segment<3>(first);
    d_force.middleRows<3>(3 * l) = c.d_force.middleRows<3>(first);
  }
  VectorX left = of_forces * force;
  MatrixX d_left = of_forces * d_force;
  double size_n = force.norm();
  if (body.gravity_column >= 0) {
    const auto weight = work.middleCols<3>(body.gravity_column);
    left += weight * c.force.segment<3>(body.gravity_column);
    d_left += weight * c.d_force.middleRows<3>(body.gravity_column);
    size_n += (body.forces.middleCols(body.gravity_column, 3) * c.force.segment<3>(body.gravity_column)).lpNorm<1>();
  }
  if (rows > 0) {
    Eigen::CompleteOrthogonalDecomposition<MatrixX> least;
    least.setThreshold(1e-9);
    least.compute(of_forces);
    const VectorX dropped = least.solve(left);
    const MatrixX d_dropped = least.solve(d_left);
    const double tare_n = recording_->pushes[steps_[s].push].force_tare_std_n;
    for (Index l = 0; 3 * l < rows; ++l) {
      const auto& [load, parts] = acting[static_cast<std::size_t>(l)];
      const Vec3 sideways = dropped.segment<3>(3 * l);
      const double force_n = force.segment<3>(3 * l).norm(), of_force = std::hypot(load->force_relative_std, recording_->force_cross_talk_std);
      const double std_n = std::hypot(load->force_std_n, of_force * force_n, tare_n);
      if (sideways.norm() > 4 * std_n + 1e-6 * (size_n + 1e-12))
        throw Error(why_unheld(sideways.norm(), std_n), now.source.empty() ? "supports" : now.source);
      for (const LoadPart& part : parts) {
        c.force.segment<3>(part.first) -= part.weight * sideways;
        c.d_force.middleRows<3>(part.first) -= part.weight * d_dropped.middleRows<3>(3 * l);
        const auto own = std::find(c.columns.begin(), c.columns.end(), part.unknown);
        if (part.unknown >= 0 && own != c.columns.end())
          c.d_force.block<3, 1>(part.first, static_cast<Index>(own - c.columns.begin())) -= part.per_unknown * sideways;
      }
    }
    left -= of_forces * dropped;
  }
  // What is left is no load's: a weight on a slope.
  if (left.size() > 0 && left.cwiseAbs().maxCoeff() > 1e-6 * (size_n + 1e-12))
    throw Error(why_unheld(left.cwiseAbs().maxCoeff(), 0), now.source.empty() ? "supports" : now.source);
}

/// What is wrong and what to do about it, for a message.
std::string ForwardModel::why_unheld(double sideways_n, double std_n) const {
  const auto words = [](double newton) { return fmt::format("{:.2g} N", newton); };
  std::string cure;
  for (const Support& support : recording_->supports) {
    if (support.contact != ContactLaw::frictionless || !cure.empty()) continue;
    cure = support.kind == SupportKind::table || support.kind == SupportKind::wall
               ? "give '" + support.name + "' its friction (contact: friction, friction_coefficient), "
               : "make '" + support.name + "' a table or wall with friction, ";
  }
  return "the supports leave the object free to slide where a load acts on it: " + words(sideways_n) + " act that way" +
         (std_n > 0 ? ", which the force's uncertainty (" + words(std_n) + ") does not explain" : "") + "; " + cure +
         "add the support that holds it, state the uncertainty of the force (force_std_n, force_tare_std_n, force_cross_talk_std), or give the "
         "load's normal component alone";
}

}  // namespace palpate::estimation
