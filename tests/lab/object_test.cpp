// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/object.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/box_surface.hpp"
#include "palpate/lab/implicit_surface.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::object_test {
namespace {

TEST(ImplicitSurface, SphereHasItsVolumeAndLiesOnItself) {
  const Vec3 centre(0.01, -0.02, 0.06);
  const double radius = 0.05;
  const TriMesh mesh = implicit_surface([&](const Vec3& p) { return (p - centre).norm() - radius; },
                                        {{-0.06, -0.09, 0}, {0.08, 0.05, 0.13}, 0.004});
  const auto check = geometry::check_surface(mesh);
  EXPECT_TRUE(check.watertight());
  EXPECT_EQ(check.components, 1);
  ASSERT_TRUE(check.volume_m3);
  EXPECT_NEAR(*check.volume_m3 / (4.0 / 3 * M_PI * std::pow(radius, 3)), 1, 0.002);
  for (Eigen::Index v = 0; v < mesh.vertices_m.rows(); ++v)
    ASSERT_NEAR((Vec3(mesh.vertices_m.row(v)) - centre).norm(), radius, 1e-7);
}

TEST(ImplicitSurface, IsCutFlatAtItsFoot) {
  const TriMesh mesh = implicit_surface([](const Vec3& p) { return (p - Vec3(0, 0, 0.03)).norm() - 0.05; },
                                        {{-0.06, -0.06, 0}, {0.06, 0.06, 0.1}, 0.003});
  const auto check = geometry::check_surface(mesh);
  EXPECT_TRUE(check.watertight());
  ASSERT_TRUE(check.volume_m3);
  const double height = 0.08, cap = M_PI * height * height * (3 * 0.05 - height) / 3;
  EXPECT_NEAR(*check.volume_m3 / cap, 1, 0.002);
  double foot = 0;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(mesh.vertices_m.row(mesh.triangles(t, k))); };
    if (corner(0).z() > 1e-12 || corner(1).z() > 1e-12 || corner(2).z() > 1e-12) continue;
    foot += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
  }
  EXPECT_NEAR(foot / (M_PI * 0.04 * 0.04), 1, 0.01);
  EXPECT_THROW(implicit_surface([](const Vec3& p) { return p.norm() - 1; }, {{-0.1, -0.1, 0}, {0.1, 0.1, 0.1}, 0.01}), Error);
  EXPECT_THROW(implicit_surface([](const Vec3&) { return 1.0; }, {{-0.1, -0.1, 0}, {0.1, 0.1, 0.1}, 0.01}), Error);
}

// A ratio that changes nothing would be believed to have.
TEST(Regions, AreRefusedWhereAnObjectHasNone) {
  ObjectOptions options;
  options.region_ratio = 3;
  for (const BuiltInObject& row : built_in_objects()) {
    if (row.name == "bar" || row.name == "bear") {
      EXPECT_GT(make_object(row.name, options).regions.size(), 1u) << row.name;
      continue;
    }
    try {
      make_object(row.name, options);
      ADD_FAILURE() << row.name;
    } catch (const Error& error) {
      EXPECT_EQ(error.where(), "ObjectOptions.region_ratio");
      EXPECT_NE(error.message().find("bar, bear"), std::string::npos) << error.message();
    }
  }
  const TriMesh surface = make_object("cube").surface;
  EXPECT_THROW(object_from_surface(surface, "block.obj", options), Error);
  options.region_ratio = 1;
  EXPECT_NO_THROW(object_from_surface(surface, "block.obj", options));
}

// The bar's upper half is four times as stiff: pressed on its end, 5 mm beside its axis, it is two springs in a row, and two
// hinges, beside the dent that the pad makes in the upper half. nu = 0: its clamped end then holds nothing back sideways.
TEST(Regions, OfTheBarAreSpringsInARow) {
  ObjectOptions options;
  options.young_modulus_pa = 200e3;
  options.poisson_ratio = 0;
  options.material = "linear";
  options.tetrahedra = 8000;
  options.cells_in_radius = 2;
  const auto travel_m = [&](double lower_pa, double upper_over_lower) {
    options.young_modulus_pa = lower_pa;
    options.region_ratio = upper_over_lower;
    const LabObject bar = make_object("bar", options);
    const auto pressed = bar.press(bar.sites[1]);
    pressed->press(10);
    return pressed->travel_m();
  };
  constexpr double one = 1 + 1e-9;  // two regions all the same: the mesh is then the same as well
  const double plain = travel_m(200e3, one), stiff = travel_m(800e3, one), both = travel_m(200e3, 4);
  const double area_m2 = 0.08 * 0.08, inertia_m4 = std::pow(0.08, 4) / 12, aside_m = 0.005;
  const double lower_m = 10 * 0.08 / 200e3 * (1 / area_m2 + aside_m * aside_m / inertia_m4);
  EXPECT_NEAR((both - stiff) / (0.75 * lower_m), 1, 0.02);  // elements belong to a half as a whole
  EXPECT_NEAR(plain / stiff, 4, 1e-3);
}

TEST(Regions, AreInTheRecordingWithoutTheirStiffness) {
  ObjectOptions options;
  options.seed = 3;
  options.region_ratio = 1.5;
  const LabObject bear = make_object("bear", options);
  ASSERT_EQ(bear.regions.size(), 3u);
  EXPECT_EQ(bear.regions[0].young_modulus_pa, 1.5 * bear.young_modulus_pa);
  EXPECT_EQ(bear.regions[1].young_modulus_pa, bear.young_modulus_pa / 1.5);
  EXPECT_EQ(bear.regions[2].young_modulus_pa, bear.young_modulus_pa);
  const Recording recording = LabRobot({}, bear).scene();
  ASSERT_EQ(recording.regions.size(), 3u);
  // Every site lies in the region of its name.
  for (const PushSite& site : bear.sites) {
    const auto inside = std::find_if(recording.regions.begin(), recording.regions.end(), [&](const Region& region) {
      return region.select == RegionSelection::rest || ((site.contact_m.array() >= region.box_min_m.array()).all() &&
                                                        (site.contact_m.array() <= region.box_max_m.array()).all());
    });
    EXPECT_EQ(inside->name, site.name);
  }
  EXPECT_TRUE(LabRobot({}, make_object("ball")).scene().regions.empty());
  options.region_ratio = 0;
  EXPECT_THROW(make_object("bear", options), Error);
}

double travel_m(const std::string& object, const std::string& site, const ObjectOptions& options, double force_n) {
  const LabObject made = make_object(object, options);
  const auto at = std::find_if(made.sites.begin(), made.sites.end(), [&](const PushSite& one) { return one.name == site; });
  const auto pressed = made.press(*at);
  for (const double share : {0.25, 0.5, 0.75, 1.0}) pressed->press(share * force_n);  // with friction, the way there counts
  return pressed->travel_m();
}

ObjectOptions coarse(ContactLaw stands, double poisson_ratio) {
  ObjectOptions options;
  options.young_modulus_pa = 200e3;
  options.poisson_ratio = poisson_ratio;
  options.material = "linear";
  options.tetrahedra = 1500;
  options.cells_in_radius = 2;
  options.region_ratio = 1 + 1e-9;  // the same mesh for all, not the one that a glued bar gets for its pad
  options.stands = stands;
  return options;
}

// Stuff that does not spread feels no difference between glue, a rough and a smooth table, as long as nothing lifts off (the pad
// is 5 mm beside the axis of 80 mm). What does spread is held back by glue, less by friction, not at all by a smooth table.
TEST(Standing, CountsForWhatSpreads) {
  const auto travels = [](double poisson_ratio) {
    return std::array{travel_m("bar", "end", coarse(ContactLaw::bonded, poisson_ratio), 10),
                      travel_m("bar", "end", coarse(ContactLaw::friction, poisson_ratio), 10),
                      travel_m("bar", "end", coarse(ContactLaw::frictionless, poisson_ratio), 10)};
  };
  // Rough and smooth share a mesh; the glued one is finer at its rim.
  const auto still = travels(0), spread = travels(0.45);
  EXPECT_NEAR(still[1] / still[0], 1, 0.03);
  EXPECT_NEAR(still[2] / still[1], 1, 2e-3);
  EXPECT_GT(spread[2] / spread[1], still[2] / still[1] + 0.003) << spread[0] << " " << spread[1] << " " << spread[2];
  EXPECT_GT(spread[2] / spread[0], still[2] / still[0] + 0.003);
}

// Coulomb: pushed more sideways than friction bears, nothing holds the cube but a wall behind it.
TEST(Standing, AWallHoldsWhatFrictionDoesNot) {
  ObjectOptions options = coarse(ContactLaw::friction, 0.3);
  options.region_ratio = 1;
  options.friction_coefficient = 0.3;
  options.tetrahedra = 300;
  options.cells_in_radius = 1;
  options.wall = true;
  const LabObject walled = make_object("cube", options);
  ASSERT_EQ(walled.supports.size(), 2u);
  EXPECT_EQ(walled.supports[1].kind, SupportKind::wall);
  EXPECT_NEAR(walled.supports[1].plane.point_m.x(), options.base_centre_m.x() + 0.075, 1e-12);
  const PushSite at = walled.sites.back();
  EXPECT_EQ(at.name, "to the wall");
  EXPECT_NEAR(at.contact_m.x(), options.base_centre_m.x() - 0.075, 1e-9);
  const auto held = walled.press(at);
  held->press(5);
  EXPECT_GT(held->travel_m(), 0);
  EXPECT_LT(held->travel_m(), 0.01);
  // Nothing goes through the wall.
  EXPECT_LT(held->surface().vertices_m.col(0).maxCoeff(), walled.supports[1].plane.point_m.x() + 1e-5);

  options.wall = false;
  const LabObject open = make_object("cube", options);
  EXPECT_THROW(open.press(at)->press(5), Error);

  const LabRobot robot({}, walled);
  EXPECT_EQ(robot.scene().environment.planes.size(), 2u);
  EXPECT_EQ(robot.scene().supports[1].contact, ContactLaw::friction);
  for (const DepthFrame& frame : robot.look_around(5))  // no view from behind the wall
    EXPECT_LT(frame.T_base_camera.translation().x(), walled.supports[1].plane.point_m.x() + 0.05);
  options.wall = true;
  EXPECT_THROW(make_object("balloon", options), Error);
  // A round side touches a wall at a point: there is nothing to glue.
  options.stands = ContactLaw::bonded;
  EXPECT_THROW(make_object("ball", options), Error);
}

TEST(Standing, AFilesAxesTurnWithoutMirroring) {
  const TriMesh box = make_object("cube", {}).surface;
  for (const int up : {0, 1, 2}) {
    TriMesh tall = box;
    tall.vertices_m.col(up) *= 3;
    const TriMesh turned = turned_and_scaled(tall, up, 0.3);
    const Vec3 extent_m = (turned.vertices_m.colwise().maxCoeff() - turned.vertices_m.colwise().minCoeff()).transpose();
    EXPECT_NEAR(extent_m.z(), 0.3, 1e-12) << up;
    EXPECT_NEAR(extent_m.x(), 0.1, 1e-12) << up;
    EXPECT_NEAR(*geometry::check_surface(turned).volume_m3, 0.003, 1e-9) << up;
  }
  EXPECT_THROW(turned_and_scaled(box, 3, 0), Error);
}

class Objects : public testing::TestWithParam<std::string> {};

TEST_P(Objects, AreClosedStandOnTheTableAndCanBeReached) {
  ObjectOptions options;
  options.seed = 4;
  const LabObject object = make_object(GetParam(), options);
  const auto check = geometry::check_surface(object.surface);
  EXPECT_TRUE(check.watertight()) << check.boundary_edges << " " << check.non_manifold_edges << " " << check.inconsistent_edges;
  EXPECT_EQ(check.components, 1);
  ASSERT_TRUE(check.volume_m3);
  EXPECT_GT(*check.volume_m3, 1e-4);
  EXPECT_NEAR(check.min_m.z(), options.base_centre_m.z(), 1e-9);
  EXPECT_GE(object.young_modulus_pa, 10e3);
  const geometry::TriangleTree tree(object.surface);
  ASSERT_FALSE(object.sites.empty());
  LabOptions lab;
  LabRobot robot(lab, object);
  for (std::size_t s = 0; s < object.sites.size(); ++s) {
    const PushSite& site = object.sites[s];
    EXPECT_LT((tree.closest(site.contact_m).point_m - site.contact_m).norm(), 1e-9);
    // From the start of the approach to beyond the deepest travel, with the force still zero before contact.
    const acquisition::PushPlan plan = robot.plan(s);
    for (const double along : {-0.05, -0.01}) {
      Pose pose = Pose::Identity();
      pose.linear() = plan.R_base_tip;
      pose.translation() = plan.contact_m + along * plan.direction;
      EXPECT_EQ(robot.move(pose, 0.1), acquisition::Motion::done) << site.name;
      EXPECT_EQ(robot.true_force_n(), 0) << site.name;
    }
  }
}

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const BuiltInObject& row : built_in_objects()) all.emplace_back(row.name);
  return all;
}
INSTANTIATE_TEST_SUITE_P(Table, Objects, testing::ValuesIn(names()), [](const auto& name) { return name.param; });

TEST(Object, SeedDrawsTheTruthAndOptionsFixIt) {
  ObjectOptions options;
  options.seed = 1;
  const LabObject a = make_object("cube", options), b = make_object("cube", options);
  EXPECT_EQ(a.young_modulus_pa, b.young_modulus_pa);
  options.seed = 2;
  EXPECT_NE(make_object("cube", options).young_modulus_pa, a.young_modulus_pa);
  options.young_modulus_pa = 12345;
  options.poisson_ratio = 0.2;
  EXPECT_EQ(make_object("cube", options).young_modulus_pa, 12345);
  EXPECT_EQ(make_object("cube", options).poisson_ratio, 0.2);
  EXPECT_THROW(make_object("jelly", options), Error);
  options.material = "jelly";
  EXPECT_THROW(make_object("cube", options), Error);
  options.material = "linear";
  options.poisson_ratio = 0.5;
  EXPECT_THROW(make_object("cube", options), Error);
  options = {};
  options.albedo = 0;
  EXPECT_THROW(make_object("cube", options), Error);
  // A skin is what it is: what it cannot take is refused, not passed over.
  options = {};
  options.poisson_ratio = 0.3;
  EXPECT_THROW(make_object("balloon", options), Error);
  options = {};
  options.material = "foam";
  EXPECT_THROW(make_object("balloon", options), Error);
}

// The foam law (alpha = 4) is that of small strains at first, and softer than a Neo-Hookean solid further in.
TEST(Object, AFoamTruthSoftens) {
  ObjectOptions options;
  options.young_modulus_pa = 15e3;
  options.poisson_ratio = 0.2;
  options.cells_in_radius = 3;
  const auto travel_m = [&](const char* law, double force_n) {
    options.material = law;
    const LabObject object = make_object("cube", options);
    const auto pressed = object.press(object.sites[0]);
    pressed->press(force_n);
    return pressed->travel_m();
  };
  const double deep_n = 4 * make_object("cube", options).force_step_n, touch_n = 1e-3 * deep_n;
  EXPECT_NEAR(travel_m("foam", touch_n) / travel_m("linear", touch_n), 1, 2e-3);
  EXPECT_GT(travel_m("foam", deep_n) / travel_m("neo_hookean", deep_n), 1.02);
}

// Cameras see the dent, not the facets that a file happens to have.
TEST(Object, ABoxOfTwelveTrianglesIsDentedInTheMiddleOfAFace) {
  ObjectOptions options;
  options.material = "linear";
  options.tetrahedra = 2000;
  options.cells_in_radius = 2;
  const LabObject box = object_from_surface(box_surface({-0.05, -0.05, 0}, {0.05, 0.05, 0.1}, 1), "box", options);
  const PushSite& top = box.sites.at(0);
  const auto pressed = box.press(top);
  pressed->press(1);
  const geometry::TriangleTree seen(pressed->surface());
  const auto down_m = [&](double aside_m) { return seen.cast(top.contact_m + Vec3(aside_m, 0, 0.02), -Vec3::UnitZ())->range_m - 0.02; };
  EXPECT_NEAR(down_m(0), pressed->travel_m(), 0.25 * pressed->travel_m());  // the middle of a patch goes deepest
  EXPECT_GT(down_m(0), pressed->travel_m());
  EXPECT_LT(down_m(2 * box.pad_radius_m), 0.5 * down_m(0)) << "and what is not under it stays behind";
}

TEST(Object, AnySurfaceOfAUserStandsOnTheTable) {
  const TriMesh egg = implicit_surface([](const Vec3& p) { return ellipsoid(p, {1, 2, 3.05}, {0.04, 0.05, 0.05}); },
                                       {{0.95, 1.94, 2.99}, {1.05, 2.06, 3.11}, 0.006});
  ObjectOptions options;
  const LabObject object = object_from_surface(egg, "egg", options);
  EXPECT_NEAR(object.surface.vertices_m.col(2).minCoeff(), options.base_centre_m.z(), 1e-9);
  EXPECT_NEAR(object.surface.vertices_m.col(0).mean(), options.base_centre_m.x(), 1e-3);
  ASSERT_EQ(object.sites.size(), 1u);
  auto pressed = object.press(object.sites[0]);
  pressed->press(0.2 * object.force_step_n);
  EXPECT_GT(pressed->travel_m(), 1e-4);
  EXPECT_LT(pressed->travel_m(), 1e-2);
  // Nothing stands above a ring's middle: it is pushed where it is highest.
  const TriMesh ring = implicit_surface(
      [](const Vec3& p) { return std::hypot(std::hypot(p.x(), p.y()) - 0.06, p.z() - 0.02) - 0.02; }, {{-0.09, -0.09, -0.01}, {0.09, 0.09, 0.05}, 0.005});
  const LabObject torus = object_from_surface(ring, "ring", options);
  EXPECT_NEAR(torus.sites[0].contact_m.z(), options.base_centre_m.z() + 0.04, 1e-3);
  EXPECT_NEAR((torus.sites[0].contact_m - options.base_centre_m).head<2>().norm(), 0.06, 5e-3);
  TriMesh open = egg;
  open.triangles.conservativeResize(open.triangles.rows() - 1, 3);
  EXPECT_THROW(object_from_surface(open, "open", options), Error);
  TriMesh huge = egg;
  huge.vertices_m *= 1000;
  EXPECT_THROW(object_from_surface(huge, "huge", options), Error);
}

}  // namespace
}  // namespace palpate::lab::object_test
