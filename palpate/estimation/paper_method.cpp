// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/paper_method.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/solve_count.hpp"
#include "palpate/geometry/nearest_vertices.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

Points points_of(const std::vector<TermInput>& inputs) {
  std::vector<Vec3> all;
  for (const auto& input : inputs) {
    if (const auto* cloud = std::get_if<PointCloud>(&input)) {
      for (Index i = 0; i < cloud->points_m.rows(); ++i) all.emplace_back(cloud->points_m.row(i));
    } else if (const auto* rays = std::get_if<RayObservation>(&input)) {
      const RayCloud& r = rays->rays;
      for (Index i = 0; i < r.range_m.size(); ++i) all.emplace_back(r.origins_m.row(i) + r.range_m(i) * r.directions.row(i));
    }
  }
  Points points(static_cast<Index>(all.size()), 3);
  for (std::size_t i = 0; i < all.size(); ++i) points.row(static_cast<Index>(i)) = all[i];
  return points;
}

struct Nearest {
  Vec3 at_m;
  double squared_distance_m2 = 0;
};

/// Besl and McKay's point-to-point ICP; returns the sum of squared distances to what is nearest at its end (eq. 6).
/// @param nearest  of point number i, where it is now
template <class F>
double aligned_squared_distance(Points points, F nearest) {
  double last = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < 30; ++iteration) {
    Points targets(points.rows(), 3);
    double sum = 0;
    for (Index i = 0; i < points.rows(); ++i) {
      const Nearest found = nearest(static_cast<std::size_t>(i), Vec3(points.row(i)));
      targets.row(i) = found.at_m;
      sum += found.squared_distance_m2;
    }
    if (sum > last * (1 - 1e-6)) return sum;
    last = sum;
    const Eigen::RowVector3d from = points.colwise().mean(), to = targets.colwise().mean();
    const Mat3 correlation = (targets.rowwise() - to).transpose() * (points.rowwise() - from);
    const Eigen::JacobiSVD<Mat3> svd(correlation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Mat3 sign = Mat3::Identity();
    sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    const Mat3 rotation = svd.matrixU() * sign * svd.matrixV().transpose();
    points = ((points.rowwise() - from) * rotation.transpose()).rowwise() + to;
  }
  return last;
}

}  // namespace

double slope(std::pair<double, double> behind, const std::pair<double, double>& here, std::pair<double, double> ahead) {
  if (!std::isfinite(behind.second)) behind = here;
  if (!std::isfinite(ahead.second)) ahead = here;
  return ahead.first > behind.first ? (ahead.second - behind.second) / (ahead.first - behind.first) : 0;
}

struct PaperError::Impl {
  Recording recording;  // without the slow error of the rest surface, of which the method knows nothing
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::vector<std::size_t> steps;
  std::vector<Points> points;
  std::vector<geometry::NearestVertices> vertices;                      // a sample
  std::vector<std::vector<geometry::NearestVertices::Memory>> nearest;  // a point of a sample
  std::vector<geometry::TriangleTree> surfaces;                         // a sample, in place of vertices
  SolveCount for_start;
  std::size_t count = 0;
  double start_pa = 0;
};

PaperError::PaperError(const Recording& given, const SimulatedObject& object, const Inputs& inputs,
                       const FitOptions& options, FitMemory* memory, PaperDistance distance)
    : impl_(std::make_unique<Impl>()) {
  impl_->recording = given;
  impl_->recording.rest.surface_std_m = 0;
  const Recording& recording = impl_->recording;
  const fem::StaticsOptions statics = statics_options(recording, object, options);
  FitMemory here;
  if (memory == nullptr) memory = &here;
  if (options.young_start_pa) {
    impl_->start_pa = *options.young_start_pa;
  } else {  // the same start as the other method's, so that only the methods differ
    Unknowns list;
    ForwardModel model(recording, object, list, statics, memory->model);
    memory->model = model.solved();
    const CountsAtEnd counts(model, impl_->for_start);
    Objective objective(model, inputs, list);
    impl_->start_pa = std::exp(find_start(objective, recording.model.poisson_fixed.value_or(options.poisson_start))(log_young));
  }
  impl_->model = std::make_unique<ForwardModel>(recording, object, impl_->unknowns, statics, memory->model);
  memory->model = impl_->model->solved();
  std::vector<std::size_t> with_points;
  for (std::size_t s = 0; s < inputs.size(); ++s) {
    if (points_of(inputs[s]).rows() > 0) with_points.push_back(s);
  }
  if (with_points.empty()) {
    throw Error("the paper's method needs a point cloud or a depth image in at least one step", "method paper");
  }
  const std::size_t samples = std::min(paper_samples, with_points.size());
  for (std::size_t k = 0; k < samples; ++k) {
    const std::size_t s = with_points[(k * with_points.size() + with_points.size() / 2) / samples];
    impl_->steps.push_back(s);
    impl_->points.push_back(points_of(inputs[s]));
    if (distance == PaperDistance::surface) impl_->surfaces.emplace_back(object.surface.rest());
    impl_->vertices.emplace_back(object.surface.rest().vertices_m);
    impl_->nearest.emplace_back(static_cast<std::size_t>(impl_->points.back().rows()));
    impl_->count += static_cast<std::size_t>(impl_->points.back().rows());
  }
}

PaperError::~PaperError() = default;
double PaperError::start_young_modulus_pa() const { return impl_->start_pa; }
std::size_t PaperError::samples() const { return impl_->steps.size(); }
std::size_t PaperError::points() const { return impl_->count; }
int PaperError::solves() const { return impl_->for_start.solves + impl_->model->solves(); }

int PaperError::load_cases() const { return impl_->for_start.load_cases + impl_->model->load_cases(); }

double PaperError::operator()(double young_modulus_pa, double poisson_ratio) {
  VectorX at = impl_->unknowns.prior_mean();
  at(log_young) = std::log(young_modulus_pa);
  at(poisson) = poisson_ratio;
  double sum = 0;
  for (std::size_t k = 0; k < impl_->steps.size(); ++k) {
    const StepPrediction predicted = impl_->model->predict(impl_->steps[k], at, false);
    if (!predicted.converged) return std::numeric_limits<double>::infinity();
    if (!impl_->surfaces.empty()) {
      geometry::TriangleTree& surface = impl_->surfaces[k];
      surface.refit(predicted.surface_m);
      sum += aligned_squared_distance(impl_->points[k], [&](std::size_t, const Vec3& point_m) {
        const geometry::ClosestPoint found = surface.closest(point_m);
        return Nearest{found.point_m, found.squared_distance_m2};
      });
      continue;
    }
    geometry::NearestVertices& vertices = impl_->vertices[k];
    vertices.move(predicted.surface_m);
    sum += aligned_squared_distance(impl_->points[k], [&](std::size_t i, const Vec3& point_m) {
      const auto found = vertices.nearest(point_m, impl_->nearest[k][i]);
      return Nearest{vertices.vertices_m().row(found.vertex), found.squared_distance_m2};
    });
  }
  return sum / static_cast<double>(impl_->count);
}

namespace {

/// Where a descent ended, in (log E, nu).
struct Descent {
  Eigen::Vector2d x;
  double error_m2 = std::numeric_limits<double>::infinity();  ///< there; infinity: no equilibrium at its start
  Termination termination = Termination::max_iterations;
  std::string message = "stopped after the largest number of iterations";
  int iterations = 0;
};

struct Bounds {
  double nu_low = 0, nu_high = 0;
  bool nu_moves = true;
  Eigen::Vector2d inside(Eigen::Vector2d at) const {
    at(1) = std::clamp(at(1), nu_low, nu_high);
    return at;
  }
};

/// Algorithm 1: gradient step, re-simulation, acceptance if the error falls.
/// @param at  called with every iteration's place and error; false: the user has had enough
Descent descend(PaperError& error, Eigen::Vector2d start, const Bounds& bounds, int max_iterations,
                const std::function<bool(const Eigen::Vector2d&, double, int)>& at) {
  // Of log E and nu in the numerical derivatives. Points that change their nearest vertex make the error rough: where a narrow
  // difference shows no way down, a wider one may.
  constexpr std::array<double, 3> differences{1e-3, 1e-2, 1e-1};
  std::size_t width = 0;
  Descent out;
  Eigen::Vector2d& x = out.x = start;
  double& here = out.error_m2;
  const auto value = [&](const Eigen::Vector2d& place) { return error(std::exp(place(0)), place(1)); };
  here = value(x);
  if (!std::isfinite(here)) {
    out.termination = Termination::failed;
    out.message = "the simulation found no equilibrium at the start, nor at a quarter or four times of its E";
    return out;
  }
  double rate = -1;
  Eigen::Vector2d last_x = x, last_gradient = Eigen::Vector2d::Zero();
  for (; out.iterations < max_iterations; ++out.iterations) {
    if (!at(x, here, out.iterations)) {
      out.termination = Termination::cancelled;
      out.message = "stopped by the caller";
      break;
    }
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    for (int k = 0; k < (bounds.nu_moves ? 2 : 1); ++k) {
      Eigen::Vector2d ahead = x, behind = x;
      ahead(k) += differences[width];
      behind(k) -= differences[width];
      ahead = bounds.inside(ahead);
      behind = bounds.inside(behind);
      gradient(k) = slope({behind(k), value(behind)}, {x(k), here}, {ahead(k), value(ahead)});
    }
    // First step: a tenth in log E; afterwards Barzilai and Borwein's length, still along the gradient.
    if (rate < 0) {
      rate = 0.1 / std::max(gradient.norm(), 1e-300);
    } else {
      const Eigen::Vector2d moved = x - last_x, change = gradient - last_gradient;
      const double curvature = moved.dot(change);
      if (curvature > 0) rate = moved.squaredNorm() / curvature;
    }
    last_x = x;
    last_gradient = gradient;
    bool improved = false;
    for (int attempt = 0; attempt < 14; ++attempt, rate /= 3) {
      Eigen::Vector2d move = -rate * gradient;
      if (move.norm() > 1) move *= 1 / move.norm();
      if (move.norm() < 1e-4) break;  // a hundredth of a per cent of E
      const Eigen::Vector2d next = bounds.inside(x + move);
      const double there = value(next);
      if (there < here) {
        improved = true;
        const double gain = (here - there) / here;
        const double length = (next - x).norm();
        x = next;
        here = there;
        if (gain < 1e-6 && length < 1e-4) improved = false;
        break;
      }
    }
    if (!improved && ++width < differences.size()) {
      rate = -1;
      continue;
    }
    if (!improved) {
      out.termination = Termination::converged;
      out.message = "converged";
      break;
    }
  }
  return out;
}

}  // namespace

Identification fit_as_in_paper(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                               const FitOptions& options, const OnProgress& progress, FitMemory* memory, PaperDistance distance) {
  check(options);
  PaperError error(recording, object, inputs, options, memory, distance);
  const double nu_start = recording.model.poisson_fixed.value_or(options.poisson_start);
  const Bounds bounds{std::min(recording.model.poisson_lower, recording.model.poisson_fixed.value_or(1)),
                      std::max(recording.model.poisson_upper, recording.model.poisson_fixed.value_or(-1)), !recording.model.poisson_fixed};
  const auto parameters = [](const Eigen::Vector2d& x) -> std::vector<Parameter> {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    return {{"young_modulus", "", "Pa", std::exp(x(0)), nan, nan, nan, true},
            {"poisson_ratio", "", "1", x(1), nan, nan, nan, true}};
  };
  Identification answer;
  answer.material = object.material;
  answer.surface = object.surface.rest();
  const auto watched = [&](const Eigen::Vector2d& x, double here, int iteration) {
    if (progress && !progress("paper's method", static_cast<double>(iteration) / options.max_iterations)) return false;
    answer.trace.push_back({std::exp(x(0)), x(1), here});
    if (options.on_estimate) {
      answer.parameters = parameters(x);
      options.on_estimate(answer);
    }
    return true;
  };
  const Eigen::Vector2d start = bounds.inside({std::log(error.start_young_modulus_pa()), nu_start});
  Descent found = descend(error, start, bounds, options.max_iterations, watched);
  // The other method looks there too where its start has no equilibrium (optimise_from_several).
  for (const double factor : {0.25, 4.0}) {
    if (std::isfinite(found.error_m2)) break;
    found = descend(error, start + Eigen::Vector2d(std::log(factor), 0), bounds, options.max_iterations, watched);
  }
  answer.termination = found.termination;
  answer.message = found.message;
  answer.fit.iterations = found.iterations;
  answer.fit.solves = error.solves();
  answer.fit.load_cases = error.load_cases();
  answer.fit.rms_m = std::sqrt(found.error_m2);
  answer.fit.points_used = error.points();
  answer.fit.steps = error.samples();
  answer.fit.pushes = recording.pushes.size();
  answer.parameters = parameters(found.x);
  answer.verdicts.push_back({"no_uncertainty", "The paper's method gives no interval: use the default method for one."});
  if (bounds.nu_moves && (found.x(1) <= bounds.nu_low || found.x(1) >= bounds.nu_high)) {
    answer.verdicts.push_back({"nu_at_bound", "The Poisson ratio ended at the end of its range."});
  }
  return answer;
}

}  // namespace palpate::estimation
