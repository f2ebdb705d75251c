// SPDX-License-Identifier: Apache-2.0
#include "cli/export_checks.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/response.hpp"

namespace palpate::cli {
namespace {

/// Beyond, equilibria take longer than a remark may.
constexpr Eigen::Index most_nodes = 40000;

fem::StaticsOptions as_fitted(const io::ExportModel& model, int threads) {
  fem::StaticsOptions options;
  options.threads = threads;
  options.max_load_steps = 20;  // as `predict`: it folds under what takes more
  double poisson = model.poisson_ratio;
  for (const io::ExportRegion& one : model.regions) poisson = std::max(poisson, one.poisson_ratio);
  if (model.mesh.tetrahedra.cols() == 10 && poisson > 0.45) options.dilatation = fem::Dilatation::averaged;
  return options;
}

const StepFit* hardest_push(const Identification& answer) {
  const StepFit* hardest = nullptr;
  for (const StepFit& step : answer.steps)
    if (step.tool_radius_m > 0 && step.force_n.allFinite() && step.force_n.norm() > (hardest ? hardest->force_n.norm() : 0)) hardest = &step;
  return hardest;
}

/// Supports as they were fitted, and the hardest push. @throws Error where supports or patch touch nothing
fem::Boundary pushed(const LearnedObject& learned, const TetMesh& mesh, const StepFit& push) {
  fem::Boundary boundary;
  const Eigen::SparseMatrix<double> patch = fem::spread_over_patch(mesh, push.contact_m, push.tool_radius_m);
  boundary.forces = (patch * push.force_n).sparseView();
  boundary.inertia_relief = learned.object.free;
  if (!learned.object.free) boundary.constraints = estimation::hold(mesh, estimation::held_both_ways(learned.object.supports), {}).constraints;
  boundary.motions.resize(3 * mesh.nodes_m.rows(), 0);
  return boundary;
}

}  // namespace

fem::Boundary export_boundary(const io::ExportModel& model) {
  fem::Boundary boundary;
  for (const Index node : model.fixed) boundary.constraints.push_back({node, Mat3::Identity(), 3});
  for (auto it = model.sliding.begin(); it != model.sliding.end();) {  // ascending: a node's axes are neighbours
    const Index node = it->first;
    fem::Constraint held{node, Mat3::Identity(), 0};
    for (; it != model.sliding.end() && it->first == node; ++it) held.axes.col(held.count++) = Vec3::Unit(it->second);
    boundary.constraints.push_back(held);
  }
  const Eigen::Index size = 3 * model.mesh.nodes_m.rows();
  boundary.forces.resize(size, 1);
  for (const auto& [node, force] : model.forces_n)
    for (int d = 0; d < 3; ++d) boundary.forces.coeffRef(3 * node + d, 0) += force(d);
  boundary.motions.resize(size, 0);
  return boundary;
}

OwnAnswer solved_here(const io::ExportModel& model, const std::string& law, fem::Boundary boundary, fem::StaticsOptions options) {
  if (!model.regions.empty()) {
    const Index count = static_cast<Index>(model.regions.size());
    options.region = model.region;
    options.region_stiffness.resize(count);
    options.region_poisson.resize(count);
    for (Index r = 0; r < count; ++r) {
      const io::ExportRegion& one = model.regions[static_cast<std::size_t>(r)];
      options.region_stiffness(r) = one.young_modulus_pa / model.young_modulus_pa;
      options.region_poisson(r) = r > 0 ? one.poisson_ratio : std::nan("");
    }
  }
  fem::Response::Options all;
  all.statics = std::move(options);
  const fem::Response response(model.mesh, law, std::move(boundary), Eigen::SparseMatrix<double>(0, 3 * model.mesh.nodes_m.rows()), all);
  fem::ResponseQuery query{model.young_modulus_pa, model.poisson_ratio, VectorX::Ones(1), VectorX(0)};
  query.derivatives = false;
  if (law == model.law) query.extra = model.law_parameters;
  const fem::ResponseState at = response.solve(query);
  if (!at.converged) return {false, at.reason, {}, 0};
  return {true, {}, at.solution->displacement_m, at.inverted_elements};
}

std::optional<LawComparison> compare_laws(const LearnedObject& learned, const io::ExportModel& model, const std::string& other, int threads) {
  const StepFit* push = hardest_push(learned.answer);
  if (push == nullptr || model.mesh.nodes_m.rows() > most_nodes) return std::nullopt;
  try {
    const fem::Boundary boundary = pushed(learned, model.mesh, *push);
    const VectorX load = boundary.forces.col(0);
    const double force_n = push->force_n.norm();
    const OwnAnswer as_learned = solved_here(model, model.law, boundary, as_fitted(model, threads));
    if (!as_learned.converged) return std::nullopt;
    LawComparison out{push->push, force_n, load.dot(as_learned.displacement_m) / force_n, {}, 0};
    const OwnAnswer there = solved_here(model, other, boundary, as_fitted(model, threads));
    out.inverted_elements = there.inverted_elements;
    if (there.converged) out.other_m = load.dot(there.displacement_m) / force_n;
    return out;
  } catch (const Error&) {
    return std::nullopt;  // a remark is no reason to write nothing
  }
}

std::optional<double> stiffer_elements(const LearnedObject& learned, const io::ExportModel& model, const io::Exporter& exporter,
                                       io::LinearElements elements, int threads) {
  const StepFit* push = hardest_push(learned.answer);
  const fem::StaticsOptions fitted = as_fitted(model, threads);
  const bool same_mesh = exporter.quadratic || model.mesh.tetrahedra.cols() == 4;
  if (same_mesh && fitted.dilatation == fem::Dilatation::pointwise) return std::nullopt;
  if (push == nullptr || model.mesh.nodes_m.rows() > most_nodes) return std::nullopt;
  try {
    fem::Boundary boundary = pushed(learned, model.mesh, *push);
    const VectorX load = boundary.forces.col(0);
    const OwnAnswer as_fitted_moves = solved_here(model, "linear", boundary, fitted);
    const io::ExportModel written = same_mesh ? model : io::with_linear_elements(model, elements);
    if (written.mesh.nodes_m.rows() < model.mesh.nodes_m.rows()) {  // corners: others are no longer there
      const std::vector<Index> place = io::corner_places(model.mesh);
      std::vector<fem::Constraint> kept;
      for (fem::Constraint one : boundary.constraints) {
        one.node = place[static_cast<std::size_t>(one.node)];
        if (one.node >= 0) kept.push_back(one);
      }
      boundary.constraints = std::move(kept);
      boundary.motions.resize(3 * written.mesh.nodes_m.rows(), 0);
    }
    // The patch of these elements: forces of quadratic ones sit at midpoints, and would dent linear ones.
    boundary.forces = (fem::spread_over_patch(written.mesh, push->contact_m, push->tool_radius_m) * push->force_n).sparseView();
    const VectorX there = boundary.forces.col(0);
    fem::StaticsOptions plain;
    plain.threads = threads;
    const OwnAnswer moves = solved_here(written, "linear", boundary, plain);
    if (!moves.converged || !as_fitted_moves.converged) return std::nullopt;
    return load.dot(as_fitted_moves.displacement_m) / there.dot(moves.displacement_m) - 1;
  } catch (const Error&) {
    return std::nullopt;
  }
}

int rigid_motions_left(const io::ExportModel& model) {
  const Points& nodes = model.mesh.nodes_m;
  const Vec3 middle = nodes.colwise().mean();
  const double size_m = (nodes.colwise().maxCoeff() - nodes.colwise().minCoeff()).norm();
  Eigen::Matrix<double, 6, 6> held = Eigen::Matrix<double, 6, 6>::Zero();
  const auto hold = [&](Index node, int axis) {
    Eigen::Matrix<double, 6, 1> row;
    row << Vec3::Unit(axis), Vec3((nodes.row(node).transpose() - middle).cross(Vec3::Unit(axis)) / size_m);
    held += row * row.transpose();
  };
  for (const Index node : model.fixed)
    for (int axis = 0; axis < 3; ++axis) hold(node, axis);
  for (const auto& [node, axis] : model.sliding) hold(node, axis);
  const double count = std::max(1.0, double(3 * model.fixed.size() + model.sliding.size()));
  const VectorX values = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(held).eigenvalues();
  constexpr double rounding = 1e-10;
  return static_cast<int>((values.array() < rounding * count).count());
}

}  // namespace palpate::cli
