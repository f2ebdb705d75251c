// label: unit
// SPDX-License-Identifier: Apache-2.0
// Whatever a driver hands over is checked: each wrong field by a driver that has just this one wrong.
#include "palpate/acquisition/driver_robot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <functional>

#include "palpate/core/error.hpp"

namespace palpate::acquisition::driver_robot_test {
namespace {

using testing::HasSubstr;

struct World {
  PalpateRobot robot{};
  PalpateRobotState state{};
  PalpateDepthImage image{};
  float depth_m[6] = {1, 2, 3, 4, std::nanf(""), -1};
  std::uint8_t mask[6] = {0, 7, 0, 0, 0, 1};
  PalpatePose asked{};
  int answer = PALPATE_DONE, destroyed = 0, made = PALPATE_DONE;
  double sigma_m = 1e-4;
  std::uint32_t abi = 0;
};
World world;

int make(std::uint32_t abi, const char* settings, PalpateRobot* robot, char* error, std::size_t error_size) {
  world.abi = abi;
  if (world.made != PALPATE_DONE) std::snprintf(error, error_size, "cannot start with %s", settings);
  *robot = world.robot;
  return world.made;
}

class DriverRobotTest : public testing::Test {
 protected:
  void SetUp() override {
    world = {};
    PalpateRobot& r = world.robot;
    r.abi = PALPATE_ROBOT_ABI;
    r.read = [](void*, PalpateRobotState* state) { return *state = world.state, world.answer; };
    r.move = [](void*, const PalpatePose* pose, double) { return world.asked = *pose, world.answer; };
    r.stop = [](void*) { return world.answer; };
    r.take_depth_image = [](void*, PalpateDepthImage* image) { return *image = world.image, world.answer; };
    r.wait = [](void*, double) { return world.answer; };
    r.travel_sigma_m = [](void*) { return world.sigma_m; };
    r.last_error = [](void*) { return "the cable is out"; };
    r.destroy = [](void*) { ++world.destroyed; };
    const double s = std::sqrt(0.5);
    world.state.joints = 2;
    world.state.joints_rad[1] = 0.5;
    world.state.T_base_tip = {{1, 2, 3}, {s, 0, 0, s}};
    world.image.width_px = 3;
    world.image.height_px = 2;
    world.image.fx_px = world.image.fy_px = 100;
    world.image.T_base_camera = {{0, 0, 1}, {0, 1, 0, 0}};
    world.image.noise_model = "realsense_d435";
    world.image.depth_m = world.depth_m;
  }
  static std::string refusal(const std::function<void()>& call) {
    try {
      call();
    } catch (const Error& error) {
      return error.what();
    }
    return "was not refused";
  }
};

TEST_F(DriverRobotTest, HandsEverythingThrough) {
  {
    DriverRobot robot(make, "", "lib");
    EXPECT_EQ(world.abi, PALPATE_ROBOT_ABI);
    const RobotState state = robot.read();
    EXPECT_EQ(state.joints_rad, (std::vector<double>{0, 0.5}));
    EXPECT_EQ(state.T_base_tip.translation(), Vec3(1, 2, 3));
    EXPECT_NEAR((state.T_base_tip.linear() * Vec3::UnitX() - Vec3::UnitY()).norm(), 0, 1e-12) << "a quarter turn about z";
    world.image.mask = world.mask;
    const DepthFrame frame = robot.take_depth_image();
    DepthImage depth(2, 3);
    depth << 1, 2, 3, 4, 0, 0;  // row by row; what is no number is no data
    EXPECT_EQ(frame.depth_m, depth);
    MaskImage mask(2, 3);
    mask << 0, 1, 0, 0, 0, 1;
    EXPECT_EQ(frame.mask, mask);
    EXPECT_EQ(frame.noise.model, "realsense_d435");
    world.image.noise_model = nullptr;
    world.image.sigma_m = 0.002;
    EXPECT_EQ(robot.take_depth_image().noise.sigma_m, 0.002);
    EXPECT_EQ(robot.move(state.T_base_tip, 0.1), Motion::done);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(world.asked.rotation_wxyz[i], world.state.T_base_tip.rotation_wxyz[i], 1e-12);
    world.answer = PALPATE_REFUSED;
    EXPECT_EQ(robot.move(state.T_base_tip, 0.1), Motion::refused);
    EXPECT_TRUE(robot.reaches(state.T_base_tip)) << "not known beforehand";
    EXPECT_EQ(world.destroyed, 0);
  }
  EXPECT_EQ(world.destroyed, 1);
}

TEST_F(DriverRobotTest, ADriverOfAnotherVersionOrWithoutACallIsNotUsed) {
  world.made = PALPATE_FAILED;
  EXPECT_THAT(refusal([] { DriverRobot(make, "x", "lib"); }), HasSubstr("lib: cannot start with x"));
  world.made = PALPATE_DONE;
  for (const std::uint32_t other : {0u, PALPATE_ROBOT_ABI + 1}) {
    world.robot.abi = other;
    EXPECT_THAT(refusal([] { DriverRobot(make, "", "lib"); }), HasSubstr("build the driver anew"));
  }
  world.robot.abi = PALPATE_ROBOT_ABI;
  world.robot.wait = nullptr;
  EXPECT_THAT(refusal([] { DriverRobot(make, "", "lib"); }), HasSubstr("`wait`"));
  EXPECT_EQ(world.destroyed, 0);
}

// The struct of version 1, which ends before `limits`: a driver of then touches no more of today's than that.
constexpr std::size_t size_of_first = offsetof(PalpateRobot, limits);
static_assert(size_of_first == offsetof(PalpateRobot, destroy) + sizeof(void (*)(void*)), "what is new comes after what was there");

int make_first(std::uint32_t abi, const char*, PalpateRobot* robot, char* error, std::size_t error_size) {
  if (abi != 1) {
    std::snprintf(error, error_size, "this driver is for version 1 of palpate's robots, not %u", unsigned(abi));
    return PALPATE_FAILED;
  }
  if (world.made != PALPATE_DONE) {
    std::snprintf(error, error_size, "the cable is out");
    return world.made;
  }
  world.robot.abi = 1;
  std::memcpy(robot, &world.robot, size_of_first);
  return PALPATE_DONE;
}

TEST_F(DriverRobotTest, ADriverOfTheFirstVersionIsStillUsed) {
  const auto works = [](MakeRobot old_driver) {
    DriverRobot robot(old_driver, "", "lib");
    EXPECT_EQ(robot.read().T_base_tip.translation(), Vec3(1, 2, 3));
    EXPECT_EQ(robot.limits().force_n, RobotLimits::none);
    EXPECT_FALSE(robot.look(0, 3));
  };
  works(make_first);
  // One that never asked which version the program has, and whose tail is whatever it is.
  world.robot.abi = 1;
  world.robot.limits = [](void*, PalpateLimits*) { return int(PALPATE_FAILED); };
  world.robot.look = [](void*, int, int, PalpateDepthImage*) { return int(PALPATE_FAILED); };
  works(make);
  EXPECT_EQ(world.destroyed, 2);
  // What it says of its own trouble is not lost behind what it says of the version.
  world.made = PALPATE_FAILED;
  EXPECT_THAT(refusal([] { DriverRobot(make_first, "", "lib"); }),
              HasSubstr("lib: this driver is for version 1 of palpate's robots, not 2 (asked as version 1: the cable is out)"));
}

TEST_F(DriverRobotTest, LimitsAndViewsAreHandedThroughWhereTheyAreThere) {
  {
    DriverRobot robot(make, "", "lib");
    EXPECT_EQ(robot.limits().force_n, RobotLimits::none);
    EXPECT_EQ(robot.limits().speed_m_s, RobotLimits::none);
    EXPECT_FALSE(robot.look(0, 3));
  }
  world.robot.limits = [](void*, PalpateLimits* limits) { return limits->force_n = 30, world.answer; };
  world.robot.look = [](void*, int view, int views, PalpateDepthImage* image) {
    *image = world.image;
    image->time_s = 10 * view + views;
    return world.answer;
  };
  DriverRobot robot(make, "", "lib");
  EXPECT_EQ(robot.limits().force_n, 30);
  EXPECT_EQ(robot.limits().travel_m, RobotLimits::none) << "as it came";
  const auto frame = robot.look(1, 3);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->time_s, 13);
  EXPECT_EQ(frame->T_base_camera.translation(), Vec3(0, 0, 1));
  world.image.fx_px = 0;
  EXPECT_THAT(refusal([&] { robot.look(0, 3); }), HasSubstr("lib, look: fx_px"));
  world.answer = PALPATE_FAILED;
  EXPECT_THAT(refusal([&] { robot.limits(); }), HasSubstr("lib, limits: the cable is out"));
  EXPECT_THAT(refusal([&] { robot.look(0, 3); }), HasSubstr("lib, look: the cable is out"));
}

TEST_F(DriverRobotTest, ALimitThatIsNoneIsNamed) {
  world.robot.limits = [](void*, PalpateLimits* limits) { return limits->travel_m = world.sigma_m, int(PALPATE_DONE); };
  DriverRobot robot(make, "", "lib");
  for (const double wrong : {0.0, -1.0, std::nan("")}) {
    world.sigma_m = wrong;
    EXPECT_THAT(refusal([&] { robot.limits(); }), HasSubstr("lib, limits: travel_m: must be positive"));
  }
}

TEST_F(DriverRobotTest, WhatCannotBeIsNamed) {
  DriverRobot robot(make, "", "lib");
  world.answer = PALPATE_FAILED;
  EXPECT_THAT(refusal([&] { robot.stop(); }), HasSubstr("lib, stop: the cable is out"));
  EXPECT_THAT(refusal([&] { robot.wait(1); }), HasSubstr("lib, wait"));
  world.answer = PALPATE_DONE;
  const World good = world;
  const auto bad = [&](auto change, const char* words) {
    world = good;
    change();
    EXPECT_THAT(refusal([&] {
                  robot.read();
                  robot.take_depth_image();
                  robot.travel_sigma_m();
                }),
                HasSubstr(words));
  };
  bad([] { world.state.force_n[1] = std::nan(""); }, "force_n");
  bad([] { world.state.joints = PALPATE_MAX_JOINTS + 1; }, "joints");
  bad([] { world.state.joints_rad[0] = INFINITY; }, "joints_rad");
  bad([] { world.state.T_base_tip.rotation_wxyz[0] = 2; }, "unit quaternion");
  bad([] { world.state.T_base_tip.position_m[0] = std::nan(""); }, "position");
  bad([] { world.image.width_px = 0; }, "width_px");
  bad([] { world.image.height_px = 100000; }, "height_px");
  bad([] { world.image.depth_m = nullptr; }, "depth_m");
  bad([] { world.image.fx_px = 0; }, "fx_px");
  bad([] { world.image.cx_px = std::nan(""); }, "cx_px");
  bad([] { world.image.pose_std_m = -1; }, "pose_std_m");
  bad([] { world.image.noise_model = "eye"; }, "eye");
  bad([] { world.image.noise_model = nullptr; }, "sigma_m");
  bad([] { world.sigma_m = 0; }, "travel_sigma_m");
  world = good;
  world.state.time_s = 5;
  robot.read();
  world.state.time_s = 4;
  EXPECT_THAT(refusal([&] { robot.read(); }), HasSubstr("clock"));
}

}  // namespace
}  // namespace palpate::acquisition::driver_robot_test
