// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/paper_scenes.hpp"

#include <array>
#include <string>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/core/error.hpp"
#include "palpate/lab/object.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab {
namespace {

constexpr int samples = 7;  // a site, as with the balloon and the teddy bear (section VII)

// One push of `samples` rising forces. False: the user has had enough.
bool push_at(LabRobot& robot, const acquisition::PushPlan& plan, double force_step_n, Push& push, std::vector<double>* true_force_n,
             const OnProgress& progress, double done, double share) {
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = robot.object().travel_limit_m;
  protocol.unloading_steps = 0;
  // A step of the object is a quarter of the way to its limit.
  protocol.force_step_n = force_step_n * 4 / samples;
  // A soft animal pushes back with less than the usual threshold; noise still counts for more.
  protocol.contact.threshold_n = std::min(protocol.contact.threshold_n, 0.2 * protocol.force_step_n);
  std::vector<Step> steps;
  bool wanted = true;
  acquisition::run_push(
      robot, plan, protocol,
      [&](const Push& now, const Step& step) {
        push = now;
        steps.push_back(step);
        if (true_force_n != nullptr) true_force_n->push_back(robot.true_force_n());
      },
      [&] {
        const double part = std::min(1.0, static_cast<double>(steps.size()) / (samples + 1));
        wanted = !progress || progress("pushing", done + share * part);
        return wanted;
      });
  push.steps = std::move(steps);
  return wanted;
}

double young_at(const LabObject& object, const PushSite& site) {
  for (const TrueRegion& one : object.regions)
    if (one.region.name == site.name) return one.young_modulus_pa;
  return object.young_modulus_pa;
}

// clang-format off
constexpr std::array<PaperScene, 4> table{{
    {"cow", "Simulated test on a four-legged animal", "3, 4",
     "E = 1000 N/m2 and nu = 0.3 are found again; the error over (E, nu) is convex around them.",
     "The animal is the lab's own; the pad is soft and 15 mm in radius, the paper pushed at a point.",
     "animal", "realsense_l515", "ideal", 1000, 0.3, 1, 0, 0, {0.03, 0, 0.1}, {0, -0.5, -0.866}},
    {"cube", "Foam cube of 15 cm, time-of-flight camera", "5, 6",
     "Force over travel is nearly straight; E varies little over the samples. No true E is known.",
     "The pad goes 12 mm deep in seven samples, not 9 cm in nine; no slip at the start.",
     "cube", "time_of_flight", "schunk_ftcl_050", 0, 0, 1, 1, 0, {0.03, 0, 0.15}, {0, 0, -1}},
    {"balloon", "Balloon seen once by a stereo camera, back side completed", "1, 7, 8",
     "Seven forces, 815 tetrahedra, 192.5 s and 7 iterations for a force-displacement sample.",
     "A solid ball stands in for the balloon: a pressurised shell has no Young's modulus to compare with.",
     "ball", "bumblebee", "schunk_ftcl_050", 0, 0, 1, 1, 1, {0, 0, 0.052}, {0.5, 0, -0.866}},
    {"teddy", "Teddy bear at head, belly and back, stereo camera", "9, 10",
     "E differs more between the sites than within them: the bear is not homogeneous.",
     "Here its head is 1.4 times as stiff as its belly and its back 1.4 times as soft, and that is known.",
     "bear", "bumblebee", "schunk_ftcl_050", 0, 0, 1.4, 0, 0, {0.03, 0, 0.09}, {-0.4, 0.6, -0.69}},
}};
// clang-format on

}  // namespace

PaperTrial make_paper_trial(const PaperScene& scene, std::uint64_t seed, const OnProgress& progress) {
  ObjectOptions truth;
  truth.seed = seed;
  truth.material = "linear";  // the paper's law at small strains
  if (scene.young_modulus_pa > 0) truth.young_modulus_pa = scene.young_modulus_pa;
  if (scene.poisson_ratio > 0) truth.poisson_ratio = scene.poisson_ratio;
  truth.region_ratio = scene.region_ratio;
  LabOptions options;
  options.seed = seed;
  options.depth = depth_sensor(scene.depth_sensor);
  options.force = force_sensor(scene.force_sensor);
  if (scene.force_sensor == "ideal") options.relaxation = 0;
  LabObject object = make_object(scene.object, truth);
  if (scene.sites > 0) object.sites.resize(static_cast<std::size_t>(scene.sites));
  const PushSite unused = place_on(object, "unused", Vec3(scene.unused_aim_m.data()), Vec3(scene.unused_direction.data()));
  LabRobot robot(options, std::move(object));
  const std::size_t sites = robot.object().sites.size();
  PaperTrial trial;
  trial.recording = robot.scene();
  trial.young_modulus_pa = young_at(robot.object(), robot.object().sites.front());
  trial.poisson_ratio = robot.object().poisson_ratio;
  if (scene.views > 0) {
    trial.recording.rest.surface.reset();
    trial.recording.rest.views = robot.look_around(scene.views);
  }
  const double share = 1 / static_cast<double>(sites + 1);
  for (std::size_t s = 0; s < sites; ++s) {
    const PushSite site = robot.object().sites[s];
    Push push;
    if (!push_at(robot, robot.plan(s), robot.object().force_step_at(site), push, nullptr, progress, share * static_cast<double>(s), share))
      return trial;
    trial.recording.pushes.push_back(std::move(push));
    trial.site_young_pa.push_back(young_at(robot.object(), site));
  }
  const double step_n = robot.object().force_step_at(robot.object().sites.front());
  push_at(robot, robot.plan_at(unused.contact_m, unused.direction), 0.8 * step_n, trial.unused, &trial.unused_force_n, progress,
          1 - share, share);
  return trial;
}

std::span<const PaperScene> paper_scenes() { return table; }

const PaperScene& paper_scene(std::string_view name) {
  std::string names;
  for (const PaperScene& scene : table) {
    if (scene.name == name) return scene;
    names += (names.empty() ? "" : ", ") + std::string(scene.name);
  }
  throw Error("is no scene of the paper; there are: " + names, "--scene " + std::string(name));
}

}  // namespace palpate::lab
