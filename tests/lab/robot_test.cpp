// label: unit
// SPDX-License-Identifier: Apache-2.0
// The push protocol on the lab's robot: what is recorded belongs to the truth within what the recording states.
#include "palpate/lab/robot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/recording.hpp"
#include "refusals.hpp"
#include "temporary_folder.hpp"

namespace palpate::lab::robot_test {
namespace {

LabOptions quick() {
  LabOptions options;
  options.seed = 3;
  options.object.cells_in_radius = 1;
  return options;
}

acquisition::PushOptions small_push() {
  acquisition::PushOptions options;
  options.force_limit_n = 4;
  options.force_step_n = 2;
  options.unloading_steps = 1;
  return options;
}

struct Made {
  acquisition::PushReport report;
  std::vector<Step> steps;
  std::vector<double> true_force_n, true_travel_m;
};

Made run(const LabOptions& options) {
  LabRobot robot(options);
  Made made;
  made.report = acquisition::run_push(robot, robot.plan(), small_push(), [&](const Push&, const Step& step) {
    made.steps.push_back(step);
    made.true_force_n.push_back(robot.true_force_n());
    made.true_travel_m.push_back(robot.true_travel_m());
  });
  return made;
}

TEST(LabRobot, PushIsRecordedAsItHappened) {
  const Made made = run(quick());
  EXPECT_EQ(made.report.stop, acquisition::StopReason::force_limit) << made.report.message;
  EXPECT_TRUE(made.report.unsettled.empty()) << "noise of the sensor must not look like a creeping force";
  ASSERT_EQ(made.steps.size(), 5u);  // rest, 2 N, 4 N, half of it on the way back, rest
  double offset = 0, worst = 0;
  int loaded = 0;
  for (std::size_t i = 0; i < made.steps.size(); ++i) {
    const Step& step = made.steps[i];
    EXPECT_EQ(step.joints_rad.size(), 7u);
    if (step.loads.empty()) {
      EXPECT_EQ(made.true_force_n[i], 0);
      continue;
    }
    // The tare is known to 0.05 N / sqrt(50); a settled force may still creep a little.
    EXPECT_NEAR((*step.loads[0].force_n + Vec3(0, 0, made.true_force_n[i])).norm(), 0, 0.1) << i;
    for (const Observation& o : step.observations)
      if (const auto* travel = std::get_if<ToolTravel>(&o)) {
        offset += travel->travel_m - made.true_travel_m[i];
        worst = std::max(worst, std::abs(travel->travel_m - made.true_travel_m[i]));
        ++loaded;
        EXPECT_GT(travel->sigma_m, 1e-4);
        EXPECT_LT(travel->sigma_m, 1e-3);
      }
  }
  ASSERT_EQ(loaded, 3);
  // Contact is noticed late by what the threshold needs, at most 1.5 mm here, and the encoders err by 0.4 mm.
  EXPECT_LT(worst, 0.003);
}

// A sensor at its end says the same force however hard the tip presses: the push ends before that.
TEST(LabRobot, ItsLimitIsWhatItsSensorCanTell) {
  for (const auto& [name, most_n] : {std::pair{"schunk_ftcl_050", 300.0}, {"ati_gamma", 100.0}}) {
    LabOptions options = quick();
    options.force = force_sensor(name);
    const double force_n = LabRobot(options).limits().force_n;
    EXPECT_LT(force_n, most_n - 9.81 * options.force.tool_mass_kg) << name;
    EXPECT_GT(force_n, 0.9 * most_n) << name;
  }
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    LabOptions options = quick();
    options.seed = seed;
    options.force.range_along_n = 8;
    LabRobot robot(options);
    const double limit_n = robot.limits().force_n;
    EXPECT_NEAR(limit_n, 8 - 3 - 2.94, 0.01);
    const acquisition::PushReport report = acquisition::run_push(robot, robot.plan(), small_push(), {});
    EXPECT_EQ(report.stop, acquisition::StopReason::robot_force_limit) << seed << ": " << report.message;
    EXPECT_NEAR(report.highest_force_n, limit_n, 0.8) << seed << ": an arm that errs by 0.3 mm";
  }
}

TEST(LabRobot, LooksAtOneViewAfterTheOther) {
  LabRobot robot(quick());
  const std::vector<DepthFrame> at_once = robot.look_around(3);
  const auto in_turn = acquisition::look_around(robot, 3);
  ASSERT_TRUE(in_turn);
  ASSERT_EQ(in_turn->size(), 3u);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ((*in_turn)[k].depth_m, at_once[k].depth_m);
    EXPECT_TRUE((*in_turn)[k].T_base_camera.isApprox(at_once[k].T_base_camera));
  }
  EXPECT_THROW(acquisition::look_around(robot, 0), Error);
}

// A place that a camera found is off by what the camera errs: contact comes a little before or behind it.
TEST(LabRobot, APlaceBesideTheSurfaceIsPressedWhereThePushMeetsIt) {
  for (const double off_m : {-0.004, 0.003}) {
    LabRobot robot(LabOptions{}, make_object("bar", {}));
    const PushSite top = robot.object().sites.at(1);
    const acquisition::PushPlan plan = robot.plan_at(top.contact_m + off_m * top.direction, top.direction);
    EXPECT_LT((plan.contact_m - top.contact_m - off_m * top.direction).norm(), 1e-12) << "that is where it is expected";
    acquisition::PushOptions protocol = small_push();
    protocol.travel_limit_m = 0.002;
    const acquisition::PushReport report = acquisition::run_push(robot, plan, protocol, {});
    EXPECT_LT((report.contact_m - top.contact_m).norm(), 1.5e-3) << report.message;
  }
}

// Travels err from step to step by what each of them states, and all of a push together by what its zero states.
TEST(LabRobot, TravelsErrAsTheyState) {
  double steps = 0, spread = 0, zeros = 0;
  constexpr int seeds = 12;
  for (int seed = 1; seed <= seeds; ++seed) {
    LabOptions options = quick();
    options.seed = std::uint64_t(seed);
    LabRobot robot(options);
    std::vector<double> errors, sigmas;
    double zero_std_m = 0;
    acquisition::run_push(robot, robot.plan(), small_push(), [&](const Push& push, const Step& step) {
      zero_std_m = push.travel_offset_std_m;
      for (const Observation& o : step.observations)
        if (const auto* travel = std::get_if<ToolTravel>(&o)) {
          errors.push_back(travel->travel_m - robot.true_travel_m());
          sigmas.push_back(travel->sigma_m);
        }
    });
    ASSERT_EQ(errors.size(), 3u);
    const double mean = std::accumulate(errors.begin(), errors.end(), 0.0) / 3;
    for (std::size_t k = 0; k < 3; ++k) spread += std::pow((errors[k] - mean) / sigmas[k], 2);
    steps += 2;
    zeros += std::pow(mean, 2) / (std::pow(zero_std_m, 2) + std::pow(sigmas[0], 2) / 3);
  }
  EXPECT_NEAR(std::sqrt(spread / steps), 1, 0.45);  // three standard deviations of 24 numbers' own
  EXPECT_GT(std::sqrt(zeros / seeds), 0.4);
  EXPECT_LT(std::sqrt(zeros / seeds), 1.6);
}

/// Every file of a folder, by its name.
std::map<std::string, std::string> bytes_in(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files[entry.path().lexically_relative(folder).string()] = io::read_file(entry.path());
  return files;
}

TEST(LabRobot, SameSeedSameRecording) {
  const Made a = run(quick()), b = run(quick());
  ASSERT_EQ(a.steps.size(), b.steps.size());
  EXPECT_EQ(a.true_force_n, b.true_force_n);
  EXPECT_EQ(a.true_travel_m, b.true_travel_m);
  EXPECT_EQ(a.report.contact_m, b.report.contact_m);
  EXPECT_EQ(a.report.tare_n, b.report.tare_n);
  for (std::size_t i = 0; i < a.steps.size(); ++i) {
    const Step &one = a.steps[i], &other = b.steps[i];
    EXPECT_EQ(one.time_s, other.time_s);
    EXPECT_EQ(one.joints_rad, other.joints_rad);
    EXPECT_EQ(one.unloading, other.unloading);
    ASSERT_TRUE(one.T_base_tip && other.T_base_tip);
    EXPECT_EQ(one.T_base_tip->matrix(), other.T_base_tip->matrix());
    ASSERT_EQ(one.loads.size(), other.loads.size());
    for (std::size_t k = 0; k < one.loads.size(); ++k) {
      EXPECT_EQ(*one.loads[k].force_n, *other.loads[k].force_n);
      EXPECT_EQ(one.loads[k].force_std_n, other.loads[k].force_std_n);
      EXPECT_EQ(one.loads[k].contact_m, other.loads[k].contact_m);
    }
    ASSERT_EQ(one.observations.size(), other.observations.size());
    for (std::size_t k = 0; k < one.observations.size(); ++k)
      if (const auto* travel = std::get_if<ToolTravel>(&one.observations[k])) {
        EXPECT_EQ(travel->travel_m, std::get<ToolTravel>(other.observations[k]).travel_m);
        EXPECT_EQ(travel->sigma_m, std::get<ToolTravel>(other.observations[k]).sigma_m);
      }
    const auto& first = std::get<DepthFrame>(one.observations.back());
    const auto& second = std::get<DepthFrame>(other.observations.back());
    EXPECT_EQ(first.T_base_camera.matrix(), second.T_base_camera.matrix());
    EXPECT_EQ(first.depth_m, second.depth_m);
    EXPECT_EQ(first.mask, second.mask);
    EXPECT_GT(first.mask.cast<int>().sum(), 1000) << "the arm is in the picture";
  }
  // On the disk, too: nothing there may depend on the clock, the folder or the memory.
  const test::TemporaryFolder folder("same_seed");
  std::map<std::string, std::string> files[2];
  for (const Made* made : {&a, &b}) {
    const std::size_t which = made == &a ? 0 : 1;
    Recording recording = LabRobot(quick()).scene();
    recording.pushes.emplace_back();
    recording.pushes[0].name = "push 1";
    recording.pushes[0].steps = made->steps;
    io::write_recording(recording, folder.path() / std::to_string(which));
    files[which] = bytes_in(folder.path() / std::to_string(which));
  }
  EXPECT_GT(files[0].size(), 10u);
  for (const auto& [name, bytes] : files[0]) EXPECT_TRUE(files[1].contains(name) && files[1].at(name) == bytes) << name;
  EXPECT_EQ(files[0].size(), files[1].size());
  LabOptions other_seed = quick();
  other_seed.seed = 4;
  EXPECT_NE(run(other_seed).report.tare_n, a.report.tare_n);
}

// With the hand the wrist sensor's own errors turned, by up to 8 degrees on the bear's belly: no tare holds then, and 0.2 N stood aside
// of 2 N in the push's direction.
TEST(LabRobot, AlongItsToolTheHandDoesNotTurn) {
  ObjectOptions soft;
  soft.material = "linear";
  LabRobot robot(quick(), make_object("bear", soft));
  for (std::size_t site = 0; site < robot.object().sites.size(); ++site) {
    const acquisition::PushPlan plan = robot.plan(site);
    const auto stands = [&](double before_m) {
      Pose there = Pose::Identity();
      there.linear() = plan.R_base_tip;
      there.translation() = plan.contact_m - before_m * plan.direction;
      EXPECT_EQ(robot.move(there, 0.02), acquisition::Motion::done) << plan.site;
      return robot.read().T_base_tip;
    };
    const Pose first = stands(0.05);
    EXPECT_NEAR((first.linear().col(2) - plan.direction).norm(), 0, 1e-5) << plan.site;
    for (const double before_m : {0.02, 0.0, -0.005}) {
      const Pose now = stands(before_m);
      EXPECT_LT(Eigen::AngleAxisd(first.linear().transpose() * now.linear()).angle(), 1e-4) << plan.site << " " << before_m;
      EXPECT_NEAR((now.translation() - plan.contact_m + before_m * plan.direction).norm(), 0, 1e-5) << plan.site;
    }
  }
}

TEST(LabRobot, SlipEndsThePush) {
  LabOptions options = quick();
  options.slip_at_m = 0.004;
  EXPECT_EQ(run(options).report.stop, acquisition::StopReason::slip);
}

TEST(LabRobot, RefusesWhatTheArmCannotReach) {
  LabRobot robot(quick());
  Pose far = Pose::Identity();
  far.translation() = Vec3(4, 0, 0);
  EXPECT_EQ(robot.move(far, 0.1), acquisition::Motion::refused);
  EXPECT_THROW(robot.move(far, 0), Error);
  const Recording scene = robot.scene();
  EXPECT_EQ(scene.tools.size(), 1u);
  EXPECT_EQ(scene.joint_names.size(), 7u);
}

TEST(LabRobot, BadOptionsAreRefused) {
  const auto refused = [](auto change) { return refuses([](const auto& o) { check(o); }, quick(), change); };
  using O = LabOptions;
  EXPECT_FALSE(refused([](O&) {}));
  EXPECT_TRUE(refused([](O& o) { o.joint_std_rad = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.camera_std_m = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.force.sigma_n = -1; }));
  EXPECT_TRUE(refused([](O& o) { o.force.range_n = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.force.cross_talk_std = 1; }));
  EXPECT_TRUE(refused([](O& o) { o.relaxation = 1; }));
  EXPECT_TRUE(refused([](O& o) { o.relaxation_s = 0; }));
  EXPECT_TRUE(refused([](O& o) { o.depth.noise.model = "eye"; }));
}

TEST(LabRobot, PushesAtPlacesOfItsOwnWhereTheArmGetsThere) {
  LabRobot robot({}, make_object("ball"));
  const PushSite known = robot.object().sites[1];
  EXPECT_EQ(robot.plan_at(known.contact_m, known.direction).site, known.name);
  const std::size_t before = robot.object().sites.size();
  const Vec3 aside = known.contact_m + Vec3(0, 0.01, 0);
  const acquisition::PushPlan plan = robot.plan_at(aside, known.direction);
  EXPECT_EQ(robot.object().sites.size(), before + 1);
  EXPECT_EQ(plan.contact_m, aside);
  EXPECT_NEAR((plan.R_base_tip.col(2) - known.direction).norm(), 0, 1e-12);
  EXPECT_EQ(robot.plan_at(aside, known.direction).site, plan.site);
  EXPECT_EQ(robot.object().sites.size(), before + 1);
  EXPECT_TRUE(robot.reaches(known.contact_m, known.direction));
  EXPECT_FALSE(robot.reaches(Vec3(2.5, 0, 0.1), -Vec3::UnitZ()));
}

}  // namespace
}  // namespace palpate::lab::robot_test
