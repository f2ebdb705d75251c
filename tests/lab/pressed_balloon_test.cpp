// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The inflated skin against the textbook's sphere, and against the balance of forces on the cap above any of its rings, with
// tensions read off the stretches of its surface.
#include "palpate/lab/pressed_balloon.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/geometry/mesh_checks.hpp"

namespace palpate::lab::pressed_balloon_test {
namespace {

TEST(PressedBalloon, UnloadedItIsTheSphereThatItsPressureHolds) {
  PressedBalloonOptions options;
  options.young_modulus_pa = 1.2e6;
  // p = 2 mu t / R (1 / s - 1 / s^7), from s = 2, mu = 0.4 MPa, t = 0.3 mm, R = 37.5 mm.
  const double expected_pa = 2 * 0.4e6 * 0.0003 / 0.0375 * (0.5 - 1.0 / 128);
  double before = 1;
  for (const int elements : {60, 120, 240}) {
    options.elements = elements;
    const double off = std::abs(PressedBalloon(options).pressure_pa() / expected_pa - 1);
    EXPECT_LT(off, 0.35 * before);
    before = off;
  }
  EXPECT_LT(before, 1e-3);
  const auto check = geometry::check_surface(PressedBalloon(options).surface());
  EXPECT_TRUE(check.watertight());
  EXPECT_GT(*check.volume_m3, 0);
}

TEST(PressedBalloon, EveryCapIsInBalance) {
  PressedBalloonOptions options;
  options.base_centre_m = Vec3::Zero();
  options.elements = 600;
  options.sides = 8;
  PressedBalloon balloon(options);
  const TriMesh rest = balloon.surface();
  const double force_n = 1.5;
  balloon.press(force_n);
  EXPECT_GT(balloon.travel_m(), 0.004);
  const TriMesh pressed = balloon.surface();
  // Isothermal air: the volume from the surface itself (a fan of eight sides, so as a ratio).
  const double volume_ratio = *geometry::check_surface(pressed).volume_m3 / *geometry::check_surface(rest).volume_m3;
  PressedBalloon unloaded(options);
  const double inside_pa = (options.air_pa + unloaded.pressure_pa()) / volume_ratio - options.air_pa;
  EXPECT_NEAR(balloon.pressure_pa() / inside_pa, 1, 1e-3);
  EXPECT_GT(balloon.pressure_pa(), 1.01 * unloaded.pressure_pa());
  const double shear_pa = options.young_modulus_pa / 3;
  int rings = 0;
  for (int i = 60; i + 1 < options.elements - 1; i += 40) {
    const Vec3 a = rest.vertices_m.row(8 * i), b = rest.vertices_m.row(8 * (i + 1)), c = pressed.vertices_m.row(8 * i),
               d = pressed.vertices_m.row(8 * (i + 1));
    const double rest_r = 0.5 * (a.x() + b.x()), r = 0.5 * (c.x() + d.x());
    if (rest_r < 1.05 * options.pad_radius_m) continue;  // all of the pad's force is above this ring
    const double along = options.stretch * (d - c).norm() / (b - a).norm(), around = options.stretch * r / rest_r;
    const double thick = 1 / (along * around);
    const double tension_n_m = shear_pa * options.thickness_m * thick * (along * along - thick * thick);
    const double downwards = 2 * M_PI * r * tension_n_m * (c - d).z() / (d - c).norm();  // of what is below on the cap
    EXPECT_NEAR((downwards + force_n) / (M_PI * r * r * balloon.pressure_pa()), 1, 0.005) << "ring " << i;
    ++rings;
  }
  EXPECT_GT(rings, 6);
}

TEST(PressedBalloon, PushesBackMoreWhenBlownUpHarderAndSlackSkinOnlyPulls) {
  PressedBalloonOptions soft, hard;
  hard.thickness_m *= 1.5;
  PressedBalloon one(soft), other(hard);
  one.press(1);
  other.press(1);
  EXPECT_GT(one.travel_m(), 1.2 * other.travel_m());
  double last = 0;
  for (const double force : {1.0, 2.0, 3.0}) {
    one.press(force);
    EXPECT_GT(one.travel_m(), last);
    last = one.travel_m();
  }
  soft.stretch = 1;
  EXPECT_THROW(PressedBalloon{soft}, Error);
}

}  // namespace
}  // namespace palpate::lab::pressed_balloon_test
