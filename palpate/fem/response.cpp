// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/response.hpp"

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/loading_branch.hpp"
#include "palpate/fem/response_contact.hpp"

namespace palpate::fem {
namespace {

double relative(double difference, double size) { return size > 0 ? difference / size : 0; }

/// Rows of `watched`, then those of the forces' own motions.
Eigen::SparseMatrix<double> over_conjugates(const Eigen::SparseMatrix<double>& watched, const Eigen::SparseMatrix<double>& forces) {
  Eigen::SparseMatrix<double, Eigen::RowMajor> all = watched;
  const Index rows = static_cast<Index>(watched.rows());
  all.conservativeResize(rows + forces.cols(), watched.cols());
  all.bottomRows(forces.cols()) = Eigen::SparseMatrix<double, Eigen::RowMajor>(forces.transpose());
  return all;
}

}  // namespace

struct Response::Impl {
  Impl(const TetMesh& mesh, const std::string& material, Boundary boundary, Eigen::SparseMatrix<double> rows, Options given)
      : options(std::move(given)), watched(rows), forces(boundary.forces) {
    const Index dofs = 3 * static_cast<Index>(mesh.nodes_m.rows());
    if (rows.cols() != dofs) throw Error("needs " + std::to_string(dofs) + " columns", "Response watched");
    if (forces.rows() == 0) forces.resize(dofs, 0);
    motions = static_cast<Index>(boundary.motions.cols() + static_cast<Eigen::Index>(options.driven.size()));
    Index further = 0;
    for (int region : options.statics.region) further = std::max<Index>(further, region);
    parameters += further;
    if (options.statics.region_poisson.size() > 0) {
      const VectorX& own = options.statics.region_poisson;
      if (own.size() != 1 + further || !std::isnan(own(0)) || own.tail(further).array().isNaN().any())
        throw Error("needs NaN for the first region, whose nu is the one asked for, and a number for every further one", "Response::Options::statics.region_poisson");
      parameters += further;
    }
    const VectorX& load = options.branch_force_over_young;
    if (load.size() > 0 && load.size() != forces.cols())
      throw Error("needs " + std::to_string(forces.cols()) + " values, has " + std::to_string(load.size()),
                  "Response::Options::branch_force_over_young");
    if (!options.contacts.empty()) {
      touching.emplace(mesh, material, std::move(boundary), options, parameters);
      return;
    }
    statics.emplace(mesh, material, std::move(boundary), options.statics);
    if (parameters > 2) return;  // unit responses are for one set of regions' stiffness
    if (statics->is_linear()) {
      LinearResponse::Options linear_options;
      linear_options.poisson_lower = options.poisson_lower;
      linear_options.poisson_upper = options.poisson_upper;
      linear_options.tolerance = options.superposed_tolerance;
      linear_options.field_limit_bytes = 6e7;
      linear = std::make_unique<LinearResponse>(*statics, over_conjugates(rows, forces), linear_options);
    } else if (load.size() > 0 && load.norm() > 0 && motions == 0) {
      LoadingBranch::Options branch_options;
      branch_options.poisson_lower = options.poisson_lower;
      branch_options.poisson_upper = options.poisson_upper;
      branch_options.tolerance = options.branch_tolerance;
      branch_options.max_solves = options.max_solves;
      branch_rows = over_conjugates(rows, forces);
      branch = std::make_unique<LoadingBranch>(*statics, branch_rows, load, branch_options);
      solves += branch->solves();
    }
  }

  /// @throws Error unless the query fits
  void check(const ResponseQuery& q) const {
    if (q.force.size() != forces.cols() || q.motion.size() != motions)
      throw Error("needs one value for each of the boundary's forces and motions", "ResponseQuery");
    if (q.along && (q.along->force.rows() != forces.cols() || q.along->motion.rows() != motions ||
                    q.along->force.cols() != q.along->motion.cols()))
      throw Error("needs one row for each of the boundary's forces and motions", "ResponseQuery::along");
  }

  LoadDirections directions(const ResponseQuery& q) const {
    if (q.along) return *q.along;
    const Index k = static_cast<Index>(forces.cols()), all = k + motions;
    LoadDirections every{MatrixX::Zero(k, all), MatrixX::Zero(motions, all)};
    every.force.leftCols(k).setIdentity();
    every.motion.rightCols(motions).setIdentity();
    return every;
  }

  void set_regions(const ResponseQuery& q) {
    if (q.stiffness.size() > 0) statics->set_region_stiffness(q.stiffness);
    if (q.region_poisson.size() > 0) statics->set_region_poisson(q.region_poisson);
  }

  /// `unit` holds some watched rows (or none of them), then the conjugate ones.
  ResponseState superposed(const ResponseQuery& q, const UnitResponses& unit) const {
    const double young = q.young_modulus_pa;
    const LoadDirections d = directions(q);
    const Index conjugates = static_cast<Index>(forces.cols()), rows = static_cast<Index>(unit.force.rows()) - conjugates;
    const Index others = static_cast<Index>(d.force.cols());
    ResponseState out;
    out.converged = true;
    out.source = ResponseSource::superposed;
    const VectorX loaded = unit.force * (q.force / young);
    const VectorX all = loaded + unit.motion * q.motion;
    out.watched_m = all.head(rows);
    out.conjugate_m = all.tail(conjugates);
    const VectorX imposed = young * (unit.reaction_motion * q.motion);
    out.reaction_n = unit.reaction_force * q.force + imposed;
    // Gradients add up at most; the polynomial knows them at its nodes only, hence the margin.
    const double gradient =
        q.force.cwiseAbs().dot(unit.largest_gradient_force) / young + q.motion.cwiseAbs().dot(unit.largest_gradient_motion);
    out.inverted_elements = gradient < 0.7 ? 0 : -1;
    out.error = unit.residual + options.discretisation_error;
    if (!q.derivatives) return out;
    MatrixX slopes(all.size(), 2 + others);
    slopes.col(0) = -loaded;
    slopes.col(1) = unit.force_d_poisson * (q.force / young) + unit.motion_d_poisson * q.motion;
    slopes.rightCols(others) = unit.force * (d.force / young) + unit.motion * d.motion;
    out.d_watched = slopes.topRows(rows);
    out.d_conjugate = slopes.bottomRows(conjugates);
    out.d_reaction.resize(motions, 2 + others);
    out.d_reaction.col(0) = imposed;
    out.d_reaction.col(1) =
        unit.reaction_force_d_poisson * q.force + young * (unit.reaction_motion_d_poisson * q.motion);
    out.d_reaction.rightCols(others) = unit.reaction_force * d.force + young * (unit.reaction_motion * d.motion);
    return out;
  }

  ResponseState on_branch(const ResponseQuery& q) const {
    const LoadingBranch::Point p = branch->at(q.poisson_ratio, q.force / q.young_modulus_pa);
    const LoadDirections d = directions(q);
    const Index conjugates = static_cast<Index>(forces.cols()), rows = static_cast<Index>(p.watched_m.size()) - conjugates;
    const Index others = static_cast<Index>(d.force.cols());
    ResponseState out;
    out.converged = true;
    out.source = ResponseSource::branch;
    out.watched_m = p.watched_m.head(rows);
    out.conjugate_m = p.watched_m.tail(conjugates);
    out.reaction_n.resize(0);
    out.error = branch->error() + p.across + options.discretisation_error;
    if (!q.derivatives) return out;
    MatrixX slopes(p.watched_m.size(), 2 + others);
    slopes.col(0) = -p.d_force_over_young * (q.force / q.young_modulus_pa);
    slopes.col(1) = p.d_poisson;
    slopes.rightCols(others) = p.d_force_over_young * (d.force / q.young_modulus_pa);
    out.d_watched = slopes.topRows(rows);
    out.d_conjugate = slopes.bottomRows(conjugates);
    out.d_reaction.resize(0, 2 + others);
    return out;
  }

  ResponseState solved(const ResponseQuery& q, const ResponseStart& start) {
    ++solves;
    ResponseState out;
    if (touching) {
      out = touching->solve(q, directions(q), start);
    } else {
      set_regions(q);
      const VectorX* first_m = start.displacement_m;
      if (first_m == nullptr && start.from) first_m = &start.from->displacement_m;
      const Equilibrium e = statics->solve(q.young_modulus_pa, q.poisson_ratio, q.force, q.motion, first_m, q.extra);
      out.converged = e.converged;
      out.reason = e.reason;
      out.inverted_elements = e.inverted_elements;
      out.parameters = parameters;
      if (!e.converged) return out;
      auto solution = std::make_shared<ResponseSolution>();
      solution->displacement_m = e.displacement_m;
      solution->derivative.resize(e.displacement_m.size(), 0);
      out.reaction_n = e.motion_reaction;
      if (q.derivatives) {
        const LoadDirections along = directions(q);
        const SensitivityAlong d = statics->sensitivity_along(e, along.force, along.motion);
        const Index own = std::max<Index>(0, static_cast<Index>(d.d_region_poisson.cols()) - 1), ratios = parameters - 2 - own;
        const Index columns = parameters + static_cast<Index>(along.force.cols());
        solution->derivative.resize(e.displacement_m.size(), columns);
        solution->derivative << d.d_log_young, d.d_poisson, d.d_log_stiffness.rightCols(ratios), d.d_region_poisson.rightCols(own), d.d_along;
        out.d_reaction.resize(motions, columns);
        out.d_reaction << d.reaction_d_log_young, d.reaction_d_poisson, d.reaction_d_log_stiffness.rightCols(ratios),
            d.reaction_d_region_poisson.rightCols(own), d.reaction_d_along;
      }
      out.solution = std::move(solution);
    }
    if (!out.converged) return out;
    out.error = options.discretisation_error;
    out.watched_m = watched * out.solution->displacement_m;
    out.conjugate_m = forces.transpose() * out.solution->displacement_m;
    if (!q.derivatives) return out;
    out.d_watched = watched * out.solution->derivative;
    out.d_conjugate = forces.transpose() * out.solution->derivative;
    return out;
  }

  Options options;
  std::optional<Statics> statics;            // without contacts
  std::optional<TouchingResponse> touching;  // with them
  Eigen::SparseMatrix<double, Eigen::RowMajor> watched;
  Eigen::SparseMatrix<double> forces, branch_rows;
  Index motions = 0, parameters = 2;
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

ResponseState Response::at(const ResponseQuery& query) const {
  impl_->check(query);
  if (impl_->linear) return impl_->superposed(query, *impl_->linear->at(query.poisson_ratio));
  if (impl_->branch && impl_->branch->covers(query.poisson_ratio, query.force / query.young_modulus_pa))
    return impl_->on_branch(query);
  return impl_->solved(query, {});
}

ResponseState Response::solve(const ResponseQuery& query, const ResponseStart& start) const {
  impl_->check(query);
  return impl_->solved(query, start);
}

int Response::inverted_elements(const ResponseQuery& query) const {
  impl_->check(query);
  if (impl_->linear) {
    const auto field_m = impl_->linear->displacement_m(query.poisson_ratio, query.force / query.young_modulus_pa, query.motion);
    if (field_m) return impl_->statics->inverted_elements(*field_m);
  }
  return impl_->solved(query, {}).inverted_elements;
}

std::shared_ptr<const ResponseSpan> Response::span(double poisson_ratio) const {
  return impl_->linear ? impl_->linear->span(static_cast<Index>(impl_->watched.rows()), poisson_ratio) : nullptr;
}

ResponseState Response::readings(const ResponseQuery& query) const {
  impl_->check(query);
  if (!span(query.poisson_ratio)) throw Error("has no span at this Poisson ratio: ask for the whole answer", "Response::readings");
  return impl_->superposed(query, impl_->linear->rows_from(static_cast<Index>(impl_->watched.rows()), query.poisson_ratio));
}

Certificate Response::certify(const ResponseState& state, const ResponseQuery& query) const {
  if (impl_->touching) throw Error("is not made for a body in rigid contact", "Response::certify");
  impl_->check(query);
  const Statics& statics = *impl_->statics;
  const double young = query.young_modulus_pa, nu = query.poisson_ratio;
  impl_->set_regions(query);
  Certificate out;
  const Equilibrium from_rest = statics.solve(young, nu, query.force, query.motion, nullptr, query.extra);
  ++impl_->solves;
  out.converged = from_rest.converged;
  out.reason = from_rest.reason;
  out.inverted_elements = from_rest.inverted_elements;
  if (!out.converged || state.watched_m.size() == 0) return out;
  const VectorX full = impl_->watched * from_rest.displacement_m;
  out.difference = relative((full - state.watched_m).cwiseAbs().maxCoeff(), full.cwiseAbs().maxCoeff());
  out.stable = statics.is_stable(from_rest);
  if (statics.is_linear()) return out;
  constexpr double another = 1e-3;  // two converged answers differ by rounding, or they are two states
  if (state.source == ResponseSource::solved && out.difference > another) {
    out.second_equilibrium = true;
    return out;
  }
  if (!out.stable && !statics.other_equilibria(from_rest).empty()) {
    out.second_equilibrium = true;
    return out;
  }
  const Equilibrium stepped = statics.solve_stepwise(young, nu, query.force, query.motion, query.extra);
  ++impl_->solves;
  out.second_equilibrium = stepped.converged && (stepped.displacement_m - from_rest.displacement_m).cwiseAbs().maxCoeff() >
                                                    another * from_rest.displacement_m.cwiseAbs().maxCoeff();
  return out;
}

void Response::forget() {
  if (impl_->touching) impl_->touching->forget();
}

bool Response::superposes() const { return impl_->linear != nullptr; }
bool Response::touches() const { return impl_->touching.has_value(); }
Index Response::motion_count() const { return impl_->motions; }
double Response::branch_end() const { return impl_->branch ? impl_->branch->end() : 0; }
double Response::branch_error() const { return impl_->branch ? impl_->branch->error() : 0; }
int Response::solves() const { return impl_->solves + (impl_->linear ? impl_->linear->factorisations() : 0); }
int Response::load_cases() const { return impl_->linear ? impl_->linear->load_cases() : 0; }

}  // namespace palpate::fem
