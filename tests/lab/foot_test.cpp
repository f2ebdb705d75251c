// label: oracle
// SPDX-License-Identifier: Apache-2.0
// What an object stands on, built from views from all around that do not show it: its size and its place beside the true foot, in a mesh
// that is fine under a tool. A ball's foot was held up to 3.5 mm beside its middle, which tilts it under every push.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "palpate/identify.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::foot_test {
namespace {

struct Foot {
  double area_m2 = 0;
  Vec3 middle_m = Vec3::Zero();
};

/// Faces in the plane z = 0, as far as the support holds what is near it.
Foot foot_of(const TriMesh& surface, double tolerance_m) {
  Foot foot;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(t, k))); };
    if (std::max({std::abs(corner(0).z()), std::abs(corner(1).z()), std::abs(corner(2).z())}) > tolerance_m) continue;
    const double area_m2 = 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    foot.area_m2 += area_m2;
    foot.middle_m += area_m2 * (corner(0) + corner(1) + corner(2)) / 3;
  }
  foot.middle_m /= foot.area_m2;
  return foot;
}

struct Bars {
  const char* object;
  double area, middle_m;
  std::vector<std::uint64_t> seeds = {1, 2, 3};
};

class BuiltFoot : public testing::TestWithParam<Bars> {};

TEST_P(BuiltFoot, IsWhereTheTrueOneIs) {
  const auto& [name, area, middle_m, seeds] = GetParam();
  for (const std::uint64_t seed : seeds) {
    LabOptions options;
    options.seed = seed;
    LabRobot robot(options, make_object(name, {}));
    Recording recording = robot.scene();
    const Foot truth = foot_of(*recording.rest.surface, 1e-6);
    recording.rest.surface.reset();
    recording.rest.views = robot.look_around(5);
    for (const PushSite& site : robot.object().sites) {  // the mesh is fine where a tool touches
      Load load;
      load.tool = recording.tools.front().name;
      load.contact_m = site.contact_m, load.direction = site.direction;
      load.force_n = Vec3(0.1 * site.direction);
      Push push;
      push.name = push.site = site.name;
      push.steps.emplace_back().loads.push_back(load);
      recording.pushes.push_back(push);
    }
    ShapeOfViews views;
    build_simulated_object(recording, {}, reconstruction::Completion::mirrored, nullptr, &views);
    const Foot built = foot_of(*recording.rest.surface, recording.supports.front().tolerance_m);
    const Vec3 aside = built.middle_m - truth.middle_m;
    std::printf("%s seed %d: area %.2f of the true one, its middle %+.1f, %+.1f mm aside; nothing seen below %.1f mm\n", name,
                static_cast<int>(seed), built.area_m2 / truth.area_m2, 1e3 * aside.x(), 1e3 * aside.y(), 1e3 * views.strip_m);
    EXPECT_NEAR(built.area_m2 / truth.area_m2, 1, area) << name << seed;
    EXPECT_LT(aside.norm(), middle_m) << name << seed;
    EXPECT_GT(views.strip_m, 0.004);
    EXPECT_LT(views.strip_m, 0.02);
    EXPECT_GT(recording.rest.surface_std_m, 1e-4);  // what poses and faces leave, and not only noise
    EXPECT_LT(recording.rest.surface_std_m, 8e-4);
  }
}

// Cubes 18 and 22 were left without a corner: 0.91 and 0.84 of the area, and 5 and 8 mm aside.
INSTANTIATE_TEST_SUITE_P(Objects, BuiltFoot,
                         testing::Values(Bars{"ball", 0.12, 0.0015}, Bars{"cube", 0.06, 0.003, {1, 2, 3, 18, 22}}, Bars{"bear", 0.2, 0.004}),
                         [](const auto& bars) { return std::string(bars.param.object); });

}  // namespace
}  // namespace palpate::lab::foot_test
