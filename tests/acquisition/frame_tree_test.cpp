// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/frame_tree.hpp"

#include <gtest/gtest.h>

namespace palpate::acquisition::frame_tree_test {
namespace {

TEST(FrameTree, InterpolatesAndClosesThePath) {
  Pose turned = Pose::Identity();
  turned.translate(Vec3(1, 0, 0)).rotate(Eigen::AngleAxisd(1.0, Vec3::UnitZ()));
  const FrameTree tree({{"base", "arm", false, {{0, Pose::Identity()}, {1, turned}}},
                        {"base", "camera", true, {{0, Pose(Eigen::Translation3d(0, 0, 2))}}},
                        {"elsewhere", "lost", true, {{0, Pose::Identity()}}}});
  const auto half = tree.lookup("base", "arm", 0.25);
  ASSERT_TRUE(half);
  EXPECT_TRUE(half->translation().isApprox(Vec3(0.25, 0, 0)));
  EXPECT_TRUE(half->linear().isApprox(Eigen::AngleAxisd(0.25, Vec3::UnitZ()).toRotationMatrix(), 1e-12));
  EXPECT_EQ(tree.lookup("base", "arm", 1)->matrix(), turned.matrix()) << "a sample comes back as it is";
  const auto across = tree.lookup("camera", "arm", 0.25);
  EXPECT_TRUE(across->translation().isApprox(Vec3(0.25, 0, -2)));
  EXPECT_TRUE((*tree.lookup("arm", "camera", 0.25) * *across).isApprox(Pose::Identity(), 1e-12));
  EXPECT_FALSE(tree.lookup("base", "lost", 0));
  EXPECT_FALSE(tree.connects("base", "lost"));
  EXPECT_FALSE(tree.lookup("base", "arm", 1.5)) << "long after the last sample";
  EXPECT_TRUE(tree.lookup("base", "arm", 1.01));
}

TEST(FrameTree, AGapIsNotBridged) {
  const FrameTree tree({{"base", "arm", false, {{0, Pose::Identity()}, {10, Pose(Eigen::Translation3d(1, 0, 0))}}}});
  EXPECT_FALSE(tree.lookup("base", "arm", 5));
  EXPECT_EQ(tree.lookup("base", "arm", 9.99)->translation().x(), 1);
}

TEST(FrameTree, TimesAreThoseOfTheLinksThatMoveInBetween) {
  const Pose at = Pose::Identity();
  const FrameTree tree({{"base", "arm", false, {{1, at}, {3, at}}},
                        {"arm", "tip", false, {{2, at}, {3, at}}},
                        {"tip", "sensor", true, {{9, at}}},
                        {"base", "camera", false, {{5, at}}},
                        {"elsewhere", "thing", false, {{7, at}}}});
  EXPECT_EQ(tree.times_s("base", "tip"), (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(tree.times_s("sensor", "arm"), (std::vector<double>{2, 3}));
  EXPECT_EQ(tree.times_s("camera", "arm"), (std::vector<double>{1, 3, 5}));
  EXPECT_TRUE(tree.times_s("base", "thing").empty());
  EXPECT_TRUE(tree.times_s("tip", "sensor").empty());
}

}  // namespace
}  // namespace palpate::acquisition::frame_tree_test
