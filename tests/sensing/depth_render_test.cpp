// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/depth_render.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/sensing/camera.hpp"

namespace palpate::sensing::depth_render_test {
namespace {

Camera small_camera() {
  Camera camera;
  camera.width_px = 160;
  camera.height_px = 120;
  camera.fx_px = camera.fy_px = 140;
  camera.cx_px = 79.3;
  camera.cy_px = 59.7;
  return camera;
}

// A lumpy closed surface: a latitude-longitude sphere with bumps.
TriMesh lumpy_ball(int rings = 60, int sectors = 80) {
  TriMesh mesh;
  mesh.vertices_m.resize(Eigen::Index(rings + 1) * sectors, 3);
  for (int r = 0; r <= rings; ++r)
    for (int s = 0; s < sectors; ++s) {
      const double theta = M_PI * r / rings, phi = 2 * M_PI * s / sectors;
      const double radius = 0.15 * (1 + 0.2 * std::sin(5 * theta) * std::sin(4 * phi) * std::sin(theta));
      mesh.vertices_m.row(Eigen::Index(r) * sectors + s) << radius * std::sin(theta) * std::cos(phi),
          radius * std::sin(theta) * std::sin(phi), radius * std::cos(theta);
    }
  mesh.triangles.resize(Eigen::Index(2) * rings * sectors, 3);
  for (int r = 0; r < rings; ++r)
    for (int s = 0; s < sectors; ++s) {
      const Index a = r * sectors + s, b = r * sectors + (s + 1) % sectors;
      mesh.triangles.row(2 * (Eigen::Index(r) * sectors + s)) << a, a + sectors, b;
      mesh.triangles.row(2 * (Eigen::Index(r) * sectors + s) + 1) << b, a + sectors, b + sectors;
    }
  return mesh;
}

TEST(DepthRender, AgreesWithARayCasterPixelForPixel) {
  const TriMesh ball = lumpy_ball();
  const Camera camera = small_camera();
  Pose T_base_camera = Pose::Identity();
  T_base_camera.translate(Vec3(0.1, 0.2, -0.3)).rotate(Eigen::AngleAxisd(0.2, Vec3::UnitY()));
  Pose T_base_mesh = Pose::Identity();
  T_base_mesh.translate(Vec3(0.2, 0.15, 0.3)).rotate(Eigen::AngleAxisd(1.1, Vec3(1, 1, 0).normalized()));
  const DepthImage image = render_depth({{&ball, T_base_mesh}}, camera, T_base_camera);

  const geometry::TriangleTree tree(ball);
  const Pose T_mesh_camera = T_base_mesh.inverse() * T_base_camera;
  int seen = 0, disagree = 0;
  double worst = 0;
  for (int row = 0; row < camera.height_px; ++row)
    for (int column = 0; column < camera.width_px; ++column) {
      const Vec3 ray = T_mesh_camera.linear() * *unproject(camera, Vec2(column, row));
      const auto hit = tree.cast(T_mesh_camera.translation(), ray);
      if (hit) ++seen;
      if (bool(hit) != (image(row, column) > 0))
        ++disagree;
      else if (hit)
        worst = std::max(worst, std::abs(hit->range_m - image(row, column)));
    }
  EXPECT_GT(seen, 3000);
  EXPECT_LE(disagree, 3);  // pixel centres that lie on an edge of the outline to the last digit
  EXPECT_LT(worst, 2e-3);  // at pixels on the rim of a bump; elsewhere rounding of float
}

TEST(DepthRender, ClipsWhatReachesBehindTheCamera) {
  TriMesh floor;  // a large floor under the camera, most of it behind
  floor.vertices_m.resize(3, 3);
  floor.vertices_m << -50, 1, -80, 50, 1, -80, 0, 1, 80;
  floor.triangles.resize(1, 3);
  floor.triangles << 0, 1, 2;
  const Camera camera = small_camera();
  const DepthImage image = render_depth({{&floor, Pose::Identity()}}, camera, Pose::Identity());
  for (int row = 65; row < 120; row += 7) EXPECT_NEAR(image(row, 79), 140 / (row - 59.7), 1e-3 * image(row, 79)) << row;
  EXPECT_EQ(image(50, 79), 0);
}

TEST(DepthRender, WhatLiesFarBesideTheImageIsNotDrawn) {
  // pixels beyond what an int holds, to the right of the image, to the left, above and below
  for (const Vec3& aside : {Vec3(1e5, 0, 0), Vec3(-1e5, 0, 0), Vec3(0, 1e5, 0), Vec3(0, -1e5, 0)}) {
    TriMesh wall;
    wall.vertices_m.resize(3, 3);
    wall.vertices_m << -1, -1, 2e-3, 2, -1, 2e-3, -1, 2, 2e-3;
    wall.triangles.resize(1, 3);
    wall.triangles << 0, 1, 2;
    EXPECT_GT(render_depth({{&wall, Pose::Identity()}}, small_camera(), Pose::Identity()).minCoeff(), 0);
    wall.vertices_m.rowwise() += aside.transpose();
    EXPECT_EQ(render_depth({{&wall, Pose::Identity()}}, small_camera(), Pose::Identity()).maxCoeff(), 0);
  }
}

TEST(DepthRender, NearestBodyWins) {
  const TriMesh ball = lumpy_ball();
  Pose near = Pose::Identity(), far = Pose::Identity();
  near.translate(Vec3(0, 0, 0.5));
  far.translate(Vec3(0, 0, 1.0));
  const DepthImage together = render_depth({{&ball, far}, {&ball, near}}, small_camera(), Pose::Identity());
  const DepthImage alone = render_depth({{&ball, near}}, small_camera(), Pose::Identity());
  EXPECT_EQ(together(60, 79), alone(60, 79));
}

DepthFrame flat_frame(float depth_m) {
  DepthFrame frame;
  frame.camera = small_camera();
  frame.depth_m = DepthImage::Constant(120, 160, depth_m);
  frame.noise = {"constant", 0.001, 0};
  return frame;
}

TEST(RenderMask, BodyAndItsShadowAreInvalidWhatCoversItStays) {
  DepthImage rendered = DepthImage::Zero(120, 160);
  rendered.block(40, 50, 20, 20).setConstant(0.5F);
  DepthFrame frame = flat_frame(0.8F);                      // seen through the body's pixels: behind it
  frame.depth_m.block(40, 50, 20, 10).setConstant(0.501F);  // left half: the body itself
  frame.depth_m.block(40, 50, 5, 20).setConstant(0.3F);     // top: something before it
  frame.depth_m(55, 55) = 0;
  RenderMaskOptions options;
  options.lateral_margin_px = 2;
  options.lateral_margin_m = 0;
  const MaskImage mask = mask_rendered(frame, rendered, options);
  EXPECT_EQ(mask(50, 52), 1);
  EXPECT_EQ(mask(50, 65), 1);
  EXPECT_EQ(mask(42, 60), 0);
  EXPECT_EQ(mask(55, 55), 0);
  EXPECT_EQ(mask(50, 48), 1);  // widened by two pixels, no more
  EXPECT_EQ(mask(50, 47), 0);
  EXPECT_EQ(mask(0, 0), 0);
  options.lateral_margin_m = 0.02;  // 5.6 px more at half a metre
  EXPECT_EQ(mask_rendered(frame, rendered, options)(50, 43), 1);
  EXPECT_EQ(mask_rendered(frame, rendered, options)(50, 41), 0);
}

TEST(RenderMask, BadInputIsNamed) {
  EXPECT_THROW(mask_rendered(flat_frame(1), DepthImage::Zero(3, 3)), Error);
  const DepthImage rendered = DepthImage::Zero(120, 160);
  RenderMaskOptions options;
  for (double* field :
       {&options.depth_margin_m, &options.depth_sigmas, &options.lateral_margin_m, &options.lateral_margin_px}) {
    const double keep = *field;
    *field = -1;
    EXPECT_THROW(mask_rendered(flat_frame(1), rendered, options), Error);
    *field = keep;
  }
  EXPECT_NO_THROW(mask_rendered(flat_frame(1), rendered, options));
}

TEST(DepthRender, WhatIsFarAsideOfABentLensIsNotDrawnIntoThePicture) {
  Camera camera = small_camera();
  camera.distortion = DistortionModel::plumb_bob;
  camera.distortion_coefficients = {-0.3, 0, 0, 0};  // turns back 46 degrees off the axis
  const auto plate = [](double from_m, double to_m) {
    TriMesh mesh;
    mesh.vertices_m.resize(4, 3);
    mesh.vertices_m << from_m, -0.02, 0.5, to_m, -0.02, 0.5, to_m, 0.02, 0.5, from_m, 0.02, 0.5;
    mesh.triangles.resize(2, 3);
    mesh.triangles << 0, 1, 2, 0, 2, 3;
    return mesh;
  };
  const TriMesh aside = plate(0.88, 0.92), reaching_in = plate(0, 0.92), inside = plate(0, 0.5);
  const auto seen = [&](const TriMesh& mesh) {
    return render_depth({{&mesh, Pose::Identity()}}, camera, Pose::Identity());
  };
  EXPECT_EQ((seen(aside).array() > 0).count(), 0);
  // What of it can be seen is drawn as if the rest were not there.
  const DepthImage part = seen(reaching_in), whole = seen(inside);
  EXPECT_GT((whole.array() > 0).count(), 500);
  // Edges are drawn straight between corners, which the lens bends: the outline differs where the pieces are finer.
  EXPECT_LT(((part.array() > 0) != (whole.array() > 0)).count(), 30);
}

}  // namespace
}  // namespace palpate::sensing::depth_render_test
