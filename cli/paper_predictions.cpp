// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_predictions.hpp"

#include <cmath>
#include <limits>

#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/registration/icp.hpp"

namespace palpate::cli {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Answers for one step of a recording by solving it at an answer: travel of the tool and surface.
class Expected {
 public:
  Expected(const Recording& recording, const estimation::SimulatedObject& object, const estimation::FitOptions& options)
      : model_(recording, object, unknowns_, estimation::statics_options(recording, object, options)) {}
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

double rms_to(const TriMesh& surface, const estimation::TermInput& input) {
  const auto* seen = std::get_if<estimation::RayObservation>(&input);
  if (seen == nullptr || seen->rays.range_m.size() == 0) return nan;
  const geometry::TriangleTree tree(surface);
  double sum = 0;
  for (Index i = 0; i < static_cast<Index>(seen->rays.range_m.size()); ++i)
    sum += tree.closest(Vec3(seen->rays.origins_m.row(i)) + seen->rays.range_m(i) * Vec3(seen->rays.directions.row(i))).squared_distance_m2;
  return std::sqrt(sum / static_cast<double>(seen->rays.range_m.size()));
}

}  // namespace

void predict_unused(const Prepared& given, const lab::PaperTrial& trial, const std::vector<double>& by_region,
                    const estimation::FitOptions& options, TrialAnswer& out) {
  if (trial.unused.steps.empty() || !std::isfinite(out.paper.young_modulus_pa) || !std::isfinite(out.palpate.young_modulus_pa)) return;
  Recording recording = given.recording;
  recording.pushes = {trial.unused};
  estimation::Inputs inputs = observe(recording);
  const TriMesh& rest = given.object.surface.rest();
  const geometry::TriangleTree rest_tree(rest);
  Prepared without = as_one(given);
  without.recording.pushes = recording.pushes;
  Expected by_paper(without.recording, without.object, options), by_ours(recording, given.object, options);
  for (std::size_t s = 0; s < trial.unused.steps.size(); ++s) {
    if (!loaded(trial.unused.steps[s])) continue;
    const auto paper = by_paper(s, out.paper.young_modulus_pa, out.paper.poisson_ratio);
    const auto ours = by_ours(s, out.palpate.young_modulus_pa, out.palpate.poisson_ratio, by_region);
    if (!paper.converged || !ours.converged) continue;
    UnusedStep step;
    step.force_n = trial.unused_force_n[s];
    step.travel_m = step.surface_paper_m = step.surface_palpate_m = step.surface_still_m = nan;
    for (const auto& observation : trial.unused.steps[s].observations)
      if (const auto* travel = std::get_if<ToolTravel>(&observation)) step.travel_m = travel->travel_m;
    // The scenes' law is linear: force goes with travel.
    const Load& load = trial.unused.steps[s].loads[0];
    const double measured_n = load.force_n->dot(load.direction);
    step.force_paper_n = measured_n * step.travel_m / paper.travel_m(0);
    step.force_palpate_n = measured_n * step.travel_m / ours.travel_m(0);
    for (auto& input : inputs[s]) {
      auto* seen = std::get_if<estimation::RayObservation>(&input);
      if (seen == nullptr) continue;
      seen->rays = thinned(seen->rays, rest_tree);
      step.surface_paper_m = rms_to({paper.surface_m, rest.triangles}, input);
      step.surface_palpate_m = rms_to({ours.surface_m, rest.triangles}, input);
      step.surface_still_m = rms_to(rest, input);
    }
    out.unused.push_back(step);
  }
}

void add_pictures(const Prepared& given, const estimation::FitOptions& options, TrialAnswer& out) {
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
  Expected expected(given.recording, given.object, options);
  for (const double factor : {3.0, 2.0, 1.3, 1.0}) {
    RegistrationPicture picture;
    picture.young_modulus_pa = factor * out.young_modulus_pa;
    const auto at = expected(hardest, picture.young_modulus_pa, out.poisson_ratio);
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
