// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/built_in.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/box_surface.hpp"
#include "palpate/lab/depth_sensor.hpp"
#include "palpate/lab/pressed_block.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/lab/scene.hpp"
#include "palpate/sensing/depth_render.hpp"

namespace palpate::lab {
namespace {

const Vec3 cube_centre_m(0.6, 0.0, 0.0);  // of its base, in the base frame

// What one push does to the cube: nothing here is measured yet.
struct TruePush {
  std::vector<TriMesh> surfaces;  // a step, base frame
  std::vector<double> force_n, travel_m;
  Index nodes = 0, tetrahedra = 0;
};

PressedBlockOptions block_of(const DemoOptions& options, double site_m, double young_pa, double poisson) {
  PressedBlockOptions block;
  block.size_m = Vec3::Constant(options.edge_m);
  block.pad_radius_m = options.disc_radius_m;
  block.site_m = site_m;
  block.base_centre_m = cube_centre_m;
  block.cells_in_radius = options.cells_in_radius;
  block.material = options.material;
  block.young_modulus_pa = young_pa;
  block.poisson_ratio = poisson;
  return block;
}

TruePush press_step_by_step(const DemoOptions& options, double site_m, double young_pa, double poisson, double level_n,
                            const std::function<bool()>& keep_going) {
  PressedBlock cube(block_of(options, site_m, young_pa, poisson));
  TruePush push;
  push.nodes = Index(cube.mesh().nodes_m.rows());
  push.tetrahedra = Index(cube.mesh().tetrahedra.rows());
  for (int level = 0; level <= options.levels && keep_going(); ++level) {
    if (level > 0) cube.press(level * level_n);
    push.force_n.push_back(level * level_n);
    push.travel_m.push_back(level > 0 ? cube.travel_m() : 0.0);
    push.surfaces.push_back(cube.surface());
  }
  return push;
}

// Pushes do not know of each other, so that the count of threads changes nothing but the time.
std::vector<TruePush> press_all(const DemoOptions& options, double young_pa, double poisson, double level_n,
                                const OnProgress& on_progress) {
  std::vector<TruePush> pushes(options.sites_m.size());
  std::vector<std::exception_ptr> failures(pushes.size());
  std::atomic<std::size_t> next{0}, done{0};
  std::atomic<bool> stop{false};
  std::mutex mutex;
  const auto keep_going = [&] {
    const double share = double(done++) / double(pushes.size() * std::size_t(options.levels + 1));
    const std::lock_guard lock(mutex);
    if (on_progress && !stop && !on_progress("press", std::min(1.0, share))) stop = true;
    return !stop;
  };
  const auto work = [&] {
    for (std::size_t p = next++; p < pushes.size(); p = next++) try {
        pushes[p] = press_step_by_step(options, options.sites_m[p], young_pa, poisson, level_n, keep_going);
      } catch (...) {
        failures[p] = std::current_exception();
      }
  };
  std::vector<std::thread> helpers;
  for (int t = 1; t < std::min(options.threads, int(pushes.size())); ++t) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
  if (stop) throw Error("stopped on request", "make_demo");
  return pushes;
}

// Pad and stick in one surface; the tip's frame has its origin in the pad's face and z along the push.
TriMesh stick(double pad_radius_m) {
  const TriMesh pad = cylinder(pad_radius_m, 0.008), rod = cylinder(0.005, 0.4);
  TriMesh both;
  both.vertices_m.resize(pad.vertices_m.rows() + rod.vertices_m.rows(), 3);
  both.vertices_m << pad.vertices_m, rod.vertices_m;
  both.vertices_m.bottomRows(rod.vertices_m.rows()).col(2).array() += 0.008;
  both.vertices_m.col(2) *= -1;  // behind the tip
  both.triangles.resize(pad.triangles.rows() + rod.triangles.rows(), 3);
  both.triangles << pad.triangles, (rod.triangles.array() + Index(pad.vertices_m.rows())).matrix();
  both.triangles.col(1).swap(both.triangles.col(2));
  return both;
}

Pose tip_pose(double site_m, double height_m) {
  Pose pose = Pose::Identity();
  pose.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  pose.translation() = cube_centre_m + Vec3(site_m, 0, height_m);
  return pose;
}

Pose small_motion(const DemoOptions& options, Random& random) {
  const Vec3 turn = options.camera_std_rad * random.normal3();
  Pose motion = Pose::Identity();
  if (turn.norm() > 0) motion.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  motion.pretranslate(options.camera_std_m * random.normal3());
  return motion;
}

void check(const DemoOptions& o) {
  const auto bad = [](const char* field, const char* rule) { throw Error(rule, std::string("DemoOptions.") + field); };
  if (o.young_modulus_pa && !(*o.young_modulus_pa > 0)) bad("young_modulus_pa", "must be positive");
  if (o.poisson_ratio && !(*o.poisson_ratio >= 0 && *o.poisson_ratio < 0.4999))
    bad("poisson_ratio", "must be in [0, 0.4999)");
  if (!(o.edge_m > 0.02 && o.edge_m < 1)) bad("edge_m", "must be between 0.02 and 1");
  if (!(o.disc_radius_m > 0.002 && o.disc_radius_m < 0.4 * o.edge_m))
    bad("disc_radius_m", "must be above 2 mm and fit on the cube");
  if (o.levels < 1) bad("levels", "must be at least 1");
  if (!(o.depth_m > 0 && o.depth_m <= 0.5 * o.disc_radius_m))
    bad("depth_m", "must be positive and at most half the pad's radius");
  if (o.sites_m.empty()) bad("sites_m", "needs at least one site");
  if (o.cells_in_radius < 1) bad("cells_in_radius", "must be at least 1");
  for (const double* sigma : {&o.force_sigma_n, &o.force_tare_std_n, &o.force_scale_std, &o.travel_sigma_m,
                              &o.travel_offset_std_m, &o.camera_std_m, &o.camera_std_rad})
    if (!(*sigma >= 0)) bad("force_sigma_n ... camera_std_rad", "must not be negative");
}

}  // namespace

Demo make_demo(const DemoOptions& options, const OnProgress& on_progress) {
  check(options);
  enum Stream : std::uint64_t { of_truth, of_force, of_travel, of_pose, of_depth };
  Random truth_random(options.seed, of_truth), force_random(options.seed, of_force), travel_random(options.seed, of_travel),
      pose_random(options.seed, of_pose), depth_random(options.seed, of_depth);

  Demo demo;
  DemoTruth& truth = demo.truth;
  const double drawn_young = 10e3 * std::exp(truth_random.uniform() * std::log(4.0));
  const double drawn_poisson = truth_random.uniform(0.1, 0.45);
  truth.young_modulus_pa = options.young_modulus_pa.value_or(std::round(drawn_young / 10) * 10);
  truth.poisson_ratio = options.poisson_ratio.value_or(std::round(drawn_poisson * 1000) / 1000);
  truth.material = options.material;
  truth.force_scale = 1 + options.force_scale_std * truth_random.normal();

  Recording& recording = demo.recording;
  recording.name = "foam_cube";
  recording.description = "Simulated: a foam cube of " + std::to_string(int(std::lround(options.edge_m * 1000))) +
                          " mm on a table, pressed by a stick with a round soft pad; made by palpate's own lab, seed " +
                          std::to_string(options.seed);
  const Vec3 half(0.5 * options.edge_m, 0.5 * options.edge_m, 0);
  recording.rest.surface = box_surface(cube_centre_m - half, cube_centre_m + half + options.edge_m * Vec3::UnitZ(), 10);
  recording.rest.state = RestState::stress_free;
  Support table;
  table.kind = SupportKind::plane;
  table.name = "table";
  table.tolerance_m = 1e-4;
  recording.supports.push_back(table);
  recording.environment.planes.push_back(Plane{});
  recording.force_scale_std = options.force_scale_std;
  recording.model.material = options.material;
  Tool pad;
  pad.name = "stick";
  pad.shape = ToolShape::disc;
  pad.radius_m = options.disc_radius_m;
  recording.tools.push_back(pad);

  Camera camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx_px = camera.fy_px = 606;  // a D435 at this resolution: 55.7 degrees wide
  camera.cx_px = 322.4;
  camera.cy_px = 238.1;
  DepthSensorOptions sensor;
  sensor.noise.model = options.depth_model;
  const TriMesh stick_mesh = stick(options.disc_radius_m);

  // A punch on a half space presses in by F (1 - nu^2) / (2 a E): a pressure of 2 d / (pi a) times E. A Neo-Hookean solid
  // under a dead uniform pressure of more than about 0.4 E caves in, so the depth asked for is bounded in check().
  const double highest_n = 2 * options.disc_radius_m * truth.young_modulus_pa * options.depth_m;
  const double level_n = std::max(0.05, std::round(highest_n / options.levels * 20) / 20);
  const std::vector<TruePush> pressed =
      press_all(options, truth.young_modulus_pa, truth.poisson_ratio, level_n, on_progress);

  for (std::size_t site = 0; site < options.sites_m.size(); ++site) {
    const double site_m = options.sites_m[site];
    const TruePush& cube = pressed[site];
    truth.nodes = std::max(truth.nodes, cube.nodes);
    truth.tetrahedra = std::max(truth.tetrahedra, cube.tetrahedra);
    truth.force_n.push_back(cube.force_n);
    truth.travel_m.push_back(cube.travel_m);
    geometry::TriangleTree cube_tree(cube.surfaces.front());
    Push push;
    push.name = "push " + std::to_string(site + 1);
    push.force_tare_std_n = options.force_tare_std_n;
    push.travel_offset_std_m = options.travel_offset_std_m;
    const Vec3 tare = options.force_tare_std_n * force_random.normal3();
    const double offset = options.travel_offset_std_m * travel_random.normal();
    truth.force_tare_n.push_back(tare);
    truth.travel_offset_m.push_back(offset);

    for (int level = 0; level <= options.levels; ++level) {
      const double force = cube.force_n[std::size_t(level)], travel = cube.travel_m[std::size_t(level)];
      Step step;
      step.time_s = 4.0 * level;
      // The unloaded step is seen with the stick held 80 mm above the cube.
      const double true_height = options.edge_m - (level > 0 ? travel : -0.08);
      const double read_travel = travel + offset + options.travel_sigma_m * travel_random.normal();
      const double read_height = options.edge_m - (level > 0 ? read_travel : -0.08);
      const Vec3 read_force = truth.force_scale * Vec3(0, 0, -force) + tare + options.force_sigma_n * force_random.normal3();
      step.T_base_tip = tip_pose(site_m, read_height);
      if (level > 0) {
        Load load;
        load.tool = pad.name;
        load.force_n = read_force;
        load.force_std_n = options.force_sigma_n;
        load.contact_m = cube_centre_m + Vec3(site_m, 0, options.edge_m);
        load.direction = -Vec3::UnitZ();
        step.loads.push_back(load);
        ToolTravel encoder;
        encoder.tool = pad.name;
        encoder.travel_m = read_travel;
        encoder.sigma_m = options.travel_sigma_m;
        step.observations.emplace_back(encoder);
      }

      DepthFrame frame;
      frame.time_s = step.time_s;
      frame.camera = camera;
      const Vec3 eye = cube_centre_m + Vec3(-0.32, -0.30, 0.46);
      frame.T_base_camera = look_at(eye, cube_centre_m + Vec3(0, 0, 0.6 * options.edge_m));
      frame.pose_std_m = options.camera_std_m;
      frame.pose_std_rad = options.camera_std_rad;
      frame.noise = stated_noise(sensor);
      const Pose true_camera = frame.T_base_camera * small_motion(options, pose_random);
      cube_tree.refit(cube.surfaces[std::size_t(level)].vertices_m);
      TriMesh posed_stick = stick_mesh;
      const Pose true_tip = tip_pose(site_m, true_height);
      for (Eigen::Index v = 0; v < posed_stick.vertices_m.rows(); ++v)
        posed_stick.vertices_m.row(v) = true_tip * Vec3(stick_mesh.vertices_m.row(v));
      const geometry::TriangleTree stick_tree(posed_stick);
      const Scene scene{{&cube_tree, &stick_tree}, recording.environment.planes};
      frame.depth_m = sense_depth(cast_view(scene, camera, true_camera), camera, sensor, depth_random);
      // What a robot can know: the stick by its model at the measured pose, seen from the nominal camera.
      const DepthImage robot = sensing::render_depth({{&stick_mesh, *step.T_base_tip}}, camera, frame.T_base_camera);
      sensing::RenderMaskOptions margins;
      margins.lateral_margin_m = 0.002;
      frame.mask = sensing::mask_rendered(frame, robot, margins);
      step.observations.emplace_back(std::move(frame));
      push.steps.push_back(std::move(step));
    }
    recording.pushes.push_back(std::move(push));
  }
  return demo;
}

DemoPush demo_push(const DemoOptions& options, double young_modulus_pa, double poisson_ratio, double site_m, double force_n) {
  check(options);
  PressedBlock cube(block_of(options, site_m, young_modulus_pa, poisson_ratio));
  cube.press(force_n);
  return {cube_centre_m + Vec3(site_m, 0, options.edge_m), force_n, cube.travel_m()};
}

Recording make_demo_recording(std::uint64_t seed) {
  DemoOptions options;
  options.seed = seed;
  return make_demo(options).recording;
}

}  // namespace palpate::lab
