// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/statics.hpp"

#include "palpate/core/error.hpp"
#include "palpate/fem/statics/static_system.hpp"

namespace palpate::fem {

struct Statics::Impl : StaticSystem {
  using StaticSystem::StaticSystem;
};

Statics::Statics(const TetMesh& mesh, const std::string& material, Boundary boundary, StaticsOptions options)
    : impl_(std::make_unique<Impl>(mesh, material, std::move(boundary), options)) {}
Statics::~Statics() = default;
Statics::Statics(Statics&&) noexcept = default;
Statics& Statics::operator=(Statics&&) noexcept = default;

void Statics::set_region_stiffness(const VectorX& stiffness) { impl_->set_region_stiffness(stiffness); }
void Statics::set_region_poisson(const VectorX& poisson) { impl_->set_region_poisson(poisson); }

Equilibrium Statics::solve(double young_modulus_pa, double poisson_ratio, const VectorX& force_coefficients,
                           const VectorX& motion_coefficients, const VectorX* start, const VectorX& extra) const {
  if (is_linear())
    return impl_->solve_linear(young_modulus_pa, poisson_ratio, force_coefficients, motion_coefficients).front();
  return impl_->solve(young_modulus_pa, poisson_ratio, force_coefficients, motion_coefficients, start, extra);
}

std::vector<Equilibrium> Statics::solve_many(double young_modulus_pa, double poisson_ratio,
                                             const MatrixX& force_coefficients, const MatrixX& motion_coefficients) const {
  if (!is_linear()) throw Error("solves many cases with one factor only for a linear material", "Statics::solve_many");
  if (force_coefficients.cols() != motion_coefficients.cols())
    throw Error("force and motion coefficients need the same number of columns (cases)", "Statics::solve_many");
  return impl_->solve_linear(young_modulus_pa, poisson_ratio, force_coefficients, motion_coefficients);
}

Equilibrium Statics::solve_stepwise(double young_modulus_pa, double poisson_ratio, const VectorX& force_coefficients,
                                    const VectorX& motion_coefficients, const VectorX& extra) const {
  return impl_->solve_stepwise(young_modulus_pa, poisson_ratio, force_coefficients, motion_coefficients, extra);
}

bool Statics::is_stable(const Equilibrium& at) const { return impl_->is_stable(at); }

std::vector<Equilibrium> Statics::other_equilibria(const Equilibrium& at) const { return impl_->other_equilibria(at); }

SensitivityAlong Statics::sensitivity_along(const Equilibrium& at, const MatrixX& force_directions,
                                            const MatrixX& motion_directions) const {
  return impl_->sensitivity(at, force_directions, motion_directions);
}

Sensitivity Statics::sensitivity(const Equilibrium& at) const {
  const Index k = static_cast<Index>(impl_->boundary.forces.cols()), m = static_cast<Index>(impl_->motions.cols());
  const MatrixX identity = MatrixX::Identity(k + m, k + m);
  SensitivityAlong along = impl_->sensitivity(at, identity.topRows(k), identity.bottomRows(m));
  Sensitivity out;
  out.d_log_young = std::move(along.d_log_young);
  out.d_poisson = std::move(along.d_poisson);
  out.d_extra = std::move(along.d_extra);
  out.d_log_stiffness = std::move(along.d_log_stiffness);
  out.d_region_poisson = std::move(along.d_region_poisson);
  out.d_force = along.d_along.leftCols(k);
  out.d_motion = along.d_along.rightCols(m);
  out.reaction_d_log_young = std::move(along.reaction_d_log_young);
  out.reaction_d_poisson = std::move(along.reaction_d_poisson);
  out.reaction_d_extra = std::move(along.reaction_d_extra);
  out.reaction_d_log_stiffness = std::move(along.reaction_d_log_stiffness);
  out.reaction_d_region_poisson = std::move(along.reaction_d_region_poisson);
  out.reaction_d_force = along.reaction_d_along.leftCols(k);
  out.reaction_d_motion = along.reaction_d_along.rightCols(m);
  return out;
}
UnitResponses Statics::unit_responses(double poisson_ratio, const Eigen::SparseMatrix<double>& watched) const {
  if (!is_linear()) throw Error("superposes loads only for a linear material", "Statics::unit_responses");
  return impl_->unit_responses(poisson_ratio, watched);
}

int Statics::inverted_elements(const VectorX& displacement_m) const { return impl_->inverted_elements(displacement_m); }

bool Statics::is_linear() const { return impl_->law.is_linear(); }
const TetMesh& Statics::mesh() const { return impl_->mesh; }
const Boundary& Statics::boundary() const { return impl_->boundary; }

}  // namespace palpate::fem
