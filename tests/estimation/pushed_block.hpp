// SPDX-License-Identifier: Apache-2.0
// A clamped block pushed down at its free end, seen by a point cloud a step. Truth comes from a mesh twice as fine as the
// fit's, of quadratic elements, so that no error of the fit's own mesh hides.
#pragma once

#include <optional>
#include <random>

#include "palpate/estimation/fit.hpp"
#include "palpate/fem/boundary.hpp"
#include "scenes.hpp"

namespace palpate::estimation {

struct PushedBlock {
  double young_pa = 2e4, poisson = 0.3;
  double sigma_m = 5e-4;
  int points = 250;  ///< a step
  double outlier_share = 0;
  RigidOffset clamp;  ///< where the clamp really is
  unsigned seed = 7;
  std::string material = "neo_hookean";
  int finer = 2;         ///< than the fit's mesh
  double free_half = 1;  ///< stiffness of x > 30 mm over that of the rest
  std::optional<double> free_poisson;  ///< its nu; nothing: that of the rest
};

inline void put_two_halves(SimulatedObject& object) {
  for (Index e = 0; e < object.mesh.tetrahedra.rows(); ++e)
    object.region.push_back(fem::element_centre(object.mesh, e).x() > 0.03 ? 1 : 0);
  object.region_names = {"clamped half", "free half"};
}

inline Recording pushed_block_recording() {
  Recording recording;
  Support clamp;
  clamp.name = "clamp";
  clamp.kind = SupportKind::clamp;
  clamp.select = NodeSelection::plane;
  clamp.plane = {Vec3::Zero(), Vec3::UnitX()};
  clamp.tolerance_m = 1e-6;
  recording.supports = {clamp};
  Tool finger;
  finger.name = "finger";
  finger.shape = ToolShape::disc;
  finger.radius_m = 0.012;
  recording.tools = {finger};
  Push push;
  push.name = "down";
  for (double newton : {0.06, 0.12}) {
    Step step;
    Load load;
    load.tool = "finger";
    load.force_n = Vec3(0, 0, -newton);
    load.contact_m = Vec3(0.045, 0.02, 0.03);
    step.loads = {load};
    push.steps.push_back(step);
  }
  recording.pushes = {push};
  return recording;
}

/// The block on its large face, glued there and pressed from above, a step a force; all is stated as exactly known.
inline Recording glued_block_recording(const std::vector<Vec3>& forces_n, double x_m, double y_m) {
  Recording recording = pushed_block_recording();
  recording.supports[0].name = "glue";
  recording.supports[0].kind = SupportKind::plane;
  recording.supports[0].plane = {Vec3::Zero(), Vec3::UnitZ()};
  auto& steps = recording.pushes[0].steps;
  const Step like = steps.back();
  steps.clear();
  for (const Vec3& force_n : forces_n) {
    steps.push_back(like);
    steps.back().loads[0].force_n = force_n;
    steps.back().loads[0].contact_m = Vec3(x_m, y_m, block_size_m.z());
  }
  return recording;
}

inline SimulatedObject coarse_block(const std::string& material = "neo_hookean") {
  return simulated(fem::to_quadratic(kuhn_block(4, 3, 2, block_size_m)), material);
}

inline Inputs clouds_of(const PushedBlock& truth, Recording recording = pushed_block_recording()) {
  Unknowns unknowns;
  const bool halves = truth.free_half != 1 || truth.free_poisson;
  recording.model.poisson_by_region = truth.free_poisson.has_value();
  SimulatedObject object = simulated(fem::to_quadratic(kuhn_block(4 * truth.finer, 3 * truth.finer, 2 * truth.finer, block_size_m)), truth.material);
  if (halves) put_two_halves(object);
  ForwardModel model(recording, object, unknowns);
  VectorX at = unknowns.prior_mean();
  if (halves) at(first_ratio) = std::log(truth.free_half);
  if (truth.free_poisson) at(unknowns.first_own_poisson()) = *truth.free_poisson;
  at(log_young) = std::log(truth.young_pa);
  at(poisson) = truth.poisson;
  std::mt19937 random(truth.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  RigidOffset clamp = truth.clamp;
  clamp.pivot_m = Vec3(0, 0.5 * block_size_m.y(), 0.5 * block_size_m.z());

  Inputs inputs;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const Points surface_m = model.predict(s, at, false).surface_m;
    const Triangles& triangles = model.object().surface.rest().triangles;
    std::vector<double> areas;
    for (Index t = 0; t < triangles.rows(); ++t) {
      const Vec3 a = surface_m.row(triangles(t, 0)), b = surface_m.row(triangles(t, 1)), c = surface_m.row(triangles(t, 2));
      areas.push_back((b - a).cross(c - a).norm());
    }
    std::discrete_distribution<Index> pick(areas.begin(), areas.end());
    PointCloud cloud;
    cloud.points_m.resize(truth.points, 3);
    cloud.sigma_m = VectorX::Constant(1, truth.sigma_m);
    for (Index i = 0; i < truth.points; ++i) {
      const Index t = pick(random);
      double u = uniform(random), v = uniform(random);
      if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
      }
      const Vec3 on_surface = (1 - u - v) * surface_m.row(triangles(t, 0)).transpose() +
                              u * surface_m.row(triangles(t, 1)).transpose() +
                              v * surface_m.row(triangles(t, 2)).transpose();
      const Vec3 noise(normal(random), normal(random), normal(random));
      cloud.points_m.row(i) = clamp.apply(on_surface) + truth.sigma_m * noise;
      // Drawn for every point, so that clean and spoilt clouds share all their other points.
      const double spoil = uniform(random);
      const Vec3 astray(uniform(random), uniform(random), uniform(random));
      if (spoil < truth.outlier_share) cloud.points_m.row(i) += (0.01 + 0.04 * astray.array()).matrix().transpose();
    }
    inputs.push_back({cloud});
  }
  return inputs;
}

inline const Parameter& parameter(const Identification& answer, const std::string& name) {
  for (const auto& p : answer.parameters) {
    if (p.name == name) return p;
  }
  throw std::runtime_error("no parameter " + name);
}

inline bool says(const Identification& answer, const std::string& code) {
  return std::any_of(answer.verdicts.begin(), answer.verdicts.end(), [&](const Verdict& v) { return v.code == code; });
}

/// Leaves of every step's cloud what a sensor above the block sees.
inline void leave_the_top(Inputs& inputs) {
  for (auto& step : inputs) {
    auto& cloud = std::get<PointCloud>(step[0]);
    Index kept = 0;
    for (Index i = 0; i < cloud.points_m.rows(); ++i)
      if (cloud.points_m(i, 2) > 0.8 * block_size_m.z()) cloud.points_m.row(kept++) = cloud.points_m.row(i).eval();
    cloud.points_m.conservativeResize(kept, 3);
  }
}

}  // namespace palpate::estimation
