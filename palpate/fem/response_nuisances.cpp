// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/response_nuisances.hpp"

#include <Eigen/LU>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"

namespace palpate::fem {

ContactColumns contact_columns(const TetMesh& mesh, const Vec3& centre_m, double radius_m, const Vec3& direction) {
  if (!(direction.norm() > 0)) throw Error("must not be zero", "contact_columns direction");
  const Vec3 along = direction.normalized();
  ContactColumns out;
  out.tangent_1 = along.unitOrthogonal();
  out.tangent_2 = along.cross(out.tangent_1);
  const auto load = [&](const Vec3& centre, double radius) {
    const Eigen::SparseMatrix<double> one = along.sparseView();
    return Eigen::SparseMatrix<double>(spread_over_patch(mesh, centre, radius) * one);
  };
  // Differences over a tenth of the radius: shorter ones see the sub-sampling of the patch, longer ones its curvature.
  const double h = 0.1 * radius_m, ratio = 0.1;
  const Eigen::SparseMatrix<double> parts[4] = {
      spread_over_patch(mesh, centre_m, radius_m),
      (load(centre_m + h * out.tangent_1, radius_m) - load(centre_m - h * out.tangent_1, radius_m)) / (2 * h),
      (load(centre_m + h * out.tangent_2, radius_m) - load(centre_m - h * out.tangent_2, radius_m)) / (2 * h),
      (load(centre_m, radius_m * std::exp(ratio)) - load(centre_m, radius_m * std::exp(-ratio))) / (2 * ratio)};
  std::vector<Eigen::Triplet<double>> entries;
  int column = 0;
  for (const auto& part : parts) {
    for (int c = 0; c < part.outerSize(); ++c)
      for (Eigen::SparseMatrix<double>::InnerIterator it(part, c); it; ++it)
        entries.emplace_back(static_cast<int>(it.row()), column + c, it.value());
    column += static_cast<int>(part.cols());
  }
  out.forces.resize(parts[0].rows(), column);
  out.forces.setFromTriplets(entries.begin(), entries.end());
  return out;
}

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

SprungState on_springs(const Response& response, ResponseQuery query, const VectorX& stiffness) {
  const VectorX far_m = query.motion;
  if (stiffness.size() != far_m.size()) throw Error("needs one value for each motion", "on_springs stiffness");
  if (stiffness.size() > 0 && !(stiffness.minCoeff() > 0)) throw Error("must be positive", "on_springs stiffness");
  if (query.along || !query.derivatives) throw Error("needs derivatives to every coefficient", "on_springs query");
  const MatrixX springs = stiffness.asDiagonal();
  SprungState out;
  constexpr int kSteps = 30;
  Eigen::PartialPivLU<Eigen::MatrixXd> factor;
  for (int step = 0;; ++step) {
    out.state = response.at(query);
    if (!out.state.converged) return out;
    const VectorX pull = stiffness.cwiseProduct(query.motion - far_m);
    const VectorX unbalanced = out.state.reaction_n + pull;
    factor.compute(out.state.reaction_d_motion() + springs);
    // Units differ between translations and rotations: the work of what is left over, against that of the springs and loads.
    const VectorX correction = factor.solve(unbalanced);
    const double scale = std::abs(pull.dot(query.motion)) + std::abs(out.state.reaction_n.dot(query.motion));
    if (std::abs(unbalanced.dot(correction)) <= 1e-20 * scale || unbalanced.isZero(0)) break;
    if (step == kSteps) {
      out.state.converged = false;
      out.state.reason = "the motion of the sprung supports did not settle in " + std::to_string(kSteps) + " steps";
      return out;
    }
    query.motion -= correction;
  }
  out.support_motion = query.motion;
  ResponseState& s = out.state;
  // Supports follow: (reaction_d_motion + K) dc = -reaction_d_x, and the reaction is what the springs carry.
  const MatrixX by_motion = s.d_motion(), carried = s.reaction_d_motion();
  const MatrixX by_stiffness = -factor.solve(MatrixX(stiffness.cwiseProduct(out.support_motion - far_m).asDiagonal()));
  const MatrixX by_far_ends = factor.solve(springs);
  const Index others = static_cast<Index>(s.d_watched.cols() - far_m.size());
  const MatrixX follow = -factor.solve(s.d_reaction.leftCols(others));
  const auto put = [&](MatrixX& derivatives, const MatrixX& by_supports) {
    derivatives.leftCols(others) += by_supports * follow;
    derivatives.rightCols(far_m.size()) = by_supports * by_far_ends;
  };
  const MatrixX conjugate_by_motion = s.d_conjugate.rightCols(far_m.size());
  put(s.d_watched, by_motion);
  put(s.d_conjugate, conjugate_by_motion);
  put(s.d_reaction, carried);
  out.d_log_stiffness = by_motion * by_stiffness;
  out.reaction_d_log_stiffness = carried * by_stiffness;
  return out;
}

}  // namespace palpate::fem
