// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_predictions.hpp"

#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/registration/icp.hpp"

namespace palpate::cli {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Answers for one step of a recording by solving it at an answer: travel of the tool and surface.
class Expected {
 public:
  Expected(const Recording& recording, const estimation::SimulatedObject& object, const estimation::FitOptions& options,
           estimation::FitMemory& memory)
      : model_(recording, object, unknowns_, estimation::statics_options(recording, object, options), memory.model) {
    memory.model = model_.solved();
  }
  /// @param by_region  E of the regions, the first one's too; empty = one E
  estimation::StepPrediction operator()(std::size_t step, double young_pa, double nu, const std::vector<double>& by_region = {}) {
    VectorX at = unknowns_.prior_mean();
    at(estimation::log_young) = std::log(by_region.empty() ? young_pa : by_region.front());
    at(estimation::poisson) = nu;
    for (std::size_t r = 1; r < by_region.size(); ++r)
      at(estimation::first_ratio + static_cast<int>(r) - 1) = std::log(by_region[r] / by_region.front());
    return model_.predict(step, at);  // with derivatives: travel comes with them
  }

 private:
  estimation::Unknowns unknowns_;
  estimation::ForwardModel model_;
};

/// @param moves  the object may have moved as a whole: registered first
double rms_to(const TriMesh& surface, const RayCloud& seen, bool moves) {
  if (seen.range_m.size() == 0) return nan;
  const geometry::TriangleTree tree(surface);
  PointCloud cloud;
  cloud.points_m = seen.origins_m + (seen.directions.array().colwise() * seen.range_m.array()).matrix();
  const Pose T = moves ? registration::align(cloud, tree, Pose::Identity()).T_surface_cloud : Pose::Identity();
  double sum = 0;
  for (Index i = 0; i < static_cast<Index>(cloud.points_m.rows()); ++i)
    sum += tree.closest(T * Vec3(cloud.points_m.row(i))).squared_distance_m2;
  return std::sqrt(sum / static_cast<double>(cloud.points_m.rows()));
}

/// Straight between the forces that were asked for, and on beyond them.
double force_at(double travel_m, const std::vector<std::pair<double, double>>& travel_force) {
  std::size_t k = 1;
  while (k + 1 < travel_force.size() && travel_force[k].first < travel_m) ++k;
  const auto& [t0, f0] = travel_force[k - 1];
  const auto& [t1, f1] = travel_force[k];
  return f0 + (f1 - f0) * (travel_m - t0) / (t1 - t0);
}

/// What one answer expects of every step; without an entry where it has no equilibrium.
struct Course {
  std::map<std::size_t, Expectation> at;
};

Course course_of(const Recording& recording, const Prepared& given, const MethodAnswer& answer, const std::vector<double>& by_region,
                 const std::vector<RayCloud>& seen, const estimation::FitOptions& options, estimation::FitMemory& memory) {
  Course course;
  if (!std::isfinite(answer.young_modulus_pa)) return course;
  Expected expected(recording, given.object, options, memory);
  std::vector<std::pair<double, double>> travel_force{{0, 0}};
  const Push& push = recording.pushes[0];
  for (std::size_t s = 0; s < push.steps.size(); ++s) {
    if (!loaded(push.steps[s])) continue;
    const auto predicted = expected(s, answer.young_modulus_pa, answer.poisson_ratio, by_region);
    if (!predicted.converged) continue;
    const Load& load = push.steps[s].loads[0];
    const std::pair<double, double> here{predicted.travel_m(0), load.force_n->dot(load.direction)};
    if (here.first > travel_force.back().first) travel_force.push_back(here);
    course.at[s] = {nan, rms_to({predicted.surface_m, given.object.surface.rest().triangles}, seen[s], recording.free)};
  }
  if (travel_force.size() > 1)
    for (auto& [s, expectation] : course.at) expectation.force_n = force_at(travel_of(push.steps[s]), travel_force);
  return course;
}

}  // namespace

void predict_unused(const Prepared& given, const Prepared* other, const lab::PaperTrial& trial, const std::vector<double>& by_region,
                    const estimation::FitOptions& options, SharedModels& shared, TrialAnswer& out) {
  if (trial.unused.steps.empty()) return;
  Recording recording = given.recording;
  recording.pushes = {trial.unused};
  const TriMesh& rest = given.object.surface.rest();
  const geometry::TriangleTree rest_tree(rest);
  std::vector<RayCloud> seen;
  for (const auto& step : observe(recording)) {
    seen.emplace_back();
    for (const auto& input : step)
      if (const auto* rays = std::get_if<estimation::RayObservation>(&input)) seen.back() = thinned(rays->rays, rest_tree, near_of(recording));
  }
  const Prepared one = as_one(given);
  const Course paper = course_of(recording, one, out.paper, {}, seen, options, shared.fine.unused),
               ours = course_of(recording, given, out.palpate, by_region, seen, options, shared.fine.unused),
               by_other = other != nullptr ? course_of(recording, *other, out.other, {}, seen, options, shared.other.unused) : Course{};
  const auto expectation = [](const Course& course, std::size_t s) {
    const auto found = course.at.find(s);
    return found == course.at.end() ? Expectation{nan, nan} : found->second;
  };
  for (std::size_t s = 0; s < trial.unused.steps.size(); ++s) {
    if (!loaded(trial.unused.steps[s])) continue;
    out.unused.push_back({trial.unused_force_n[s], travel_of(trial.unused.steps[s]), expectation(paper, s), expectation(ours, s),
                          expectation(by_other, s), rms_to(rest, seen[s], recording.free)});
  }
}

void add_pictures(const Prepared& given, double young_modulus_pa, double poisson_ratio, const estimation::FitOptions& options,
                  TrialAnswer& out) {
  if (!std::isfinite(young_modulus_pa)) return;
  constexpr Index most_dots = 900;
  std::size_t flat = 0, hardest = 0;
  double most_n = 0;
  for (const Push& push : given.recording.pushes)
    for (const Step& step : push.steps) {
      if (loaded(step) && step.loads[0].force_n->norm() > most_n) {
        most_n = step.loads[0].force_n->norm();
        hardest = flat;
      }
      ++flat;
    }
  const auto thin = [](const Points& all) {
    const Index stride = std::max<Index>(1, static_cast<Index>(all.rows()) / most_dots);
    Points some((static_cast<Index>(all.rows()) + stride - 1) / stride, 3);
    for (Index i = 0; i < static_cast<Index>(some.rows()); ++i) some.row(i) = all.row(i * stride);
    return some;
  };
  PointCloud cloud;
  for (const auto& input : given.inputs[hardest])
    if (const auto* seen = std::get_if<estimation::RayObservation>(&input))
      cloud.points_m = seen->rays.origins_m + (seen->rays.directions.array().colwise() * seen->rays.range_m.array()).matrix();
  if (cloud.points_m.rows() < 6) return;
  estimation::FitMemory memory;
  Expected expected(given.recording, given.object, options, memory);
  for (const double factor : {3.0, 2.0, 1.3, 1.0}) {
    RegistrationPicture picture;
    picture.young_modulus_pa = factor * young_modulus_pa;
    const auto at = expected(hardest, picture.young_modulus_pa, poisson_ratio);
    if (!at.converged) continue;
    const geometry::TriangleTree tree(TriMesh{at.surface_m, given.object.surface.rest().triangles});
    const auto icp = registration::align(cloud, tree, Pose::Identity());
    picture.registered_m = cloud.points_m;
    double sum = 0;
    for (Index i = 0; i < static_cast<Index>(cloud.points_m.rows()); ++i) {
      const Vec3 p = icp.T_surface_cloud * Vec3(cloud.points_m.row(i));
      picture.registered_m.row(i) = p;
      sum += tree.closest(p).squared_distance_m2;
    }
    picture.rms_m = std::sqrt(sum / static_cast<double>(cloud.points_m.rows()));
    picture.registered_m = thin(picture.registered_m);
    picture.simulated_m = thin(at.surface_m);
    out.pictures.push_back(std::move(picture));
  }
}

}  // namespace palpate::cli
