// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The paper's scenes as recordings: what a fault changes and what it leaves alone, and the ball that nothing holds.
#include "palpate/lab/paper_scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/lab/opposed_ball.hpp"

namespace palpate::lab::paper_scenes_test {
namespace {

double travel_of(const Step& step) {
  for (const auto& observation : step.observations)
    if (const auto* travel = std::get_if<ToolTravel>(&observation)) return travel->travel_m;
  return -1;
}
const DepthFrame& image_of(const Step& step) {
  for (const auto& observation : step.observations)
    if (const auto* image = std::get_if<DepthFrame>(&observation)) return *image;
  throw Error("has no image", "step");
}

TEST(PaperScenes, HaveNamesOfTheirOwn) {
  std::set<std::string> names;
  for (const PaperScene& scene : paper_scenes()) EXPECT_TRUE(names.insert(std::string(scene.name)).second) << scene.name;
  for (const PaperFault& fault : paper_faults()) EXPECT_TRUE(names.insert(std::string(fault.name)).second) << fault.name;
  EXPECT_THROW(paper_scene("penguin"), Error);
}

// The balloon was refused for the law that its scene did not mean to give it.
TEST(PaperScenes, CanAllBeBegun) {
  for (const PaperScene& scene : paper_scenes()) {
    const PaperTrial begun = make_paper_trial(scene, 1, [](std::string_view, double) { return false; });
    EXPECT_FALSE(begun.recording.tools.empty()) << scene.name;
    EXPECT_EQ(begun.recording.model.material, scene.law) << scene.name;
  }
}

// The paper's seven forces: with a sensor of 0.08 N of noise no push of 1.5 N may end for a reading that looks like a slip.
TEST(PaperScenes, BalloonAndBearArePressedSevenTimes) {
  const auto samples = [](const Push& push) {
    return std::count_if(push.steps.begin(), push.steps.end(), [](const Step& step) { return !step.loads.empty(); });
  };
  for (const std::uint64_t seed : {1, 3, 101}) EXPECT_GE(samples(make_paper_trial(paper_scene("balloon"), seed).recording.pushes.at(0)), 7) << seed;
  // Its sites differ in stiffness, and are pressed as deep in as many steps.
  const PaperTrial bear = make_paper_trial(paper_scene("teddy"), 1);
  ASSERT_EQ(bear.recording.pushes.size(), 3u);
  for (const Push& push : bear.recording.pushes) EXPECT_NEAR(samples(push), 8, 1) << push.name;
}

// A slip after the first of nine samples: before it the two recordings are one; after it the tip presses elsewhere, the encoders
// have come deeper by what was lost, and the recording goes on naming the first place.
TEST(PaperScenes, AFaultChangesWhatItSaysAndNothingElse) {
  const PaperScene& scene = paper_scene("cube");
  const PaperTrial right = make_paper_trial(scene, 3);
  const auto fault = [&](double slip_m, double deeper_m, double tilt_rad, double radius) {
    return make_paper_trial(scene, 3, {}, {"test", "test", slip_m, deeper_m, tilt_rad, radius});
  };
  const Push& push = right.recording.pushes.at(0);
  ASSERT_GE(push.steps.size(), 6u);
  const PaperTrial slipped = fault(0.005, 0.001, 0, 1), tilted = fault(0, 0, 0.01, 0.5);
  const Push& aside = slipped.recording.pushes.at(0);
  ASSERT_GE(aside.steps.size(), 6u);
  for (std::size_t s = 0; s < 6; ++s) {
    const bool before = s <= 4;
    EXPECT_EQ(before, aside.steps[s].time_s == push.steps[s].time_s) << s;
    if (s == 0) continue;
    EXPECT_EQ(aside.steps[s].loads.at(0).contact_m, push.steps[1].loads.at(0).contact_m);
    EXPECT_EQ(before, travel_of(aside.steps[s]) == travel_of(push.steps[s])) << s;
  }
  EXPECT_EQ(slipped.young_modulus_pa, right.young_modulus_pa);
  const Step &tilted_step = tilted.recording.pushes.at(0).steps.at(2), &right_step = push.steps.at(2);
  EXPECT_NEAR(Eigen::AngleAxisd(image_of(right_step).T_base_camera.rotation().transpose() * image_of(tilted_step).T_base_camera.rotation()).angle(),
              0.01, 1e-9);
  EXPECT_TRUE(image_of(right_step).depth_m == image_of(tilted_step).depth_m);
  EXPECT_EQ(*right_step.loads.at(0).force_n, *tilted_step.loads.at(0).force_n);
  EXPECT_NEAR(tilted.recording.tools.at(0).radius_m, 0.5 * right.recording.tools.at(0).radius_m, 1e-12);
}

TEST(PaperScenes, APushThatNeverPressesIsSaidAndNotFitted) {
  PaperScene scene = paper_scene("cow");
  scene.object = "cube";
  scene.unused.reset();
  scene.young_modulus_pa = 1;  // a breath of a cube: what it pushes back with no sensor feels
  try {
    make_paper_trial(scene, 1);
    FAIL() << "taken";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("push at top: no contact within "), std::string::npos) << error.what();
  }
}

// The arm stood 8 cm deep where it was asked to stop, ran into the object on its way to the unused place, and nothing was there to
// be predicted.
TEST(PaperScenes, ThePushAfterADeepOneIsMade) {
  PaperScene deep = paper_scene("foam9cm");
  deep.true_law = "linear";  // solved at once
  deep.samples = 3;
  const PaperTrial trial = make_paper_trial(deep, 1);
  const Push& push = trial.recording.pushes.at(0);
  ASSERT_GE(push.steps.size(), 3u);
  EXPECT_GT(travel_of(push.steps.back()), 0.03);
  EXPECT_GE(trial.unused.steps.size(), 3u);
}

/// Scenes in which a push at another place is predicted.
class UnusedPlace : public testing::TestWithParam<std::string> {};

TEST_P(UnusedPlace, IsPushed) {
  PaperScene scene = paper_scene(GetParam());
  scene.true_law = "linear";  // solved at once
  scene.samples = 2;
  const PaperTrial trial = make_paper_trial(scene, 1);
  EXPECT_GE(trial.unused.steps.size(), 3u) << trial.unused_stop;
  EXPECT_EQ(trial.unused_stop, "");
}

INSTANTIATE_TEST_SUITE_P(Scenes, UnusedPlace, testing::Values("cow", "cube", "cube9cm", "ball", "teddy"));

// The mirror image of the upper half is the lower one: the middle goes down by half of what the upper pad does. And near a pad
// that is small against the ball, the ball gives way as a half space does: 16 p a (1 - nu^2) / (3 pi E) on the mean of the patch
// (Johnson, Contact Mechanics, 3.4); seen from the other pad, twice that, less what the half space gives beyond the ball.
TEST(OpposedBall, IsSqueezedFromBothSidesAlike) {
  ObjectOptions truth;
  truth.young_modulus_pa = 20e3;
  truth.poisson_ratio = 0.3;
  truth.material = "linear";
  truth.tetrahedra = 4000;
  const LabObject ball = opposed_ball(truth);
  EXPECT_TRUE(ball.supports.empty());
  const auto pressed = ball.press(ball.sites.at(0));
  const double force_n = 1;
  pressed->press(force_n);
  const TriMesh after = pressed->surface();
  double middle_m = 0, lowest_m = 0, highest_m = 0;
  int count = 0;
  for (Index v = 0; v < static_cast<Index>(after.vertices_m.rows()); ++v) {
    const double height_m = ball.surface.vertices_m(v, 2) - ball.foot_m.z(), down_m = ball.surface.vertices_m(v, 2) - after.vertices_m(v, 2);
    if (std::abs(height_m - opposed_ball_radius_m) < 0.002) middle_m += down_m, ++count;
    if (height_m < 1e-4) lowest_m = down_m;
    if (height_m > 2 * opposed_ball_radius_m - 1e-4) highest_m = down_m;
  }
  ASSERT_GT(count, 20);
  EXPECT_NEAR(middle_m / count / pressed->travel_m(), 0.5, 0.01);
  EXPECT_LT(lowest_m, 0) << "the middle of the lower pad's patch dents inwards, its mean stands still";
  EXPECT_GT(highest_m, pressed->travel_m());
  const double a_m = ball.pad_radius_m, pi = 3.14159265358979323846;
  const double half_space_m = 2 * 16 * force_n / (pi * a_m * a_m) * a_m * (1 - 0.3 * 0.3) / (3 * pi * 20e3);
  EXPECT_LT(pressed->travel_m(), half_space_m);
  EXPECT_GT(pressed->travel_m(), 0.6 * half_space_m);
}

// A push meets the surface's triangles, which lie a little below the very top: the robot's every push of it was refused.
TEST(OpposedBall, IsPressedWhereItsTrianglesAre) {
  ObjectOptions truth;
  truth.tetrahedra = 4000;
  const LabObject ball = opposed_ball(truth);
  PushSite there = ball.sites.at(0);
  there.contact_m.z() -= 4e-4;
  EXPECT_NO_THROW(ball.press(there));
  there.contact_m.x() += 0.01;
  EXPECT_THROW(ball.press(there), Error);
}

}  // namespace
}  // namespace palpate::lab::paper_scenes_test
