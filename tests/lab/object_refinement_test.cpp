// label: statistics
// SPDX-License-Identifier: Apache-2.0
// How far the lab's own mesh moves the truth: travel goes with 1/E; and how far it moves what is estimated from all that is seen of
// it. docs/lab.md holds the figures.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/lab/object.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::object_refinement_test {
namespace {

struct Case {
  std::string name, object;
  double most = 0.004;  ///< a fifth of what the estimator states of E (docs/uncertainty.md): 2 % unless said otherwise
  double region_ratio = 1;
};
void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

class Refinement : public testing::TestWithParam<Case> {};

ObjectOptions truth_of(const Case& one) {
  ObjectOptions options;
  options.material = "linear";  // one solve a mesh; the error of the mesh is that of small strains
  options.young_modulus_pa = 15e3;
  options.poisson_ratio = 0.3;
  options.region_ratio = one.region_ratio;
  return options;
}

/// Every edge shorter by the same share, 0.7: a mesh that is finer under the pad alone has few elements left for the rest of the
/// object, and may be the stiffer one.
ObjectOptions finer_everywhere(ObjectOptions options) {
  options.tetrahedra *= 3;
  options.cells_in_radius = 7;
  return options;
}

/// What the lab shows of an object under one newton at one of its sites; it is linear, so under every other force too.
struct Shown {
  Shown(const LabObject& object, const PushSite& site) {
    const auto pressed = object.press(site);
    pressed->press(0);
    rest = pressed->surface();
    pressed->press(1);
    travel_m = pressed->travel_m();
    moved_m = pressed->surface().vertices_m - rest.vertices_m;
    tree = std::make_unique<geometry::TriangleTree>(rest);
  }
  void press(double force_n) { tree->refit(rest.vertices_m + force_n * moved_m); }
  TriMesh rest;
  Points moved_m;
  double travel_m = 0;
  std::unique_ptr<geometry::TriangleTree> tree;
};

/// Depths along the optical axis are changed by what the surface is moved from one mesh to the other, with the noise that they have.
void change(DepthFrame& image, const Shown& from, const Shown& to) {
  constexpr double the_objects_m = 0.02;
  const Vec3 eye_m = image.T_base_camera.translation();
  for (Index row = 0; row < image.depth_m.rows(); ++row) {
    for (Index column = 0; column < image.depth_m.cols(); ++column) {
      float& depth_m = image.depth_m(row, column);
      if (!(depth_m > 0)) continue;
      const Vec3 ray = image.T_base_camera.linear() * Vec3((double(column) - image.camera.cx_px) / image.camera.fx_px,
                                                           (double(row) - image.camera.cy_px) / image.camera.fy_px, 1);
      const auto before = from.tree->cast(eye_m, ray), after = to.tree->cast(eye_m, ray);
      if (before && after && std::abs(before->range_m - double(depth_m)) < the_objects_m) depth_m += float(after->range_m - before->range_m);
    }
  }
}

TEST_P(Refinement, MovesTheTruthLittle) {
  const ObjectOptions options = truth_of(GetParam());
  const auto travel_of = [&](const ObjectOptions& mesh, std::size_t site) {
    const LabObject object = make_object(GetParam().object, mesh);
    const auto pressed = object.press(object.sites[site]);
    pressed->press(1.0);
    std::printf("%s %s: %d nodes, %.5f mm per N\n", GetParam().name.c_str(), object.sites[site].name.c_str(), int(pressed->nodes()),
                1e3 * pressed->travel_m());
    return pressed->travel_m();
  };
  for (std::size_t site = 0; site < make_object(GetParam().object, options).sites.size(); ++site) {
    const double usual = travel_of(options, site), fine = travel_of(finer_everywhere(options), site);
    EXPECT_LT(std::abs(usual / fine - 1), GetParam().most) << "site " << site;
  }
}

// One recording of the usual truth, and the same one, noise and all, as a finer truth would have moved under the same forces.
TEST_P(Refinement, MovesTheAnswerLittle) {
  constexpr double most_stds = 0.2;  // a fifth of what the answer states
  const ObjectOptions options = truth_of(GetParam());
  const LabObject fine = make_object(GetParam().object, finer_everywhere(options));
  LabOptions lab;
  LabRobot robot(lab, make_object(GetParam().object, options));
  Recording usual = robot.scene();
  usual.model.material = options.material;
  Recording finer = usual;
  const LabObject& object = robot.object();
  for (std::size_t site = 0; site < object.sites.size(); ++site) {
    acquisition::PushOptions protocol;
    protocol.travel_limit_m = object.travel_limit_m;
    protocol.unloading_steps = 0;
    protocol.force_step_n = object.force_step_at(object.sites[site]);
    Shown before(object, object.sites[site]), after(fine, object.sites[site]);
    Push recorded, moved;
    acquisition::run_push(robot, robot.plan(site), protocol, [&](const Push& push, const Step& step) {
      const auto append = [&](Push& to) {
        const std::vector<Step> steps = std::move(to.steps);
        to = push;
        to.steps = steps;
        to.steps.push_back(step);
      };
      append(recorded);
      append(moved);
      const double force_n = robot.true_force_n();
      before.press(force_n);
      after.press(force_n);
      for (Observation& seen : moved.steps.back().observations) {
        if (auto* image = std::get_if<DepthFrame>(&seen)) change(*image, before, after);
        if (auto* travel = std::get_if<ToolTravel>(&seen)) travel->travel_m += force_n * (after.travel_m - before.travel_m);
      }
    });
    usual.pushes.push_back(recorded);
    finer.pushes.push_back(moved);
  }
  const Identification answer = identify(usual).answer, other = identify(finer).answer;
  ASSERT_EQ(answer.parameters.size(), other.parameters.size());
  for (std::size_t k = 0; k < answer.parameters.size(); ++k) {
    const Parameter &p = answer.parameters[k], &q = other.parameters[k];
    std::printf("%s %s%s: %.5g +- %.2g, of the finer truth %+.2f standard deviations\n", GetParam().name.c_str(), p.name.c_str(),
                p.region.empty() ? "" : (" of the " + p.region).c_str(), p.value, p.std, (q.value - p.value) / p.std);
    EXPECT_LT(std::abs(q.value - p.value), most_stds * p.std) << p.name << " " << p.region;
  }
}

// The balloon's skin has a mesh of its own (pressed_balloon_test).
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const BuiltInObject& row : built_in_objects())
    if (row.name != "balloon") all.push_back({std::string(row.name), std::string(row.name), row.name == "bar" ? 0.0023 : row.name == "cube" ? 0.003 : 0.004});
  all.push_back({"bear_in_regions", "bear", 0.004, 1.4});
  return all;
}
INSTANTIATE_TEST_SUITE_P(Objects, Refinement, testing::ValuesIn(cases()), [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace palpate::lab::object_refinement_test
