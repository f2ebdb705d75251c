// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_predictions.hpp"

#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "cli/paper_expected.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/registration/icp.hpp"

namespace palpate::cli {
namespace {

constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

/// @param moves  the object may have moved as a whole: registered first
double rms_to(const TriMesh& surface, const RayCloud& seen, bool moves) {
  if (seen.range_m.size() == 0) return no_number;
  const geometry::TriangleTree tree(surface);
  PointCloud cloud;
  cloud.points_m = seen.origins_m + (seen.directions.array().colwise() * seen.range_m.array()).matrix();
  const Pose T = moves ? registration::align(cloud, tree, Pose::Identity()).T_surface_cloud : Pose::Identity();
  double sum = 0;
  for (Index i = 0; i < static_cast<Index>(cloud.points_m.rows()); ++i)
    sum += tree.closest(T * Vec3(cloud.points_m.row(i))).squared_distance_m2;
  return std::sqrt(sum / static_cast<double>(cloud.points_m.rows()));
}

/// Middles of the true surface's triangles that have left the one at rest by more than a tenth of the most that one has: the dent,
/// without noise, and on all its sides.
Points dent_of(const TriMesh& now, const geometry::TriangleTree& rest) {
  Points middles_m(now.triangles.rows(), 3);
  VectorX left_m(now.triangles.rows());
  for (Index t = 0; t < static_cast<Index>(left_m.size()); ++t) {
    middles_m.row(t) = now.vertices_m(now.triangles.row(t), Eigen::all).colwise().mean();
    left_m(t) = std::sqrt(rest.closest(middles_m.row(t)).squared_distance_m2);
  }
  const double far_m = 0.1 * left_m.maxCoeff();
  std::vector<Index> rows;
  for (Index t = 0; t < static_cast<Index>(left_m.size()); ++t)
    if (left_m(t) > far_m) rows.push_back(t);
  return middles_m(rows, Eigen::all);
}

double rms_to(const geometry::TriangleTree& surface, const Points& points_m) {
  if (points_m.rows() == 0) return no_number;
  double sum = 0;
  for (Index i = 0; i < static_cast<Index>(points_m.rows()); ++i) sum += surface.closest(points_m.row(i)).squared_distance_m2;
  return std::sqrt(sum / static_cast<double>(points_m.rows()));
}

/// What was there to be predicted, a step.
struct Shown {
  std::vector<RayCloud> seen;
  std::vector<Points> dent_m;  ///< empty: not known
};

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
                 const Shown& shown, const estimation::FitOptions& options, estimation::FitMemory& memory) {
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
    const TriMesh surface{predicted.surface_m, given.object.surface.rest().triangles};
    course.at[s] = {no_number, rms_to(surface, shown.seen[s], recording.free), rms_to(geometry::TriangleTree(surface), shown.dent_m[s])};
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
  if (recording.model.material != "linear" && std::isfinite(out.palpate.young_modulus_pa))  // as far as a patch stands for the tool
    estimation::keep_first_steps(recording, estimation::steps_within_pressure(recording, out.palpate.young_modulus_pa));
  const TriMesh& rest = given.object.surface.rest();
  const geometry::TriangleTree rest_tree(rest);
  Shown shown;
  for (const auto& step : observe(recording)) {
    shown.seen.emplace_back();
    for (const auto& input : step)
      if (const auto* rays = std::get_if<estimation::RayObservation>(&input)) shown.seen.back() = thinned(rays->rays, rest_tree, near_of(recording));
  }
  if (!trial.unused_surface.empty()) {
    const geometry::TriangleTree true_rest(trial.unused_surface.front());
    for (const TriMesh& true_surface : trial.unused_surface) shown.dent_m.push_back(dent_of(true_surface, true_rest));
  }
  shown.dent_m.resize(shown.seen.size());
  const Prepared one = as_one(given);
  const Course paper = course_of(recording, one, out.paper, {}, shown, options, shared.fine.unused),
               ours = course_of(recording, given, out.palpate, by_region, shown, options, shared.fine.unused),
               by_other = other != nullptr ? course_of(recording, *other, out.other, {}, shown, options, shared.other.unused) : Course{};
  const auto expectation = [](const Course& course, std::size_t s) {
    const auto found = course.at.find(s);
    return found == course.at.end() ? Expectation{no_number, no_number, no_number} : found->second;
  };
  for (std::size_t s = 0; s < recording.pushes[0].steps.size(); ++s) {
    if (!loaded(trial.unused.steps[s])) continue;
    out.unused.push_back({trial.unused_force_n[s], travel_of(trial.unused.steps[s]), expectation(paper, s), expectation(ours, s),
                          expectation(by_other, s), rms_to(rest, shown.seen[s], recording.free), rms_to(rest_tree, shown.dent_m[s])});
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
