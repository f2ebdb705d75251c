// label: unit
// SPDX-License-Identifier: Apache-2.0
// What supports hold of a mesh.
#include "palpate/estimation/held_body.hpp"

#include <gtest/gtest.h>

#include <ctime>
#include <numeric>

#include "estimation/scenes.hpp"

namespace palpate::estimation::held_body_test {
namespace {

/// A sheet that is glued to a board has all its nodes held. The processor's time: other programs may run.
TEST(HeldBody, ManyHeldNodesTakeNoLongerThanTheyMust) {
  const TetMesh mesh = kuhn_block(130, 75, 1, Vec3(0.13, 0.075, 0.001));
  Support glue;
  glue.name = "glue";
  glue.vertices.resize(static_cast<std::size_t>(mesh.nodes_m.rows()));
  std::iota(glue.vertices.begin(), glue.vertices.end(), Index{0});
  const std::clock_t before = std::clock();
  const HeldBody body = hold(mesh, {glue}, {});
  EXPECT_LT(static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC, 3);
  EXPECT_EQ(body.constraints.size(), glue.vertices.size());
  EXPECT_EQ(body.free_motions.cols(), 0);
}

TEST(HeldBody, WhatIsNotHeldIsPinnedAndSaid) {
  const TetMesh mesh = kuhn_block(4, 3, 2, block_size_m);
  EXPECT_EQ(hold(mesh, {}, {}).free_motions.cols(), 6);
  EXPECT_EQ(hold(mesh, {sliding("table", Vec3::Zero(), Vec3::UnitZ())}, {}).free_motions.cols(), 3);
  EXPECT_EQ(hold(mesh, {sliding("table", Vec3::Zero(), Vec3::UnitZ()), sliding("wall", Vec3::Zero(), Vec3::UnitX())}, {}).free_motions.cols(), 1);
}

}  // namespace
}  // namespace palpate::estimation::held_body_test
