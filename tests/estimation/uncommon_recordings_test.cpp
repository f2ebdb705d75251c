// label: unit
// SPDX-License-Identifier: Apache-2.0
// Recordings that are allowed and rare: pushes that met nothing, markers without names, views from the side, callers that stop.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimation/pushed_block.hpp"
#include "palpate/core/error.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"

namespace palpate::estimation::uncommon_recordings_test {
namespace {

using testing::HasSubstr;

constexpr double young_pa = 2e4;

Recording block_with_clouds(const std::string& material) {
  Recording recording = pushed_block_recording();
  PushedBlock truth;
  truth.finer = 1;
  truth.points = 200;
  truth.material = material;
  const Inputs clouds = clouds_of(truth, recording);
  for (std::size_t s = 0; s < clouds.size(); ++s) {
    recording.pushes[0].steps[s].time_s = static_cast<double>(s);
    recording.pushes[0].steps[s].observations = {std::get<PointCloud>(clouds[s][0])};
  }
  recording.rest.volume = kuhn_block(4, 3, 2, block_size_m);
  recording.model.material = material;
  recording.model.refine = "none";
  recording.model.element = "tet10";
  return recording;
}

std::string complaint(const Recording& recording, const IdentifyOptions& options = {}) {
  try {
    identify(recording, options);
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing";
}

/// What a depth camera's clouds hold beside the object: the stick, a table 2 cm below and a wall behind, most of the points.
void put_in_a_room(Recording& recording) {
  recording.environment.planes = {Plane{Vec3(0, 0, -0.02), Vec3::UnitZ()}};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(-1, 1);
  std::normal_distribution<double> normal;
  for (Step& step : recording.pushes[0].steps) {
    PointCloud& cloud = std::get<PointCloud>(step.observations[0]);
    const Index object = cloud.points_m.rows(), more = 5000;
    const Vec3 contact_m = step.loads[0].contact_m;
    cloud.points_m.conservativeResize(object + 3 * more, 3);
    for (Index i = 0; i < more; ++i) {
      cloud.points_m.row(object + i) << 0.3 * share(random), 0.3 * share(random), -0.02 + cloud.sigma_m(0) * normal(random);
      cloud.points_m.row(object + more + i) << 1.5, share(random), share(random);
      const double turned = M_PI * share(random), up_m = 0.052 + 0.045 * share(random);
      cloud.points_m.row(object + 2 * more + i) = contact_m + Vec3(0.012 * std::cos(turned), 0.012 * std::sin(turned), up_m);
    }
  }
}

TEST(UncommonRecordings, CloudsMayHoldTheRoom) {
  Recording recording = block_with_clouds("linear");
  for (Step& step : recording.pushes[0].steps) step.T_base_tip = Pose(Eigen::Translation3d(step.loads[0].contact_m));
  const Identified alone = identify(recording);
  put_in_a_room(recording);
  const Identified in_a_room = identify(recording);
  EXPECT_EQ(in_a_room.answer.parameters[0].value, alone.answer.parameters[0].value);
  EXPECT_EQ(in_a_room.answer.parameters[0].lower_95, alone.answer.parameters[0].lower_95);

  std::get<PointCloud>(recording.pushes[0].steps[1].observations[0]).points_m.col(2).array() += 3;
  EXPECT_THAT(complaint(recording), AllOf(HasSubstr("cloud"), HasSubstr("shows the object")));
}

TEST(UncommonRecordings, NoPushIsRefusedForEveryLaw) {
  for (const char* material : {"linear", "neo_hookean"}) {
    Recording recording = block_with_clouds("linear");
    recording.model.material = material;
    recording.pushes.clear();
    EXPECT_THAT(complaint(recording), AllOf(HasSubstr("pushes"), HasSubstr("no step"))) << material;
  }
}

TEST(UncommonRecordings, NothingPressedIsRefusedForEveryLawAndMethod) {
  for (const char* material : {"linear", "neo_hookean"}) {
    for (const char* method : {"palpate", "paper"}) {
      for (const bool touched : {true, false}) {
        Recording recording = block_with_clouds("linear");
        recording.model.material = material;
        for (Step& step : recording.pushes[0].steps) {
          if (touched) step.loads[0].force_n = Vec3::Zero();
          else step.loads.clear();
        }
        IdentifyOptions options;
        options.method = method;
        EXPECT_THAT(complaint(recording, options), AllOf(HasSubstr("pushes.steps.loads"), HasSubstr("force_n"))) << material << ", " << method;
      }
    }
  }
}

TEST(UncommonRecordings, APushThatMetNothingChangesNothing) {
  Recording recording = block_with_clouds("linear");
  Push second = recording.pushes[0];
  second.name = "again";
  recording.pushes.push_back(second);
  const Identification plain = identify(recording).answer;
  Push nothing;
  nothing.name = "nothing met";
  recording.pushes.insert(recording.pushes.begin(), nothing);
  recording.pushes.insert(recording.pushes.begin() + 2, nothing);
  recording.pushes[2].name = "nor here";
  const Identification same = identify(recording).answer;
  EXPECT_EQ(same.parameters.at(0).value, plain.parameters.at(0).value);
  EXPECT_EQ(same.per_push.size(), 2u);
  EXPECT_EQ(same.prediction.surface_rms_m, plain.prediction.surface_rms_m);
}

TEST(UncommonRecordings, MarkersWithoutNamesAreToldByTheirPlace) {
  Recording recording = block_with_clouds("linear");
  const auto markers = [](int count) {
    Markers seen;
    seen.sigma_m = seen.rest_std_m = 1e-3;
    seen.rest_m.resize(count, 3);
    for (int i = 0; i < count; ++i) seen.rest_m.row(i) << 0.05, 0.01 * (i + 1), 0.03;
    seen.observed_m = seen.rest_m;
    return seen;
  };
  recording.pushes[0].steps[0].observations = {markers(1)};
  recording.pushes[0].steps[1].observations = {markers(3)};
  const Identification answer = identify(recording).answer;
  const auto of_markers = std::count_if(answer.nuisances.begin(), answer.nuisances.end(),
                                        [](const Nuisance& one) { return one.name.rfind("marker_", 0) == 0; });
  EXPECT_EQ(of_markers, 9) << "the first of the three is the one of the step before";
}

TEST(UncommonRecordings, ANodeOfNoElementNeedsNoSupport) {
  Recording recording = block_with_clouds("linear");
  const double plain = identify(recording).answer.parameters.at(0).value;
  Points& nodes = recording.rest.volume->nodes_m;
  nodes.conservativeResize(nodes.rows() + 1, 3);
  nodes.bottomRows<1>() << 0.03, 0.02, 0.015;
  EXPECT_NEAR(identify(recording).answer.parameters.at(0).value, plain, 1e-6 * plain);
}

/// The patch under a contact beside the surface would be a smaller one.
TEST(UncommonRecordings, AContactOffTheSurfaceIsPutThere) {
  Recording recording = block_with_clouds("linear");
  const Identification right = identify(recording).answer;
  const auto raised = [&](double z_m) {
    Recording off = recording;
    for (Step& step : off.pushes[0].steps) step.loads[0].contact_m.z() += z_m;
    return off;
  };
  const auto says = [](const Identification& answer) {
    return std::any_of(answer.verdicts.begin(), answer.verdicts.end(), [](const Verdict& one) { return one.code == "contact_off_surface"; });
  };
  EXPECT_FALSE(says(right));
  for (const double z_m : {8e-3, -8e-3}) {
    const Identification moved = identify(raised(z_m)).answer;
    EXPECT_TRUE(says(moved)) << z_m;
    EXPECT_NEAR(moved.parameters.at(0).value, right.parameters.at(0).value, 1e-6 * right.parameters.at(0).value) << z_m;
  }
  Recording far = raised(13e-3);
  far.pushes[0].steps[0].source = "recording.yaml:7";
  EXPECT_THAT(complaint(far), AllOf(HasSubstr("recording.yaml:7"), HasSubstr("contact_m"), HasSubstr("13 mm"), HasSubstr("finger")));
}

TEST(UncommonRecordings, AnUnknownMethodIsRefused) {
  IdentifyOptions options;
  options.method = "papre";
  EXPECT_THAT(complaint(block_with_clouds("linear"), options), AllOf(HasSubstr("papre"), HasSubstr("paper")));
}

TEST(UncommonRecordings, ThePapersMethodTakesAKnownRatioAsItIs) {
  IdentifyOptions options;
  options.method = "paper";
  options.poisson_range = std::pair{0.2, 0.4};
  options.poisson_fixed = 0.1;
  options.fit.max_iterations = 2;
  EXPECT_EQ(identify(block_with_clouds("linear"), options).answer.parameters.at(1).value, 0.1);
}

/// Who stops a fit hears that he did, not that there is no equilibrium; what was found so far is told once there is an optimum.
TEST(UncommonRecordings, ACallerWhoStopsIsToldSo) {
  const Recording recording = block_with_clouds("linear");
  int all = 0;
  identify(recording, {}, [&](std::string_view, double) { return ++all > 0; });
  std::size_t with_values = 0;
  for (int last = 1; last < all; last += std::max(1, all / 15)) {
    int calls = 0;
    const Identification answer = identify(recording, {}, [&](std::string_view, double) { return ++calls < last; }).answer;
    EXPECT_EQ(answer.termination, Termination::cancelled) << last;
    EXPECT_THAT(answer.verdicts, testing::Not(testing::Contains(testing::Field(&Verdict::code, "not_converged")))) << last;
    with_values += answer.parameters.empty() ? 0 : 1;
  }
  EXPECT_GT(with_values, 3u);
}

/// A mesh that is stopped at is poor: going on with it, and with all that is tried to mend it, took longer than not to stop.
TEST(UncommonRecordings, WhoStopsWhileTheObjectIsFilledWaitsForNoFit) {
  Recording recording = block_with_clouds("linear");
  recording.rest.surface = geometry::boundary_surface(*recording.rest.volume).surface;
  recording.rest.volume.reset();
  recording.supports[0].kind = SupportKind::plane;
  recording.supports[0].plane = {Vec3::Zero(), Vec3::UnitZ()};
  for (const std::string_view at : {"lattice", "quality"}) {
    bool stopped = false;
    int later = 0;
    const Identified found = identify(recording, {}, [&](std::string_view stage, double) {
      later += stopped && stage != at && stage != "quality" ? 1 : 0;
      stopped = stopped || stage == at;
      return !stopped;
    });
    EXPECT_TRUE(stopped);
    EXPECT_EQ(found.answer.termination, Termination::cancelled);
    EXPECT_TRUE(found.answer.parameters.empty());
    EXPECT_EQ(later, 0) << at;
  }
}

/// The block from low above the table: many rays graze its top. What the fit leaves out itself is no outlier.
TEST(UncommonRecordings, RaysThatGrazeTheSurfaceAreNoOutliers) {
  Recording recording = pushed_block_recording();
  recording.model.material = "linear";
  const SimulatedObject object = coarse_block("linear");
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns);
  VectorX truth = unknowns.prior_mean();
  truth(log_young) = std::log(young_pa);
  truth(poisson) = 0.3;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  constexpr double sigma_m = 5e-4, elevation = 12 * EIGEN_PI / 180;
  Inputs inputs;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    TriMesh surface = model.object().surface.rest();
    surface.vertices_m = model.predict(s, truth).surface_m;
    const geometry::TriangleTree tree(surface);
    const Vec3 middle(0.03, 0.02, 0.015), eye = middle + 0.5 * Vec3(0, -std::cos(elevation), std::sin(elevation));
    const Vec3 z = (middle - eye).normalized(), x = z.cross(Vec3::UnitZ()).normalized(), y = z.cross(x);
    std::vector<Vec3> directions;
    std::vector<double> ranges;
    for (double a = -0.09; a < 0.09; a += 0.0015) {
      for (double b = -0.06; b < 0.06; b += 0.0015) {
        const Vec3 direction = (z + a * x + b * y).normalized();
        const auto hit = tree.cast(eye, direction);
        if (!hit) continue;
        directions.push_back(direction);
        ranges.push_back(hit->range_m + sigma_m * normal(random));
      }
    }
    RayObservation seen;
    const auto count = static_cast<Index>(directions.size());
    seen.rays.origins_m = eye.transpose().replicate(count, 1);
    seen.rays.directions.resize(count, 3);
    seen.rays.range_m = Eigen::Map<const VectorX>(ranges.data(), count);
    seen.rays.sigma_m = VectorX::Constant(count, sigma_m);
    for (Index i = 0; i < count; ++i) seen.rays.directions.row(i) = directions[static_cast<std::size_t>(i)];
    inputs.push_back({seen});
  }
  FitOptions options;
  options.stresses = options.cross_checks = false;
  const Identification answer = fit(recording, object, inputs, options);
  EXPECT_THAT(answer.verdicts, testing::Not(testing::Contains(testing::Field(&Verdict::code, "many_outliers"))));
  EXPECT_LT(std::abs(answer.parameters.at(0).value - young_pa), 4 * answer.parameters.at(0).std);

  Unknowns again;
  ForwardModel anew(recording, object, again);
  Objective objective(anew, inputs, again);
  const Optimum optimum = optimise_annealed(objective, find_start(objective, 0.3), Loss{}, {}, {});
  EXPECT_NEAR(objective.residual_scale(), 1, 0.05);
  EXPECT_LT(objective.summarise(optimum.loss).outliers, 0.02 * static_cast<double>(objective.summarise(optimum.loss).points));
}

/// The search for a start looks at steps in which something was seen, and at markers beside an uncertain surface too.
TEST(UncommonRecordings, AStartIsFoundWhateverWasSeen) {
  enum { beside_a_field, in_every_other_step, at_full_load };
  for (const int seen_how : {beside_a_field, in_every_other_step, at_full_load}) {
    Recording recording = pushed_block_recording();
    recording.model.material = seen_how == at_full_load ? "neo_hookean" : "linear";
    if (seen_how == beside_a_field) {
      recording.rest.surface_std_m = 3e-4;
      recording.rest.surface_correlation_m = 0.03;
    } else {
      auto& steps = recording.pushes[0].steps;
      const Step like = steps[1];
      const int count = seen_how == in_every_other_step ? 48 : 6;
      steps.assign(static_cast<std::size_t>(count), like);
      for (int k = 0; k < count; ++k) steps[static_cast<std::size_t>(k)].loads[0].force_n = Vec3(0, 0, -0.12 * (k + 1) / count);
    }
    const SimulatedObject object = coarse_block(recording.model.material);
    Unknowns unknowns;
    ForwardModel model(recording, object, unknowns);
    VectorX truth = unknowns.prior_mean();
    truth(log_young) = std::log(young_pa);
    truth(poisson) = 0.3;
    Inputs inputs(model.step_count());
    for (std::size_t s = 0; s < model.step_count(); ++s) {
      if (seen_how == in_every_other_step && s % 2 == 0) continue;
      if (seen_how == at_full_load && s + 1 != model.step_count()) continue;
      Markers markers;
      markers.sigma_m = 2e-4;
      markers.rest_m = object.surface.rest().vertices_m;
      markers.observed_m = model.predict(s, truth, false).surface_m;
      inputs[s] = {markers};
    }
    Unknowns again;
    ForwardModel anew(recording, object, again);
    Objective objective(anew, inputs, again);
    EXPECT_LT(std::abs(find_start(objective, 0.3)(log_young) - std::log(young_pa)), 0.5) << seen_how;
  }
}

}  // namespace
}  // namespace palpate::estimation::uncommon_recordings_test
