// label: unit
// SPDX-License-Identifier: Apache-2.0
// Pictures of shapes, by what has to be where in them.
#include "palpate/report/mesh_picture.hpp"

#include <gtest/gtest.h>

#include <array>

#include "palpate/report/axes.hpp"
#include "report/pressed_block.hpp"

namespace palpate::report::mesh_picture_test {
namespace {

std::array<int, 4> pixel(const Picture& picture, int x, int y) {
  const std::size_t at = 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(x));
  return {picture.rgba[at], picture.rgba[at + 1], picture.rgba[at + 2], picture.rgba[at + 3]};
}

int coloured(const Picture& picture, const Colour& colour) {
  int count = 0;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) count += pixel(picture, x, y) == std::array<int, 4>{colour.r, colour.g, colour.b, 255};
  return count;
}

TEST(MeshPicture, ASurfaceIsThereWithItsEdgesAndItsSidesDiffer) {
  const Picture picture = draw_surface(pressed_block::block(4), 120, 100);
  ASSERT_EQ(picture.width, 120);
  ASSERT_EQ(picture.height, 100);
  EXPECT_EQ(pixel(picture, 0, 0)[3], 0) << "nothing beside it";
  EXPECT_EQ(pixel(picture, 60, 50)[3], 255);
  int dark = 0, light = 0;  // edges, and the side that faces the light
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 120; ++x)
      if (pixel(picture, x, y)[3] == 255) dark += pixel(picture, x, y)[2] < 100, light += pixel(picture, x, y)[2] > 180;
  EXPECT_GT(dark, 100);
  EXPECT_GT(light, 100);
  EXPECT_EQ(pixel(draw_surface({}, 10, 10), 5, 5)[3], 0);
}

TEST(MeshPicture, EveryCloudHasAColourAndWhatIsInFrontCovers) {
  const TriMesh block = pressed_block::block(2);
  Points top(1, 3), foot(1, 3);
  top << 0.075, 0.075, 0.15;
  foot << -0.075, -0.075, 0;
  const std::array<Points, 2> both{top, foot};
  const Picture picture = draw_clouds(both, block.vertices_m, 120, 120);
  EXPECT_GT(coloured(picture, category(0)), 1);
  EXPECT_GT(coloured(picture, category(1)), 1);
  const std::array<Points, 2> one_place{top, top};
  EXPECT_EQ(coloured(draw_clouds(one_place, block.vertices_m, 120, 120), category(1)), 0) << "where the first one is";
  EXPECT_EQ(pixel(draw_clouds({}, block.vertices_m, 10, 10), 5, 5)[3], 0);
}

}  // namespace
}  // namespace palpate::report::mesh_picture_test
