// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/response.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/loading_branch.hpp"

namespace palpate::fem {
namespace {

double relative(double difference, double size) { return size > 0 ? difference / size : 0; }

}  // namespace

struct Response::Impl {
  Impl(const TetMesh& mesh, const std::string& material, Boundary boundary, Eigen::SparseMatrix<double> rows, Options given)
      : options(std::move(given)), statics(mesh, material, std::move(boundary), options.statics), watched(std::move(rows)) {
    if (watched.cols() != 3 * mesh.nodes_m.rows())
      throw Error("needs " + std::to_string(3 * mesh.nodes_m.rows()) + " columns", "Response watched");
    const VectorX& load = options.branch_force_over_young;
    if (load.size() > 0 && load.size() != statics.boundary().forces.cols())
      throw Error(
          "needs " + std::to_string(statics.boundary().forces.cols()) + " values, has " + std::to_string(load.size()),
          "Response::Options::branch_force_over_young");
    if (statics.is_linear()) {
      LinearResponse::Options linear_options;
      linear_options.poisson_lower = options.poisson_lower;
      linear_options.poisson_upper = options.poisson_upper;
      linear = std::make_unique<LinearResponse>(statics, watched, linear_options);
    } else if (load.size() > 0 && load.norm() > 0 && statics.boundary().motions.cols() == 0) {
      LoadingBranch::Options branch_options;
      branch_options.poisson_lower = options.poisson_lower;
      branch_options.poisson_upper = options.poisson_upper;
      branch_options.tolerance = options.tolerance;
      branch_options.max_solves = options.max_solves;
      branch = std::make_unique<LoadingBranch>(statics, watched, load, branch_options);
      solves += branch->solves();
    }
  }

  ResponseState superposed(double young, double nu, const VectorX& a, const VectorX& b) const {
    const auto unit = linear->at(nu);
    ResponseState out;
    out.converged = true;
    out.source = ResponseSource::superposed;
    const VectorX loaded = unit->force * (a / young);
    out.watched_m = loaded + unit->motion * b;
    out.d_log_young = -loaded;
    out.d_poisson = unit->force_d_poisson * (a / young) + unit->motion_d_poisson * b;
    out.d_force = unit->force / young;
    out.d_motion = unit->motion;
    const VectorX imposed = young * (unit->reaction_motion * b);
    out.reaction_n = unit->reaction_force * a + imposed;
    out.reaction_d_log_young = imposed;
    out.reaction_d_poisson = unit->reaction_force_d_poisson * a + young * (unit->reaction_motion_d_poisson * b);
    out.reaction_d_force = unit->reaction_force;
    out.reaction_d_motion = young * unit->reaction_motion;
    out.inverted_elements = -1;
    out.error = unit->residual + options.discretisation_error;
    return out;
  }

  ResponseState on_branch(double young, double nu, const VectorX& a) const {
    const LoadingBranch::Point p = branch->at(nu, a / young);
    ResponseState out;
    out.converged = true;
    out.source = ResponseSource::branch;
    out.watched_m = p.watched_m;
    out.d_poisson = p.d_poisson;
    out.d_force = p.d_force_over_young / young;
    out.d_log_young = -p.d_force_over_young * (a / young);
    out.d_motion.resize(watched.rows(), 0);
    out.reaction_d_force.resize(0, a.size());
    out.reaction_d_motion.resize(0, 0);
    out.error = branch->error() + p.across + options.discretisation_error;
    return out;
  }

  ResponseState solved(double young, double nu, const VectorX& a, const VectorX& b) {
    ResponseState out;
    const Equilibrium e = statics.solve(young, nu, a, b);
    ++solves;
    out.converged = e.converged;
    out.reason = e.reason;
    out.inverted_elements = e.inverted_elements;
    if (!e.converged) return out;
    const Sensitivity s = statics.sensitivity(e);
    out.watched_m = watched * e.displacement_m;
    out.reaction_n = e.motion_reaction;
    out.d_log_young = watched * s.d_log_young;
    out.d_poisson = watched * s.d_poisson;
    out.d_force = watched * s.d_force;
    out.d_motion = watched * s.d_motion;
    out.reaction_d_log_young = s.reaction_d_log_young;
    out.reaction_d_poisson = s.reaction_d_poisson;
    out.reaction_d_force = s.reaction_d_force;
    out.reaction_d_motion = s.reaction_d_motion;
    out.error = options.discretisation_error;
    return out;
  }

  Options options;
  Statics statics;
  Eigen::SparseMatrix<double> watched;
  std::unique_ptr<LinearResponse> linear;
  std::unique_ptr<LoadingBranch> branch;
  int solves = 0;
};

Response::Response(const TetMesh& mesh, const std::string& material, Boundary boundary, Eigen::SparseMatrix<double> watched,
                   Options options)
    : impl_(std::make_unique<Impl>(mesh, material, std::move(boundary), std::move(watched), std::move(options))) {}
Response::~Response() = default;
Response::Response(Response&&) noexcept = default;
Response& Response::operator=(Response&&) noexcept = default;

ResponseState Response::at(double young_modulus_pa, double poisson_ratio, const VectorX& force,
                           const VectorX& motion) const {
  const Boundary& boundary = impl_->statics.boundary();
  if (force.size() != boundary.forces.cols() || motion.size() != boundary.motions.cols())
    throw Error("needs one value for each of the boundary's forces and motions", "Response::at");
  if (impl_->linear) return impl_->superposed(young_modulus_pa, poisson_ratio, force, motion);
  if (impl_->branch && impl_->branch->covers(poisson_ratio, force / young_modulus_pa))
    return impl_->on_branch(young_modulus_pa, poisson_ratio, force);
  return impl_->solved(young_modulus_pa, poisson_ratio, force, motion);
}

Certificate Response::certify(const ResponseState& state, double young_modulus_pa, double poisson_ratio,
                              const VectorX& force, const VectorX& motion) const {
  const Statics& statics = impl_->statics;
  Certificate out;
  const Equilibrium from_rest = statics.solve(young_modulus_pa, poisson_ratio, force, motion);
  ++impl_->solves;
  out.converged = from_rest.converged;
  out.reason = from_rest.reason;
  out.inverted_elements = from_rest.inverted_elements;
  if (!out.converged || state.watched_m.size() == 0) return out;
  const VectorX full = impl_->watched * from_rest.displacement_m;
  out.difference = relative((full - state.watched_m).cwiseAbs().maxCoeff(), full.cwiseAbs().maxCoeff());
  out.stable = statics.is_stable(from_rest);
  if (statics.is_linear()) return out;
  if (!out.stable && !statics.other_equilibria(from_rest).empty()) {
    out.second_equilibrium = true;
    return out;
  }
  const Equilibrium stepped = statics.solve_stepwise(young_modulus_pa, poisson_ratio, force, motion);
  ++impl_->solves;
  // Two converged answers differ by rounding, or they are two states.
  out.second_equilibrium = stepped.converged && (stepped.displacement_m - from_rest.displacement_m).cwiseAbs().maxCoeff() >
                                                    1e-3 * from_rest.displacement_m.cwiseAbs().maxCoeff();
  return out;
}

double Response::branch_end() const { return impl_->branch ? impl_->branch->end() : 0; }
double Response::branch_error() const { return impl_->branch ? impl_->branch->error() : 0; }
int Response::solves() const { return impl_->solves + (impl_->linear ? impl_->linear->factorisations() : 0); }
const Statics& Response::statics() const { return impl_->statics; }

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

}  // namespace palpate::fem
