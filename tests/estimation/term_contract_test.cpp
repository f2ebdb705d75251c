// label: contract
// SPDX-License-Identifier: Apache-2.0
// What every measurement term promises: its jacobian is the derivative of its residual to every unknown there is, far from
// rest and with every nuisance off its prior mean. A new term joins with one line of `cases`.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "palpate/core/error.hpp"
#include "palpate/estimation/surface_quadratic.hpp"
#include "scenes.hpp"

namespace palpate::estimation::term_contract_test {
namespace {

/// Points a little off the surface of `predicted`, inside and outside, one a triangle (away from its edges).
Points points_near(const Points& surface_m, const Triangles& triangles, double off_m) {
  Points points(triangles.rows(), 3);
  for (Index t = 0; t < triangles.rows(); ++t) {
    const Vec3 a = surface_m.row(triangles(t, 0)), b = surface_m.row(triangles(t, 1)), c = surface_m.row(triangles(t, 2));
    const Vec3 normal = (b - a).cross(c - a).normalized();
    points.row(t) = 0.41 * a + 0.33 * b + 0.26 * c + (t % 2 == 0 ? off_m : -off_m) * normal;
  }
  return points;
}

struct Scene {
  const Points& surface_m;  ///< as predicted in the state that derivatives are checked at
  const Triangles& triangles;
};

TermInput cloud(const Scene& scene) {
  PointCloud cloud;
  cloud.points_m = points_near(scene.surface_m, scene.triangles, 4e-4);
  cloud.sigma_m = VectorX::Constant(1, 5e-4);
  cloud.pose_std_m = 1e-3;
  cloud.pose_std_rad = 0.01;
  return cloud;
}

/// One of several clouds of a camera.
TermInput cloud_of_a_camera(const Scene& scene) {
  PointCloud one = std::get<PointCloud>(cloud(scene));
  one.camera = "clouds 0";
  return one;
}

TermInput rays(const Scene& scene) {
  RayObservation observation;
  const Points points = points_near(scene.surface_m, scene.triangles, 6e-4);
  const Index count = static_cast<Index>(points.rows());
  const Vec3 eye(0.12, -0.21, 0.35);
  RayCloud& r = observation.rays;
  r.origins_m = eye.transpose().replicate(count, 1);
  r.directions = (points.rowwise() - eye.transpose()).rowwise().normalized();
  r.range_m = (points.rowwise() - eye.transpose()).rowwise().norm();
  r.sigma_m = VectorX::Constant(count, 8e-4);
  observation.pose_std_m = 1e-3;
  observation.pose_std_rad = 0.01;
  observation.bias_std_m = 5e-4;
  return observation;
}

/// Seen by two cameras at once, as one cloud of rays.
TermInput rays_of_two_eyes(const Scene& scene) {
  RayObservation observation = std::get<RayObservation>(rays(scene));
  RayCloud& r = observation.rays;
  for (Index i = 1; i < r.range_m.size(); i += 2) {
    const Vec3 point = r.origins_m.row(i) + r.range_m(i) * r.directions.row(i), eye(0.15, -0.18, 0.37);
    r.origins_m.row(i) = eye.transpose();
    r.range_m(i) = (point - eye).norm();
    r.directions.row(i) = (point - eye).normalized().transpose();
  }
  return observation;
}

/// Four times the usual light spread in the lens, of a picture that ends half a metre behind the object.
TermInput rays_in_scattered_light(const Scene& scene) {
  RayObservation observation = std::get<RayObservation>(rays(scene));
  observation.scatter = LensScatter{0.04, std::polar(1.4, LensScatter::phase_per_m * 0.9)};
  return observation;
}

/// One of several frames of a camera.
TermInput rays_of_a_camera(const Scene& scene) {
  RayObservation observation = std::get<RayObservation>(rays(scene));
  observation.camera = "0";
  observation.R_base_camera = Eigen::AngleAxisd(2.1, Vec3(0.48, -0.6, 0.64)).toRotationMatrix();
  return observation;
}

TermInput markers(const Scene&) {
  Markers markers;
  markers.names = {"a", "b", "hidden"};
  markers.rest_m.resize(3, 3);
  markers.rest_m << 0.051, 0.019, 0.034, 0.031, -0.006, 0.014, 0.02, 0.02, 0.03;  // two stand off the surface
  markers.observed_m = markers.rest_m.array() + 0.003;
  markers.observed_m.row(2).setConstant(std::nan(""));
  markers.sigma_m = 3e-4;
  markers.rest_std_m = 5e-4;
  return markers;
}

TermInput travel(const Scene&) { return ToolTravel{"tip", 0.004, 2e-4}; }

TermInput travel_of_disc(const Scene&) { return ToolTravel{"disc", 0.004, 2e-4}; }

TermInput wrench(const Scene&) {
  Wrench wrench;
  wrench.force_n = Vec3(0.1, -0.2, -1.5);
  wrench.force_sigma_n = 0.05;
  return wrench;
}

TermInput single_axis_wrench(const Scene& scene) {
  Wrench one = std::get<Wrench>(wrench(scene));
  one.along = Vec3(0, 0.6, -0.8);
  return one;
}

TermInput torque(const Scene& scene) {
  Wrench one = std::get<Wrench>(wrench(scene));
  one.tool = "disc";
  one.torque_nm = Vec3(2e-3, -1e-3, 5e-4);
  one.torque_sigma_nm = 2e-4;
  one.has_torque = true;
  return one;
}

/// What a sensor says is one thing; where its recording says that the sensor errs is another.
void put(const TermInput& input, Recording& recording) {
  const auto* reading = std::get_if<Wrench>(&input);
  if (reading == nullptr) return;
  Push& push = recording.pushes[reading->has_torque ? 2 : 1];
  push.steps[0].observations.push_back(*reading);
  if (!reading->has_torque) return;
  push.torque_tare_std_nm = 1e-3;
  push.tip_std_m = 1e-3;
  push.force_tare_std_n = 0.01;
  push.steps[0].loads[0].force_std_n = 0.01;
}

struct Case {
  const char* name;
  TermInput (*make)(const Scene&);
  std::size_t step;  ///< of clamped_block: 0 tip, 1 unloaded, 2 plate, 3 disc
  bool along_rays;
  bool weight = true;
};

const std::vector<Case> cases{
    {"rays_tip", rays, 0, true},
    {"rays_as_points_tip", rays, 0, false},
    {"rays_plate", rays, 2, true},
    {"rays_of_two_eyes_tip", rays_of_two_eyes, 0, true},
    {"rays_of_a_camera_tip", rays_of_a_camera, 0, true},
    {"rays_of_a_camera_as_points_plate", rays_of_a_camera, 2, false},
    {"rays_in_scattered_light_tip", rays_in_scattered_light, 0, true},
    {"rays_in_scattered_light_plate", rays_in_scattered_light, 2, true},
    {"cloud_tip", cloud, 0, true},
    {"cloud_plate", cloud, 2, true},
    {"cloud_unloaded", cloud, 1, true, false},
    {"cloud_of_a_camera_disc", cloud_of_a_camera, 3, true},
    {"rays_disc", rays, 3, true},
    {"travel_disc", travel_of_disc, 3, true},
    {"markers_tip", markers, 0, true},
    {"markers_plate", markers, 2, true},
    {"travel_tip", travel, 0, true},
    {"wrench_plate", wrench, 2, true},
    {"single_axis_wrench_plate", single_axis_wrench, 2, true},
    {"torque_disc", torque, 3, true},
    {"cloud_plate_weightless", cloud, 2, true, false},
};

class TermContract : public testing::TestWithParam<std::tuple<Case, const char*>> {};

TEST_P(TermContract, JacobianIsTheDerivativeOfTheResidual) {
  const auto& [test, material] = GetParam();
  const TetMesh mesh = kuhn_block(3, 2, 2, block_size_m);
  Recording recording = clamped_block(mesh, test.weight);
  const SimulatedObject object = simulated(mesh, material);

  // The observation is made around the state that the derivatives are checked at.
  TermInput input;
  {
    Unknowns unknowns;
    ForwardModel model(recording, object, unknowns, tight());
    const StepPrediction predicted = model.predict(test.step, away_from_rest(unknowns));
    ASSERT_TRUE(predicted.converged) << predicted.reason;
    ASSERT_GT((predicted.surface_m - object.surface.rest().vertices_m).cwiseAbs().maxCoeff(), 1e-3);
    input = test.make({predicted.surface_m, object.surface.rest().triangles});
  }
  put(input, recording);

  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns, tight());
  std::map<std::string, int> shared;
  const auto term = make_term(input, {model, test.step, unknowns, shared});
  ASSERT_NE(term, nullptr);
  const VectorX at = away_from_rest(unknowns);
  const TermRows rows = term->rows(model.predict(test.step, at), at, {test.along_rays});

  ASSERT_EQ(rows.jacobian.rows(), rows.residual.size());
  ASSERT_EQ(rows.jacobian.cols(), static_cast<Index>(rows.unknowns.size()));
  ASSERT_EQ(rows.sigma.size(), rows.residual.size());
  ASSERT_TRUE(rows.jacobian.allFinite());
  std::size_t compared = 0;
  for (int k = 0; k < unknowns.size(); ++k) {
    VectorX claimed = VectorX::Zero(rows.residual.size());
    for (std::size_t c = 0; c < rows.unknowns.size(); ++c) {
      if (rows.unknowns[c] == k) claimed += rows.jacobian.col(static_cast<Index>(c));
    }
    const double h = difference_of(unknowns, k);
    const auto residual_at = [&](double away) {
      VectorX there = at;
      there(k) += away;
      return VectorX(term->rows(model.predict(test.step, there), there, {test.along_rays}).residual);
    };
    const VectorX above = residual_at(h), below = residual_at(-h), half_above = residual_at(0.5 * h), half_below = residual_at(-0.5 * h);
    // One scale for all rows of an unknown, but never smaller than what would matter to the fit: a thousandth of sigma when
    // the unknown moves by its prior's standard deviation.
    VectorX measured(rows.residual.size());
    for (Index i = 0; i < measured.size(); ++i) {
      bool seen = std::isfinite(rows.residual(i)) && std::isfinite(above(i)) && std::isfinite(below(i));
      // Where the closest triangle changes between the two differences there is no derivative to compare with.
      const double left = rows.residual(i) - below(i), right = above(i) - rows.residual(i);
      seen = seen && std::abs(right - left) < 0.01 * (std::abs(right) + std::abs(left)) + 1e-6;
      // Richardson's extrapolation: near a silhouette a residual bends within h.
      const double whole = (above(i) - below(i)) / (2 * h), half = (half_above(i) - half_below(i)) / h;
      seen = seen && std::isfinite(half);
      measured(i) = seen ? (4 * half - whole) / 3 : claimed(i);
      compared += seen;
    }
    const double matters = 1e-3 / (k <= poisson ? 1 : unknowns[k].prior_std);
    const double scale = std::max(measured.cwiseAbs().maxCoeff(), matters);
    EXPECT_LT((claimed - measured).cwiseAbs().maxCoeff(), 2e-4 * scale)
        << unknowns[k].name << ": claimed " << claimed.transpose().head(std::min<Index>(3, claimed.size())) << ", measured "
        << measured.transpose().head(std::min<Index>(3, claimed.size()));
  }
  // Rays that pass by have no residual; most must hit for this to say anything.
  EXPECT_GT(compared, static_cast<std::size_t>(unknowns.size() * rows.residual.size()) * 4 / 5);
}

TEST_P(TermContract, ItsRowsAsAQuadraticOfTheSurfaceSayTheSame) {
  const auto& [test, material] = GetParam();
  const TetMesh mesh = kuhn_block(3, 2, 2, block_size_m);
  Recording recording = clamped_block(mesh, test.weight);
  const SimulatedObject object = simulated(mesh, material);
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns, tight());
  const Points surface_m = model.predict(test.step, away_from_rest(unknowns)).surface_m;
  const TermInput input = test.make({surface_m, object.surface.rest().triangles});
  const bool sees_surface = std::holds_alternative<RayObservation>(input) || std::holds_alternative<PointCloud>(input);
  put(input, recording);
  std::map<std::string, int> shared;
  const auto term = make_term(input, {model, test.step, unknowns, shared});
  const VectorX at = away_from_rest(unknowns);
  const StepPrediction predicted = model.predict(test.step, at);
  const TermRows rows = term->rows(predicted, at, {test.along_rays, nullptr, true});
  const std::size_t said = rows.facets ? rows.facets->facet.size() : rows.surface.size();
  ASSERT_EQ(said, sees_surface ? static_cast<std::size_t>(rows.residual.size()) : 0u);
  if (!sees_surface) return;

  const Loss loss;
  const auto dense_at = [&](const VectorX& place) {
    Evaluation out = Evaluation::nothing(unknowns.size());
    const TermRows there = term->rows(model.predict(test.step, place), place, {test.along_rays});
    add_rows(there, loss, there.unknowns, out);
    return out;
  };
  const SurfacePattern pattern(object.surface.rest());
  SurfaceQuadratic quadratic(pattern, rows, loss, predicted, at);
  const auto quadratic_at = [&](const VectorX& place) {
    const StepPrediction there = model.predict(test.step, place);
    std::vector<int> places = there.columns;
    places.insert(places.end(), quadratic.own().begin(), quadratic.own().end());
    Evaluation out = Evaluation::nothing(unknowns.size());
    quadratic.add_to(there, place, places, out);
    return out;
  };

  // Where it was made it is the rows' own sum; the light that spreads in the lens does not see that a clamp turns the rest
  // surface's error with it.
  const Evaluation here = quadratic_at(at), dense = dense_at(at);
  const VectorX scale = dense.hessian.diagonal().cwiseSqrt().cwiseMax(1e-12);
  const MatrixX off = scale.cwiseInverse().asDiagonal() * (here.hessian - dense.hessian) * scale.cwiseInverse().asDiagonal();
  const double same = std::holds_alternative<RayObservation>(input) && std::get<RayObservation>(input).scatter ? 0.02 : 1e-9;
  EXPECT_NEAR(here.robust_cost, dense.robust_cost, 1e-9 * dense.robust_cost);
  EXPECT_LT(off.cwiseAbs().maxCoeff(), same);
  EXPECT_LT((here.gradient - dense.gradient).cwiseQuotient(scale).cwiseAbs().maxCoeff(), same * std::sqrt(double(rows.residual.size())));
  EXPECT_EQ(quadratic.moved_m(predicted, at, unknowns), 0);

  // Aside its slope is the derivative of its cost.
  VectorX way(unknowns.size());
  for (int k = 0; k < unknowns.size(); ++k) way(k) = (k % 2 == 0 ? 0.01 : -0.01) * (k <= poisson ? 1 : unknowns[k].prior_std);
  const VectorX aside = at + way;
  constexpr double h = 1e-3;
  const double rise = (quadratic_at(aside + h * way).robust_cost - quadratic_at(aside - h * way).robust_cost) / (2 * h);
  EXPECT_NEAR(rise, quadratic_at(aside).gradient.dot(way), 1e-3 * quadratic_at(aside).gradient.cwiseProduct(way).cwiseAbs().sum());
  EXPECT_LT(here.curvature.trace(), here.hessian.trace());
  EXPECT_GT(quadratic.moved_m(model.predict(test.step, aside), aside, unknowns), 0);
}

INSTANTIATE_TEST_SUITE_P(Every, TermContract,
                         testing::Combine(testing::ValuesIn(cases), testing::Values("neo_hookean", "linear")),
                         [](const auto& which) {
                           return std::string(std::get<0>(which.param).name) + "_" + std::get<1>(which.param);
                         });

}  // namespace
}  // namespace palpate::estimation::term_contract_test
