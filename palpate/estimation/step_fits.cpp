// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/step_fits.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::estimation {
namespace {

/// Where the tool touches, and how wide. A set of vertices: their centre, and the disc with the same mean square distance.
void add_contact(const ForwardModel& model, const Load& load, StepFit& fit) {
  const Tool& tool = model.tool(load.tool);
  fit.contact_m = load.contact_m;
  fit.tool_radius_m = tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc ? tool.radius_m : 0;
  Vec3 centre = Vec3::Zero();
  if (tool.shape == ToolShape::vertices && !tool.vertices.empty()) {
    const Points& nodes_m = model.object().mesh.nodes_m;
    const auto count = static_cast<double>(tool.vertices.size());
    double square_m2 = 0;
    for (const Index node : tool.vertices) centre += nodes_m.row(node).transpose() / count;
    for (const Index node : tool.vertices) square_m2 += (nodes_m.row(node).transpose() - centre).squaredNorm() / count;
    fit.contact_m = centre;
    fit.tool_radius_m = std::sqrt(2 * square_m2);
  } else if (tool.shape == ToolShape::platen) {
    // Its middle stands above the middle of the object.
    const Points& rest_m = model.object().surface.rest().vertices_m;
    centre = 0.5 * (rest_m.colwise().minCoeff() + rest_m.colwise().maxCoeff()).transpose();
    fit.contact_m = centre - tool.plane.normal.dot(centre - tool.plane.point_m) * tool.plane.normal;
  }
}

/// Variance of a quantity with derivatives `row` to the unknowns `columns`.
double variance(const Eigen::RowVectorXd& row, const std::vector<int>& columns, const MatrixX& covariance,
                const std::vector<int>& moving) {
  VectorX gradient = VectorX::Zero(covariance.rows());
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const auto at = std::lower_bound(moving.begin(), moving.end(), columns[k]);
    if (at != moving.end() && *at == columns[k]) gradient(at - moving.begin()) = row(static_cast<Index>(k));
  }
  return std::max(0.0, gradient.dot(covariance * gradient));
}

}  // namespace

std::vector<StepFit> step_fits(const Objective& objective) {
  const ForwardModel& model = objective.model();
  std::vector<StepFit> steps;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const StepPrediction& predicted = objective.last_predictions()[s];
    StepFit fit;
    fit.push = model.push(s).name;
    fit.step = static_cast<int>(model.index(s).step);
    fit.used = predicted.surface_m.rows() > 0;
    fit.surface_m = predicted.surface_m;
    const auto& loads = model.step(s).loads;
    if (!loads.empty() && fit.used) {
      const Load& load = loads.front();
      const Vec3 direction = load.direction.normalized();
      fit.tool = load.tool;
      add_contact(model, load, fit);
      fit.force_n = load.force_n.value_or(predicted.force_n.front());
      fit.travel_predicted_m = predicted.travel_m(0);
      if (load.force_n) fit.force_measured_n = load.force_n->dot(direction);
      if (load.travel_m) {
        fit.travel_m = *load.travel_m;
        fit.force_predicted_n = predicted.force_n.front().dot(direction);
      }
      for (const auto& observation : model.step(s).observations) {
        const auto of_this_tool = [&](const auto* read) { return read != nullptr && (read->tool.empty() || read->tool == load.tool); };
        if (const auto* travel = std::get_if<ToolTravel>(&observation); of_this_tool(travel)) fit.travel_m = travel->travel_m;
        if (const auto* wrench = std::get_if<Wrench>(&observation); of_this_tool(wrench)) fit.force_measured_n = wrench->force_n.dot(direction);
      }
    }
    Index points = 0;
    for (const auto& rows : objective.last_rows()[s]) points += rows.robust ? rows.observed_m.rows() : 0;
    fit.observed_m.resize(points, 3);
    fit.residual_m.resize(points);
    Index at = 0;
    for (const auto& rows : objective.last_rows()[s]) {
      if (!rows.robust) continue;
      fit.observed_m.middleRows(at, rows.observed_m.rows()) = rows.observed_m;
      fit.residual_m.segment(at, rows.residual.size()) = rows.residual.cwiseProduct(rows.sigma);
      at += rows.observed_m.rows();
    }
    steps.push_back(std::move(fit));
  }
  return steps;
}

void add_bands(std::vector<StepFit>& steps, const Objective& objective, const MatrixX& covariance, const std::vector<int>& moving) {
  for (std::size_t s = 0; s < steps.size(); ++s) {
    const StepPrediction& predicted = objective.last_predictions()[s];
    const auto& loads = objective.model().step(s).loads;
    if (loads.empty() || predicted.d_travel.rows() == 0) continue;
    if (loads.front().travel_m) {
      const Eigen::RowVectorXd along = loads.front().direction.normalized().transpose() * predicted.d_force.front();
      steps[s].force_predicted_std_n = std::sqrt(variance(along, predicted.columns, covariance, moving));
    } else {
      steps[s].travel_predicted_std_m =
          std::sqrt(variance(predicted.d_travel.row(0), predicted.columns, covariance, moving));
    }
  }
}

bool add_stresses(std::vector<StepFit>& steps, ForwardModel& model, const VectorX& unknowns, const OnProgress& progress) {
  for (std::size_t s = 0; s < steps.size(); ++s) {
    if (progress && !progress("stress", static_cast<double>(s) / static_cast<double>(steps.size()))) return false;
    if (steps[s].used) steps[s].von_mises_pa = model.von_mises_pa(s, unknowns);
  }
  return true;
}

}  // namespace palpate::estimation
