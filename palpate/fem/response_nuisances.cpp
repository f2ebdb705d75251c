// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/response_nuisances.hpp"

#include <Eigen/LU>
#include <cmath>

#include "palpate/core/error.hpp"

namespace palpate::fem {

ContactCoefficients contact_coefficients(const ContactColumns& columns, const ContactNuisances& n) {
  const Vec3 along = columns.tangent_1.cross(columns.tangent_2);
  Eigen::Matrix<double, 3, 2> tangents;
  tangents << columns.tangent_1, columns.tangent_2;
  // The direction turned by |tilt| in the plane of `along` and the tilt.
  const double angle = n.tilt_rad.norm();
  const double sinc = angle > 1e-6 ? std::sin(angle) / angle : 1 - angle * angle / 6;
  const double sinc_slope = angle > 1e-3 ? (std::cos(angle) - sinc) / (angle * angle) : -1.0 / 3 + angle * angle / 30;
  const Vec3 turned = std::cos(angle) * along + sinc * (tangents * n.tilt_rad);
  ContactCoefficients out;
  out.values << n.force_n * turned, n.force_n * n.shift_m, n.force_n * n.log_radius_change;
  out.derivatives.setZero();
  out.derivatives.col(0) << turned, n.shift_m, n.log_radius_change;
  out.derivatives.block<3, 2>(0, 1) =
      n.force_n * (sinc * tangents + (sinc_slope * (tangents * n.tilt_rad) - sinc * along) * n.tilt_rad.transpose());
  for (int k = 3; k < 6; ++k) out.derivatives(k, k) = n.force_n;
  return out;
}

Eigen::SparseMatrix<double> support_motions(const TetMesh& mesh, const std::vector<Index>& nodes, const Vec3& centre_m) {
  std::vector<Eigen::Triplet<double>> entries;
  for (Index i : nodes) {
    const Vec3 arm = mesh.nodes_m.row(i).transpose() - centre_m;
    for (int k = 0; k < 3; ++k) {
      entries.emplace_back(3 * i + k, k, 1.0);
      const Vec3 turn = Vec3::Unit(k).cross(arm);
      for (int c = 0; c < 3; ++c)
        if (turn(c) != 0) entries.emplace_back(3 * i + c, 3 + k, turn(c));
    }
  }
  Eigen::SparseMatrix<double> columns(3 * mesh.nodes_m.rows(), 6);
  columns.setFromTriplets(entries.begin(), entries.end());
  return columns;
}

SprungState on_springs(const Response& response, double young_modulus_pa, double poisson_ratio, const VectorX& force,
                       const VectorX& motion, const VectorX& stiffness) {
  if (stiffness.size() != motion.size()) throw Error("needs one value for each motion", "on_springs stiffness");
  if (stiffness.size() > 0 && !(stiffness.minCoeff() > 0)) throw Error("must be positive", "on_springs stiffness");
  const MatrixX springs = stiffness.asDiagonal();
  SprungState out;
  out.support_motion = motion;
  constexpr int kSteps = 30;
  Eigen::PartialPivLU<Eigen::MatrixXd> factor;
  for (int step = 0;; ++step) {
    out.state = response.at(young_modulus_pa, poisson_ratio, force, out.support_motion);
    if (!out.state.converged) return out;
    const VectorX pull = stiffness.cwiseProduct(out.support_motion - motion);
    const VectorX unbalanced = out.state.reaction_n + pull;
    factor.compute(out.state.reaction_d_motion + springs);
    // Units differ between translations and rotations: the work of what is left over, against that of the springs and loads.
    const VectorX correction = factor.solve(unbalanced);
    const double scale = std::abs(pull.dot(out.support_motion)) + std::abs(out.state.reaction_n.dot(out.support_motion));
    if (std::abs(unbalanced.dot(correction)) <= 1e-20 * scale || unbalanced.isZero(0)) break;
    if (step == kSteps) {
      out.state.converged = false;
      out.state.reason = "the motion of the sprung supports did not settle in " + std::to_string(kSteps) + " steps";
      return out;
    }
    out.support_motion -= correction;
  }
  ResponseState& s = out.state;
  // Supports follow: (reaction_d_motion + K) dc = -reaction_d_x, and the reaction is what the springs carry.
  const auto follow = [&](const MatrixX& reaction_change) { return MatrixX(-factor.solve(reaction_change)); };
  const MatrixX by_young = follow(s.reaction_d_log_young), by_poisson = follow(s.reaction_d_poisson),
                by_force = follow(s.reaction_d_force), by_motion = -follow(springs);
  const MatrixX by_stiffness = follow(MatrixX(stiffness.cwiseProduct(out.support_motion - motion).asDiagonal()));
  s.d_log_young += s.d_motion * by_young;
  s.d_poisson += s.d_motion * by_poisson;
  s.d_force += s.d_motion * by_force;
  out.d_log_stiffness = s.d_motion * by_stiffness;
  s.d_motion = (s.d_motion * by_motion).eval();
  const MatrixX carried = s.reaction_d_motion;
  s.reaction_d_log_young += carried * by_young;
  s.reaction_d_poisson += carried * by_poisson;
  s.reaction_d_force += carried * by_force;
  s.reaction_d_motion = carried * by_motion;
  out.reaction_d_log_stiffness = carried * by_stiffness;
  return out;
}

}  // namespace palpate::fem
