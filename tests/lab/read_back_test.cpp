// label: unit
// SPDX-License-Identifier: Apache-2.0
// What the lab recorded is estimated alike whether it is handed over in memory, read from a folder or read from MCAP: every
// quantity that an estimate looks at comes back, numbers that are written as such to the bit, those that a message says in
// other words (a pose as a quaternion, a spread as two samples, a travel as the tip's place) to rounding.
#include "io/read_back.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/identify.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/lab/built_in.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::read_back_test {
namespace {

constexpr double rounding = 1e-12;  // metres, newtons, entries of a rotation: all are of the order of one here

// The demo's cube: tares, offsets and scale of the sensors are stated, every image has a pose of its own.
Recording demo() {
  DemoOptions options;
  options.seed = 5;
  options.levels = 2;
  options.cells_in_radius = 1;
  options.threads = 1;
  return make_demo(options).recording;
}

// A bear in three regions, whose shape is known from images only, standing on a rough table: one slanted push through the
// protocol, with a step on the way back and a stick that yields.
Recording bear() {
  ObjectOptions truth;
  truth.seed = 2;
  truth.region_ratio = 1.4;
  truth.tetrahedra = 1500;
  truth.cells_in_radius = 1;
  LabOptions options;
  options.seed = 2;
  options.compliance_m_per_n = 1e-4;
  LabRobot robot(options, make_object("bear", truth));
  Recording recording = robot.scene();
  recording.rest.views = robot.look_around(2);
  recording.rest.surface.reset();
  recording.supports[0].kind = SupportKind::table;  // what is said of it; the truth is glued, which is quicker
  recording.supports[0].contact = ContactLaw::friction;
  recording.supports[0].friction_coefficient = 0.6;
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = 0.004;
  protocol.unloading_steps = 1;
  protocol.force_step_n = robot.object().force_step_at(robot.object().sites[1]);
  recording.pushes.push_back(acquisition::whole_push(robot, robot.plan(1), protocol));
  return recording;
}

void expect_same(const Plane& a, const Plane& b) {
  EXPECT_EQ(a.point_m, b.point_m);
  EXPECT_LT((a.normal - b.normal).norm(), rounding);
}

void expect_same(const DepthFrame& a, const DepthFrame& b) {
  EXPECT_EQ(a.depth_m, b.depth_m);
  EXPECT_EQ(a.mask, b.mask);
  EXPECT_LT((a.T_base_camera.matrix() - b.T_base_camera.matrix()).norm(), rounding);
  EXPECT_EQ(a.pose_std_m, b.pose_std_m);
  EXPECT_EQ(a.pose_std_rad, b.pose_std_rad);
  EXPECT_EQ(a.noise.model, b.noise.model);
  EXPECT_EQ(std::isnan(a.noise.sigma_m), std::isnan(b.noise.sigma_m));
  EXPECT_EQ(a.noise.bias_std_m, b.noise.bias_std_m);
  const Camera &p = a.camera, &q = b.camera;
  EXPECT_EQ((std::vector<double>{p.fx_px, p.fy_px, p.cx_px, p.cy_px}),
            (std::vector<double>{q.fx_px, q.fy_px, q.cx_px, q.cy_px}));
  EXPECT_EQ(p.distortion, q.distortion);
  EXPECT_EQ(p.distortion_coefficients, q.distortion_coefficients);
}

// All that is there before anything is touched.
void expect_same_object(const Recording& a, const Recording& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.description, b.description);
  ASSERT_EQ(a.rest.surface.has_value(), b.rest.surface.has_value());
  if (a.rest.surface) {
    EXPECT_EQ(a.rest.surface->vertices_m, b.rest.surface->vertices_m);
    EXPECT_EQ(a.rest.surface->triangles, b.rest.surface->triangles);
  }
  ASSERT_EQ(a.rest.views.size(), b.rest.views.size());
  for (std::size_t i = 0; i < a.rest.views.size(); ++i) expect_same(a.rest.views[i], b.rest.views[i]);
  EXPECT_EQ(a.rest.state, b.rest.state);
  EXPECT_EQ(a.rest.surface_std_m, b.rest.surface_std_m);
  EXPECT_EQ(a.rest.surface_correlation_m, b.rest.surface_correlation_m);
  EXPECT_EQ(a.free, b.free);
  ASSERT_EQ(a.supports.size(), b.supports.size());
  for (std::size_t i = 0; i < a.supports.size(); ++i) {
    EXPECT_EQ(a.supports[i].kind, b.supports[i].kind);
    EXPECT_EQ(a.supports[i].name, b.supports[i].name);
    expect_same(a.supports[i].plane, b.supports[i].plane);
    EXPECT_EQ(a.supports[i].tolerance_m, b.supports[i].tolerance_m);
    EXPECT_EQ(a.supports[i].contact, b.supports[i].contact);
    EXPECT_EQ(a.supports[i].friction_coefficient, b.supports[i].friction_coefficient);
  }
  ASSERT_EQ(a.regions.size(), b.regions.size());
  for (std::size_t i = 0; i < a.regions.size(); ++i) {
    EXPECT_EQ(a.regions[i].name, b.regions[i].name);
    EXPECT_EQ(a.regions[i].select, b.regions[i].select);
    EXPECT_EQ(a.regions[i].box_min_m, b.regions[i].box_min_m);
    EXPECT_EQ(a.regions[i].box_max_m, b.regions[i].box_max_m);
  }
  EXPECT_EQ(a.environment.gravity_m_s2, b.environment.gravity_m_s2);
  ASSERT_EQ(a.environment.planes.size(), b.environment.planes.size());
  for (std::size_t i = 0; i < a.environment.planes.size(); ++i)
    expect_same(a.environment.planes[i], b.environment.planes[i]);
  ASSERT_EQ(a.tools.size(), b.tools.size());
  for (std::size_t i = 0; i < a.tools.size(); ++i) {
    EXPECT_EQ(a.tools[i].name, b.tools[i].name);
    EXPECT_EQ(a.tools[i].shape, b.tools[i].shape);
    EXPECT_EQ(a.tools[i].radius_m, b.tools[i].radius_m);
    EXPECT_EQ(a.tools[i].contact, b.tools[i].contact);
    EXPECT_EQ(a.tools[i].compliance_m_per_n, b.tools[i].compliance_m_per_n);
    EXPECT_EQ(a.tools[i].compliance_std_m_per_n, b.tools[i].compliance_std_m_per_n);
  }
  EXPECT_EQ(a.density_kg_m3, b.density_kg_m3);
  EXPECT_EQ(a.force_scale_std, b.force_scale_std);
  EXPECT_EQ(a.force_cross_talk_std, b.force_cross_talk_std);
  EXPECT_EQ(a.time_offset_std_s, b.time_offset_std_s);
  EXPECT_EQ(a.model.mesh, b.model.mesh);
  EXPECT_EQ(a.model.element, b.model.element);
  EXPECT_EQ(a.model.refine, b.model.refine);
  EXPECT_EQ(a.model.material, b.model.material);
  EXPECT_EQ(a.model.poisson_lower, b.model.poisson_lower);
  EXPECT_EQ(a.model.poisson_upper, b.model.poisson_upper);
  EXPECT_EQ(a.model.poisson_fixed, b.model.poisson_fixed);
  EXPECT_EQ(a.model.poisson_by_region, b.model.poisson_by_region);
  EXPECT_EQ(a.joint_names, b.joint_names);
  ASSERT_EQ(a.robot.has_value(), b.robot.has_value());
  if (!a.robot) return;
  ASSERT_EQ(a.robot->links.size(), b.robot->links.size());
  ASSERT_EQ(a.robot->joints.size(), b.robot->joints.size());
  for (std::size_t i = 0; i < a.robot->joints.size(); ++i) {
    EXPECT_EQ(a.robot->joints[i].name, b.robot->joints[i].name);
    EXPECT_LT((a.robot->joints[i].T_parent_joint.matrix() - b.robot->joints[i].T_parent_joint.matrix()).norm(), rounding);
  }
}

void expect_same(const Load& a, const Load& b) {
  EXPECT_EQ(a.tool, b.tool);
  ASSERT_TRUE(a.force_n && b.force_n);
  EXPECT_LT((*a.force_n - *b.force_n).norm(), rounding);
  EXPECT_NEAR(a.force_std_n, b.force_std_n, rounding);
  EXPECT_EQ(a.force_relative_std, b.force_relative_std);
  EXPECT_EQ(a.contact_m, b.contact_m);
  EXPECT_LT((a.direction - b.direction).norm(), rounding);
  EXPECT_EQ(a.contact_std_m, b.contact_std_m);
}

void expect_same_step(const Step& a, const Step& b, double start_a_s, double start_b_s) {
  EXPECT_NEAR(a.time_s - start_a_s, b.time_s - start_b_s, 1e-8);  // a bag's clock ticks in nanoseconds
  EXPECT_EQ(a.unloading, b.unloading);
  ASSERT_EQ(a.joints_rad.size(), b.joints_rad.size());
  for (std::size_t i = 0; i < a.joints_rad.size(); ++i) EXPECT_NEAR(a.joints_rad[i], b.joints_rad[i], rounding);
  ASSERT_EQ(a.T_base_tip.has_value(), b.T_base_tip.has_value());
  if (a.T_base_tip) {
    EXPECT_LT((a.T_base_tip->matrix() - b.T_base_tip->matrix()).norm(), rounding);
  }
  ASSERT_EQ(a.loads.size(), b.loads.size());
  for (std::size_t i = 0; i < a.loads.size(); ++i) expect_same(a.loads[i], b.loads[i]);
  ASSERT_EQ(a.observations.size(), b.observations.size());
  for (std::size_t i = 0; i < a.observations.size(); ++i) {
    ASSERT_EQ(a.observations[i].index(), b.observations[i].index());
    if (const auto* frame = std::get_if<DepthFrame>(&a.observations[i])) {
      expect_same(*frame, std::get<DepthFrame>(b.observations[i]));
    } else {
      const auto &was = std::get<ToolTravel>(a.observations[i]), &is = std::get<ToolTravel>(b.observations[i]);
      EXPECT_EQ(was.tool, is.tool);
      EXPECT_NEAR(was.travel_m, is.travel_m, rounding);
      EXPECT_EQ(was.sigma_m, is.sigma_m);
    }
  }
}

// What the fit is handed: as many rays, through the same pixels, as long and as noisy.
void expect_same_inputs(const estimation::Inputs& a, const estimation::Inputs& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t step = 0; step < a.size(); ++step) {
    ASSERT_EQ(a[step].size(), b[step].size()) << step;
    for (std::size_t i = 0; i < a[step].size(); ++i) {
      const auto* was = std::get_if<estimation::RayObservation>(&a[step][i]);
      if (was == nullptr) continue;  // compared with the steps
      const auto& is = std::get<estimation::RayObservation>(b[step][i]);
      ASSERT_EQ(was->rays.pixel, is.rays.pixel) << step;
      EXPECT_GT(was->rays.range_m.size(), 1000) << step;
      EXPECT_LT((was->rays.origins_m - is.rays.origins_m).cwiseAbs().maxCoeff(), rounding);
      EXPECT_LT((was->rays.directions - is.rays.directions).cwiseAbs().maxCoeff(), rounding);
      EXPECT_LT((was->rays.range_m - is.rays.range_m).cwiseAbs().maxCoeff(), rounding);
      EXPECT_LT((was->rays.sigma_m - is.rays.sigma_m).cwiseAbs().maxCoeff(), rounding);
      EXPECT_EQ(was->pose_std_m, is.pose_std_m);
      EXPECT_EQ(was->pose_std_rad, is.pose_std_rad);
      EXPECT_EQ(was->bias_std_m, is.bias_std_m);
    }
  }
}

struct Case {
  const char* name;
  Recording (*make)();
};

class ReadBack : public testing::TestWithParam<Case> {};

TEST_P(ReadBack, FolderAndBagSayWhatTheLabSaid) {
  const Recording made = GetParam().make();
  EXPECT_TRUE(io::check_recording(made).empty());
  for (const char* way : {"folder", "mcap"}) {
    SCOPED_TRACE(way);
    const Recording back = io::test::through(way, made);
    EXPECT_TRUE(io::check_recording(back).empty());
    expect_same_object(made, back);
    ASSERT_EQ(made.pushes.size(), back.pushes.size());
    for (std::size_t p = 0; p < made.pushes.size(); ++p) {
      const Push &a = made.pushes[p], &b = back.pushes[p];
      EXPECT_EQ(a.name, b.name);
      EXPECT_EQ(a.site, b.site);
      EXPECT_EQ(a.force_tare_std_n, b.force_tare_std_n);
      EXPECT_EQ(a.travel_offset_std_m, b.travel_offset_std_m);
      ASSERT_EQ(a.steps.size(), b.steps.size());
      ASSERT_GE(a.steps.size(), 3u);
      for (std::size_t i = 0; i < a.steps.size(); ++i) {
        SCOPED_TRACE(a.name + ", step " + std::to_string(i));
        expect_same_step(a.steps[i], b.steps[i], a.steps[0].time_s, b.steps[0].time_s);
      }
    }
    expect_same_inputs(observe(made), observe(back));
  }
}

INSTANTIATE_TEST_SUITE_P(Labs, ReadBack, testing::Values(Case{"demo", demo}, Case{"bear", bear}),
                         [](const auto& one) { return one.param.name; });

TEST(ReadBack, FolderAndBagGiveTheSameAnswer) {
  const Recording made = demo();
  IdentifyOptions options;
  options.material = "linear";
  options.element = "tet4";
  options.refine = "none";
  options.fit.cross_checks = options.fit.stresses = false;
  const auto answer_of = [&](const char* way) { return identify(io::test::through(way, made), options).answer; };
  const Identification whole = answer_of("memory");
  ASSERT_EQ(whole.termination, Termination::converged) << whole.message;
  for (const char* way : {"folder", "mcap"}) {
    const Identification answer = answer_of(way);
    ASSERT_EQ(answer.termination, Termination::converged) << way << ": " << answer.message;
    ASSERT_EQ(answer.parameters.size(), whole.parameters.size());
    for (std::size_t i = 0; i < whole.parameters.size(); ++i) {
      const Parameter &a = whole.parameters[i], &b = answer.parameters[i];
      EXPECT_EQ(a.name, b.name);
      EXPECT_NEAR(a.value, b.value, 1e-6 * a.std) << way << " " << a.name;
      EXPECT_NEAR(a.std, b.std, 1e-6 * a.std) << way << " " << a.name;
      EXPECT_NEAR(a.lower_95, b.lower_95, 1e-6 * a.std) << way << " " << a.name;
      EXPECT_NEAR(a.upper_95, b.upper_95, 1e-6 * a.std) << way << " " << a.name;
    }
  }
}

}  // namespace
}  // namespace palpate::lab::read_back_test
