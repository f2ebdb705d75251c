// label: unit
// SPDX-License-Identifier: Apache-2.0
// A rig with known errors pushes a spring and a rigid block; the check has to find the errors within its own intervals.
#include "palpate/estimation/self_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "palpate/core/error.hpp"
#include "planned_scene.hpp"

namespace palpate::estimation::self_check_test {
namespace {

struct Rig {
  double force_scale = 0, compliance_m_per_n = 0;
  RigidOffset camera;            ///< where it stands, from where it is said to stand
  double stiffness_n_per_m = 0;  ///< 0: rigid
  bool images = true;
  unsigned seed = 1;
  double tare_std_n = 0.02;  ///< stated, and drawn from
};

constexpr double stated_scale_std = 0.01, stated_pose_std_m = 5e-4, stated_pose_std_rad = 1e-3;

struct Measured {
  Recording recording;
  Inputs inputs;
  TriMesh body;
};

/// Four pushes on three faces of a block; the camera looks at these faces.
Measured measured(const Rig& rig) {
  std::mt19937 random(rig.seed);
  std::normal_distribution<double> normal;
  Measured out;
  out.body = block_object(1).surface.rest();
  const geometry::TriangleTree still(out.body);
  Tool pad;
  pad.name = "pad";
  pad.shape = ToolShape::disc;
  pad.radius_m = 0.012;
  out.recording.tools = {pad};
  out.recording.force_scale_std = stated_scale_std;
  const RayObservation stated = look(out.body, camera_eye_m, 24);
  RigidOffset camera = rig.camera;
  camera.pivot_m = Vec3(out.body.vertices_m.colwise().mean().transpose());  // as the answer is given
  const std::vector<std::pair<Vec3, Vec3>> places{{{0.04, 0.04, 0.06}, {0, 0, -1}},
                                                  {{0.06, 0.03, 0.06}, {0, 0, -1}},
                                                  {{0, 0.05, 0.04}, {1, 0, 0}},
                                                  {{0.03, 0, 0.04}, {0, 1, 0}}};
  for (std::size_t k = 0; k < places.size(); ++k) {
    const auto& [contact, direction] = places[k];
    Push push;
    push.name = "push " + std::to_string(k + 1);
    push.force_tare_std_n = rig.tare_std_n;
    push.travel_offset_std_m = 3e-4;
    const double tare = push.force_tare_std_n * normal(random), zero = push.travel_offset_std_m * normal(random);
    for (const double force : {0.0, 5.0, 10.0, 20.0}) {
      Step& step = push.steps.emplace_back();
      const double give_m = rig.stiffness_n_per_m > 0 ? force / rig.stiffness_n_per_m : 0;
      if (force > 0) {
        Load load;
        load.tool = "pad";
        load.direction = direction;
        load.contact_m = contact + 3e-4 * normal(random) * direction;
        load.force_std_n = 0.01;
        load.force_n = (force * (1 + rig.force_scale) + tare + load.force_std_n * normal(random)) * direction;
        step.loads = {load};
        ToolTravel travel;
        travel.tool = "pad";
        travel.sigma_m = 1e-4;
        travel.travel_m = give_m + force * rig.compliance_m_per_n + zero + travel.sigma_m * normal(random);
        step.observations = {travel};
      }
      auto& terms = out.inputs.emplace_back();
      if (!rig.images) continue;
      RayObservation image = stated;
      image.pose_std_m = stated_pose_std_m;
      image.pose_std_rad = stated_pose_std_rad;
      measure(image, still, camera, give_m * direction, [&] { return normal(random); });
      terms.push_back(image);
    }
    out.recording.pushes.push_back(push);
  }
  return out;
}

SelfCheck checked(const Rig& rig) {
  const Measured rigged = measured(rig);
  SelfCheckOptions options;
  if (rig.stiffness_n_per_m > 0) options.stiffness_n_per_m = rig.stiffness_n_per_m;
  return self_check(rigged.recording, rigged.body, rigged.inputs, options);
}

const CheckedError& error_named(const SelfCheck& check, const std::string& name) {
  for (const auto& error : check.errors)
    if (error.name == name) return error;
  throw std::runtime_error("no error " + name);
}

bool says(const SelfCheck& check, const std::string& code) {
  return std::any_of(check.verdicts.begin(), check.verdicts.end(), [&](const Verdict& v) { return v.code == code; });
}

Rig bad_rig() {
  Rig rig;
  rig.force_scale = 0.06;
  rig.compliance_m_per_n = 1.5e-4;
  rig.camera.translation_m = Vec3(0.004, -0.003, 0.005);
  rig.camera.rotation_rad = Vec3(0.01, -0.015, 0.008);
  return rig;
}

void expect_found(const SelfCheck& check, const Rig& rig, bool scale) {
  const auto found = [&](const std::string& name, double truth) {
    const CheckedError& error = error_named(check, name);
    EXPECT_LT(std::abs(error.value - truth), 3 * error.std) << name << " " << error.value << " +- " << error.std;
    EXPECT_TRUE(error.determined) << name;
    EXPECT_FALSE(error.consistent) << name << " " << error.value << " +- " << error.std;
  };
  if (scale) found("force_scale", rig.force_scale);
  found("compliance", rig.compliance_m_per_n);
  for (int d = 0; d < 3; ++d) {
    const std::string axis(1, static_cast<char>('x' + d));
    found("hand_eye_" + axis, rig.camera.translation_m(d));
    found("hand_eye_rotation_" + axis, rig.camera.rotation_rad(d));
  }
}

TEST(SelfCheck, SpringFindsScaleComplianceAndCamera) {
  Rig rig = bad_rig();
  rig.stiffness_n_per_m = 800;
  const SelfCheck check = checked(rig);
  ASSERT_TRUE(check.converged);
  expect_found(check, rig, true);
  EXPECT_LT(error_named(check, "force_scale").std, 0.01);
  EXPECT_TRUE(says(check, "force_scale_off"));
  EXPECT_TRUE(says(check, "compliance_off"));
  EXPECT_TRUE(says(check, "hand_eye_off"));
  EXPECT_FALSE(says(check, "does_not_fit"));
  EXPECT_NEAR(check.chi2_per_dof, 1, 0.1);
}

TEST(SelfCheck, RigidBlockFindsComplianceAndCameraAndSaysThatScaleIsOpen) {
  Rig rig = bad_rig();
  rig.force_scale = 0.005;  // within what is stated
  const SelfCheck check = checked(rig);
  ASSERT_TRUE(check.converged);
  expect_found(check, rig, false);
  EXPECT_FALSE(error_named(check, "force_scale").determined);
  EXPECT_TRUE(says(check, "force_scale_not_determined"));
  EXPECT_FALSE(says(check, "force_scale_off"));
}

TEST(SelfCheck, SpringWithoutImagesCannotTellScaleFromComplianceAndSaysSo) {
  Rig rig = bad_rig();
  rig.stiffness_n_per_m = 800;
  rig.images = false;
  const SelfCheck check = checked(rig);
  EXPECT_TRUE(says(check, "force_scale_not_determined"));
  EXPECT_TRUE(says(check, "hand_eye_not_determined"));
  EXPECT_FALSE(says(check, "force_scale_off"));
}

TEST(SelfCheck, RigsAsStatedPassAndIntervalsHoldTheTruth) {
  int inside = 0, all = 0, alarms = 0;
  constexpr int rigs = 12;
  for (unsigned seed = 1; seed <= rigs; ++seed) {
    std::mt19937 random(1000 + seed);
    std::normal_distribution<double> normal;
    Rig rig;
    rig.seed = seed;
    rig.stiffness_n_per_m = 800;
    rig.force_scale = stated_scale_std * normal(random);
    for (int d = 0; d < 3; ++d) {
      rig.camera.translation_m(d) = stated_pose_std_m * normal(random);
      rig.camera.rotation_rad(d) = stated_pose_std_rad * normal(random);
    }
    const SelfCheck check = checked(rig);
    const auto count = [&](const std::string& name, double truth) {
      const CheckedError& error = error_named(check, name);
      inside += error.lower_95 <= truth && truth <= error.upper_95;
      ++all;
    };
    count("force_scale", rig.force_scale);
    count("compliance", 0);
    for (int d = 0; d < 3; ++d) {
      const std::string axis(1, static_cast<char>('x' + d));
      count("hand_eye_" + axis, rig.camera.translation_m(d));
      count("hand_eye_rotation_" + axis, rig.camera.rotation_rad(d));
    }
    alarms += !check.verdicts.empty();
  }
  std::printf("%d of %d truths inside 95 %%, %d of %d good rigs with an alarm\n", inside, all, alarms, rigs);
  EXPECT_GE(inside, 0.95 * all - 3 * std::sqrt(0.95 * 0.05 * all) - 0.5);
  EXPECT_LE(alarms, 2);  // a dozen errors at three standard deviations: one good rig in thirty
}

// Few rows and as many unknowns, all of them with priors: what is left has nearly as many degrees of freedom as there are rows.
TEST(SelfCheck, RigidRigsAsStatedWithoutImagesFit) {
  int misfits = 0;
  double sum = 0;
  constexpr int rigs = 40;
  for (unsigned seed = 1; seed <= rigs; ++seed) {
    Rig rig;
    rig.seed = seed;
    rig.images = false;
    const SelfCheck check = checked(rig);
    misfits += says(check, "does_not_fit");
    sum += check.chi2_per_dof;
  }
  std::printf("%d of %d good rigs do not fit, chi2 per degree of freedom %.2f\n", misfits, rigs, sum / rigs);
  EXPECT_EQ(misfits, 0);
  EXPECT_NEAR(sum / rigs, 0.9, 0.2);  // what is stated with room to spare takes a little
}

TEST(SelfCheck, ATravelThatScattersDoesNotFit) {
  Rig rig;
  rig.images = false;
  Measured rigged = measured(rig);
  int k = 0;
  for (Push& push : rigged.recording.pushes)
    for (Step& step : push.steps)
      for (Observation& one : step.observations) std::get<ToolTravel>(one).travel_m += (++k % 2 ? 4e-4 : -4e-4);
  EXPECT_TRUE(says(self_check(rigged.recording, rigged.body, rigged.inputs, {}), "does_not_fit"));
}

// It has no entry, and the one before it is not judged in its place.
TEST(SelfCheck, APushWithoutATareCondemnsNoOther) {
  Rig rig;
  Measured rigged = measured(rig);
  for (const std::size_t exact : {1u, 3u}) rigged.recording.pushes[exact].force_tare_std_n = 0;
  const SelfCheck check = self_check(rigged.recording, rigged.body, rigged.inputs, {});
  EXPECT_TRUE(error_named(check, "force_tare[push 1]").consistent);
  EXPECT_TRUE(error_named(check, "force_tare[push 3]").consistent);
  EXPECT_THROW(error_named(check, "force_tare[push 2]"), std::runtime_error);
  EXPECT_FALSE(says(check, "force_tare_off"));
}

TEST(SelfCheck, StatedComplianceIsNotAnError) {
  Rig rig;
  rig.compliance_m_per_n = 1.5e-4;
  Measured rigged = measured(rig);
  rigged.recording.tools[0].compliance_m_per_n = 1.5e-4;
  const SelfCheck check = self_check(rigged.recording, rigged.body, rigged.inputs, {});
  EXPECT_NEAR(error_named(check, "compliance").value, 0, 3 * error_named(check, "compliance").std);
  EXPECT_FALSE(says(check, "compliance_off"));
}

TEST(SelfCheck, ASpringOfAnotherStiffnessDoesNotFitOrShowsAsScale) {
  Rig rig;
  rig.stiffness_n_per_m = 800;
  const Measured rigged = measured(rig);
  SelfCheckOptions options;
  options.stiffness_n_per_m = 1000;
  const SelfCheck check = self_check(rigged.recording, rigged.body, rigged.inputs, options);
  EXPECT_TRUE(says(check, "force_scale_off") || says(check, "does_not_fit"));
}

// Nothing moves the spring in the image before the push, whatever the sensor reads by itself. Its share was taken for scale: with tares
// of 0.5 N 2 % of it.
TEST(SelfCheck, ATareIsNoForceOnTheSpringAtRest) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    Rig rig;
    rig.stiffness_n_per_m = 800;
    rig.tare_std_n = 0.5;
    rig.seed = seed;
    const CheckedError scale = error_named(checked(rig), "force_scale");
    EXPECT_LT(std::abs(scale.value), 3 * scale.std) << seed << ": " << scale.value << " +- " << scale.std;
    EXPECT_LT(scale.std, 0.006);
  }
}

TEST(SelfCheck, ACameraThatSeesSomethingElseIsNotConsistent) {
  Measured rigged = measured(Rig{});
  EXPECT_FALSE(says(self_check(rigged.recording, rigged.body, rigged.inputs, {}), "camera_sees_something_else"));
  for (auto& step : rigged.inputs)
    for (TermInput& input : step) std::get<RayObservation>(input).rays.origins_m.rowwise() += Eigen::RowVector3d(0.4, 0, 0);
  const SelfCheck check = self_check(rigged.recording, rigged.body, rigged.inputs, {});
  EXPECT_TRUE(says(check, "camera_sees_something_else"));
  EXPECT_FALSE(says(check, "hand_eye_not_determined")) << "three faces would not help";
  EXPECT_LT(check.rays, 0.5 * static_cast<double>(check.rays_given));
}

TEST(SelfCheck, ATouchBesideTheBodyIsNoTouch) {
  Measured rigged = measured(Rig{});
  for (Step& step : rigged.recording.pushes[1].steps)
    for (Load& load : step.loads) load.contact_m.x() += 1;
  const SelfCheck check = self_check(rigged.recording, rigged.body, rigged.inputs, {});
  EXPECT_TRUE(says(check, "touch_misses_body"));
  EXPECT_EQ(check.touches, 3U);
  EXPECT_EQ(check.touches_missed, 1U);
}

// A depth camera's own offset, as stated, is no fault of the camera's place.
TEST(SelfCheck, DepthsThatErrAsStatedLeaveTheCameraWhereItIs) {
  for (const bool stated : {true, false}) {
    Measured rigged = measured(Rig{});
    for (auto& step : rigged.inputs)
      for (TermInput& input : step) {
        auto& image = std::get<RayObservation>(input);
        image.rays.range_m.array() += 5e-3;
        image.bias_std_m = stated ? 5e-3 : 0;
      }
    const SelfCheck check = self_check(rigged.recording, rigged.body, rigged.inputs, {});
    EXPECT_EQ(says(check, "hand_eye_off"), !stated);
    if (!stated) continue;
    EXPECT_NEAR(error_named(check, "depth_bias").value, 5e-3, 3 * error_named(check, "depth_bias").std);
  }
}

// A camera's whole rig that is turned about the base's z: the correction is that turn, wherever the body lies.
TEST(SelfCheck, TheCorrectionIsPutBeforeTheStatedPose) {
  Rig rig;
  rig.camera.rotation_rad = Vec3(0, 0, 0.0175);
  const TriMesh body = block_object(1).surface.rest();
  const Vec3 middle_m = body.vertices_m.colwise().mean().transpose();
  const Mat3 turn = rig.camera.rotation();
  rig.camera.translation_m = turn * middle_m - middle_m;
  const SelfCheck check = checked(rig);
  const Vec3 eye_m = check.hand_eye_correction * camera_eye_m;
  EXPECT_LT((eye_m - turn * camera_eye_m).norm(), 1e-3) << "the eye, 1.8 % of its distance away";
  EXPECT_GT((camera_eye_m - turn * camera_eye_m).norm(), 3e-3);
  EXPECT_LT((check.pivot_m - middle_m).norm(), 1e-12);
}

TEST(SelfCheck, NothingToCheckIsAnError) {
  Recording empty;
  EXPECT_THROW(self_check(empty, block_object(1).surface.rest(), {}, {}), Error);
  SelfCheckOptions options;
  options.stiffness_n_per_m = -1;
  const Measured rigged = measured({});
  EXPECT_THROW(self_check(rigged.recording, rigged.body, rigged.inputs, options), Error);
}

// The body's place is not exactly known, so that first touches hold it. They were planned 4 mm off.
TEST(SelfCheckTouches, AContactThatWasPlannedIsNotWhereTheTipWas) {
  Measured rigged = measured(Rig{});
  const Recording touched = rigged.recording;
  for (Push& push : rigged.recording.pushes)
    for (Step& step : push.steps)
      for (Load& load : step.loads) load.contact_m += 4e-3 * load.direction;
  SelfCheckOptions options;
  options.placed_std_m = 5e-3;
  const auto camera_is_consistent = [&](const Recording& recording) {
    const SelfCheck check = self_check(recording, rigged.body, rigged.inputs, options);
    for (const char* axis : {"x", "y", "z"})
      if (!error_named(check, std::string("hand_eye_") + axis).consistent) return false;
    return true;
  };
  EXPECT_TRUE(camera_is_consistent(touched));
  EXPECT_FALSE(camera_is_consistent(rigged.recording)) << "or this test says nothing";
  Recording stated = rigged.recording;
  for (Push& push : stated.pushes)
    for (Step& step : push.steps)
      for (Load& load : step.loads) load.contact_std_m = 5e-3;
  EXPECT_TRUE(camera_is_consistent(stated));
  Recording by_arm = rigged.recording;
  for (std::size_t p = 0; p < by_arm.pushes.size(); ++p)
    for (std::size_t s = 0; s < by_arm.pushes[p].steps.size(); ++s) {
      Step& step = by_arm.pushes[p].steps[s];
      if (step.loads.empty()) continue;
      const Load& load = touched.pushes[p].steps[s].loads[0];
      step.T_base_tip = Pose::Identity();
      step.T_base_tip->translation() = load.contact_m + std::get<ToolTravel>(step.observations[0]).travel_m * load.direction;
    }
  EXPECT_TRUE(camera_is_consistent(by_arm));
}

}  // namespace
}  // namespace palpate::estimation::self_check_test
