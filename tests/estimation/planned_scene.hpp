// SPDX-License-Identifier: Apache-2.0
// A soft block on a table, a camera beside it, and pushes that are planned and then really made: the truth is a mesh twice
// as fine as the plan's and the fit's.
#pragma once

#include <random>

#include "estimation/scenes.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/next_push.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/geometry/ray_subset.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {

inline const Vec3 soft_block_m(0.08, 0.08, 0.06);
constexpr double true_young_pa = 2e4, true_poisson = 0.3;

inline Recording block_on_table() {
  Recording recording;
  Support table;
  table.kind = SupportKind::plane;
  table.select = NodeSelection::plane;
  table.name = "table";
  table.tolerance_m = 1e-6;
  recording.supports = {table};
  Tool pad;
  pad.name = "pad";
  pad.shape = ToolShape::disc;
  pad.radius_m = 0.012;
  recording.tools = {pad};
  recording.force_scale_std = 0.01;
  recording.model.poisson_upper = 0.45;
  return recording;
}

inline SimulatedObject block_object(int refinement) {
  const TetMesh mesh = kuhn_block(5 * refinement, 5 * refinement, 4 * refinement, soft_block_m);
  return simulated(fem::to_quadratic(mesh), "linear");
}

inline void in_regions(SimulatedObject& object, const std::vector<Region>& regions) {
  object.region = fem::regions_of(object.mesh, regions);
  for (const Region& region : regions) object.region_names.push_back(region.name);
}

/// Rays of a camera at `eye_m` that meet the surface, a bundle of n x n over the block.
inline RayObservation look(const TriMesh& surface, const Vec3& eye_m, int n = 40, double sigma_m = 1e-3) {
  const geometry::TriangleTree tree(surface);
  const Vec3 forward = (Vec3(0.04, 0.04, 0.03) - eye_m).normalized();
  const Vec3 right = forward.cross(Vec3::UnitZ()).normalized(), up = right.cross(forward);
  RayObservation view;
  view.pose_std_m = 5e-4;
  view.pose_std_rad = 1e-3;
  std::vector<Vec3> directions;
  std::vector<double> ranges;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const Vec3 direction =
          (forward + 0.25 * ((i + 0.5) / n - 0.5) * right + 0.25 * ((j + 0.5) / n - 0.5) * up).normalized();
      const auto hit = tree.cast(eye_m, direction);
      if (!hit) continue;
      directions.push_back(direction);
      ranges.push_back(hit->range_m);
    }
  const Index count = static_cast<Index>(ranges.size());
  view.rays.origins_m.resize(count, 3);
  view.rays.directions.resize(count, 3);
  view.rays.range_m.resize(count);
  view.rays.sigma_m = VectorX::Constant(count, sigma_m);
  for (Index i = 0; i < count; ++i) {
    view.rays.origins_m.row(i) = eye_m.transpose();
    view.rays.directions.row(i) = directions[static_cast<std::size_t>(i)].transpose();
    view.rays.range_m(i) = ranges[static_cast<std::size_t>(i)];
  }
  return view;
}

/// Replaces the ranges by what a camera sees that really stands at `camera` (from where it is said to) of a body that has
/// moved by `moved_m`; rays that miss it are gone.
/// @param normal  standard normal numbers, one a hit
template <class Normal>
void measure(RayObservation& image, const geometry::TriangleTree& body, const RigidOffset& camera, const Vec3& moved_m,
             Normal normal) {
  std::vector<Index> keep;
  for (Index i = 0; i < image.rays.range_m.size(); ++i) {
    const Vec3 origin = camera.apply(image.rays.origins_m.row(i)) - moved_m;
    const auto hit = body.cast(origin, camera.rotation() * image.rays.directions.row(i).transpose());
    if (!hit) continue;
    image.rays.range_m(i) = hit->range_m + image.rays.sigma_m(i) * normal();
    keep.push_back(i);
  }
  image.rays = geometry::rays_at(image.rays, keep);
}

inline const Vec3 camera_eye_m(-0.25, -0.35, 0.4);

inline SensorPlan block_sensors(const TriMesh& surface) {
  SensorPlan sensors;
  sensors.views = {{"camera", look(surface, camera_eye_m)}};
  sensors.travel_sigma_m = 3e-4;
  sensors.travel_offset_std_m = 3e-4;
  sensors.force_std_n = 0.01;
  sensors.force_tare_std_n = 0.02;
  sensors.contact_std_m = 1e-3;
  sensors.levels = 3;
  return sensors;
}

/// Makes a planned push on the true object, with seeded errors of every sensor.
class MadePushes {
 public:
  explicit MadePushes(unsigned seed, int refinement = 2)
      : truth_(block_object(refinement)), random_(seed), recording_(block_on_table()) {}

  void make(const RatedPush& planned, const SensorPlan& sensors) {
    Recording truth = block_on_table();
    truth.force_scale_std = 0;
    truth.model.poisson_fixed = true_poisson;
    const Vec3 tare = sensors.force_tare_std_n * normal3();
    const double zero_m = sensors.travel_offset_std_m * normal_(random_);
    const auto across = std::array<Vec3, 2>{planned.candidate.direction.unitOrthogonal(),
                                            planned.candidate.direction.cross(planned.candidate.direction.unitOrthogonal())};
    const Vec3 shift = sensors.contact_std_m * (normal_(random_) * across[0] + normal_(random_) * across[1]);
    Push push;
    for (int level = 1; level <= planned.steps; ++level) {
      Load load;
      load.tool = "pad";
      load.force_n = planned.force_n * level / planned.steps * planned.candidate.direction;
      load.contact_m = planned.candidate.contact_m + shift;
      load.direction = planned.candidate.direction;
      push.steps.emplace_back().loads = {load};
    }
    truth.pushes = {push};
    Unknowns unknowns;
    ForwardModel model(truth, truth_, unknowns);
    VectorX at = unknowns.prior_mean();
    at(log_young) = std::log(true_young_pa);
    at(poisson) = true_poisson;

    Push measured;
    measured.name = "push " + std::to_string(recording_.pushes.size() + 1);
    measured.force_tare_std_n = sensors.force_tare_std_n;
    measured.travel_offset_std_m = sensors.travel_offset_std_m;
    const RayObservation view = without_stick_(std::get<RayObservation>(sensors.views[0].sees), planned.candidate);
    for (std::size_t s = 0; s < model.step_count(); ++s) {
      const StepPrediction seen = model.predict(s, at);
      Load load = push.steps[s].loads[0];
      load.contact_m = planned.candidate.contact_m;
      load.contact_std_m = sensors.contact_std_m;
      load.force_std_n = sensors.force_std_n;
      load.force_n = *load.force_n + tare + sensors.force_std_n * normal3();
      measured.steps.emplace_back().loads = {load};
      std::vector<TermInput> inputs;
      ToolTravel travel;
      travel.tool = "pad";
      travel.sigma_m = *sensors.travel_sigma_m;
      travel.travel_m = seen.travel_m(0) + zero_m + travel.sigma_m * normal_(random_);
      inputs.push_back(travel);
      RayObservation image = view;
      const RigidOffset camera{view.pose_std_m * normal3(), view.pose_std_rad * normal3(), Vec3(0.04, 0.04, 0.03)};
      const geometry::TriangleTree tree({seen.surface_m, truth_.surface.rest().triangles});
      measure(image, tree, camera, Vec3::Zero(), [&] { return normal_(random_); });
      inputs.push_back(image);
      inputs_.push_back(std::move(inputs));
    }
    recording_.pushes.push_back(measured);
  }

  Identification fitted() const {
    FitOptions options;
    options.cross_checks = false;
    options.young_start_pa = true_young_pa;
    return fit(recording_, block_object(1), inputs_, options);
  }
  const Recording& recording() const { return recording_; }
  const Inputs& inputs() const { return inputs_; }

 private:
  Vec3 normal3() {
    const double x = normal_(random_), y = normal_(random_), z = normal_(random_);
    return {x, y, z};
  }
  /// Rays that pass nearer to the stick than its radius are gone: written down anew, not by the plan's own code.
  static RayObservation without_stick_(const RayObservation& view, const PushCandidate& candidate) {
    std::vector<Index> keep;
    for (Index i = 0; i < view.rays.range_m.size(); ++i) {
      double nearest = 1e9;
      for (int k = 0; k <= 400; ++k) {
        const Vec3 on_ray = view.rays.origins_m.row(i) + view.rays.range_m(i) * k / 400.0 * view.rays.directions.row(i);
        const double behind = std::max(0.0, -(on_ray - candidate.contact_m).dot(candidate.direction));
        nearest = std::min(nearest, (on_ray - candidate.contact_m + behind * candidate.direction).norm());
      }
      if (nearest > 0.014) keep.push_back(i);
    }
    RayObservation out = view;
    out.rays = geometry::rays_at(view.rays, keep);
    return out;
  }

  SimulatedObject truth_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  Recording recording_;
  Inputs inputs_;
};

/// Places and directions that the block's scene allows.
inline std::vector<PushCandidate> block_candidates(int contacts, int tilts, std::map<std::string, int>* refused = nullptr) {
  const SimulatedObject object = block_object(1);
  CandidateOptions options;
  options.contacts = contacts;
  options.tilts = tilts;
  const Recording scene = block_on_table();
  return PushSpace(object.surface.rest(), scene, Points(0, 3), scene.tools[0], options).sample(refused);
}

}  // namespace palpate::estimation
