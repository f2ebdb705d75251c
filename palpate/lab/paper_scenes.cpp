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

// The protocol at every site of the object, `samples` rising forces each.
PaperTrial pushed(const LabOptions& options, LabObject object, int views, const OnProgress& progress) {
  LabRobot robot(options, std::move(object));
  const LabObject& truth = robot.object();
  PaperTrial trial{robot.scene(), truth.young_modulus_pa, truth.poisson_ratio};
  if (views > 0) {
    trial.recording.rest.surface.reset();
    trial.recording.rest.views = robot.look_around(views);
  }
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = truth.travel_limit_m;
  protocol.unloading_steps = 0;
  for (std::size_t site = 0; site < truth.sites.size(); ++site) {
    // A step of the object is a quarter of the way to its limit.
    protocol.force_step_n = truth.force_step_at(truth.sites[site]) * 4 / samples;
    // A soft animal pushes back with less than the usual threshold; noise still counts for more.
    protocol.contact.threshold_n = std::min(protocol.contact.threshold_n, 0.2 * protocol.force_step_n);
    Push push;
    std::vector<Step> steps;
    bool wanted = true;
    acquisition::run_push(
        robot, robot.plan(site), protocol,
        [&](const Push& now, const Step& step) {
          push = now;
          steps.push_back(step);
        },
        [&] {
          const double done = (static_cast<double>(site) + std::min(1.0, static_cast<double>(steps.size()) / (samples + 1))) /
                              static_cast<double>(truth.sites.size());
          wanted = !progress || progress("pushing", done);
          return wanted;
        });
    if (!wanted) break;
    push.steps = std::move(steps);
    trial.recording.pushes.push_back(std::move(push));
  }
  return trial;
}

ObjectOptions drawn(std::uint64_t seed) {
  ObjectOptions options;
  options.seed = seed;
  options.material = "linear";  // the paper's law at small strains
  return options;
}

// Fig. 3 and 4: a simulated test, so the sensors are good ones.
PaperTrial animal(std::uint64_t seed, const OnProgress& progress) {
  ObjectOptions truth = drawn(seed);
  truth.young_modulus_pa = 1000;
  truth.poisson_ratio = 0.3;
  LabOptions options;
  options.seed = seed;
  options.depth = depth_sensor("realsense_l515");
  options.force.sigma_n = 0.001;
  options.force.unit_n = 0;
  options.force.drift_n_s = 0;
  options.relaxation = 0;
  return pushed(options, make_object("animal", truth), 0, progress);
}

PaperTrial cube(std::uint64_t seed, const OnProgress& progress) {
  LabOptions options;
  options.seed = seed;
  options.depth = depth_sensor("time_of_flight");
  options.force = force_sensor("schunk_ftcl_050");
  LabObject object = make_object("cube", drawn(seed));
  object.sites.resize(1);
  return pushed(options, std::move(object), 0, progress);
}

PaperTrial balloon(std::uint64_t seed, const OnProgress& progress) {
  LabOptions options;
  options.seed = seed;
  options.depth = depth_sensor("bumblebee");
  options.force = force_sensor("schunk_ftcl_050");
  LabObject object = make_object("ball", drawn(seed));
  object.sites.resize(1);
  return pushed(options, std::move(object), 1, progress);
}

PaperTrial teddy(std::uint64_t seed, const OnProgress& progress) {
  LabOptions options;
  options.seed = seed;
  options.depth = depth_sensor("bumblebee");
  options.force = force_sensor("schunk_ftcl_050");
  return pushed(options, make_object("bear", drawn(seed)), 0, progress);
}

constexpr std::array<PaperScene, 4> table{{
    {"cow", "Simulated test on a four-legged animal", "3, 4",
     "E = 1000 N/m2 and nu = 0.3 are found again; the error over (E, nu) is convex around them.",
     "The animal is the lab's own; the pad is soft and 15 mm in radius, the paper pushed at a point.", animal},
    {"cube", "Foam cube of 15 cm, time-of-flight camera", "5, 6",
     "Force over travel is nearly straight; E varies little over the samples. No true E is known.",
     "The pad goes 12 mm deep in seven samples, not 9 cm in nine; no slip at the start.", cube},
    {"balloon", "Balloon seen once by a stereo camera, back side completed", "1, 7, 8",
     "Seven forces, 815 tetrahedra, 192.5 s and 7 iterations for a force-displacement sample.",
     "A solid ball stands in for the balloon: a pressurised shell has no Young's modulus to compare with.", balloon},
    {"teddy", "Teddy bear at head, belly and back, stereo camera", "9, 10",
     "E differs more between the sites than within them: the bear is not homogeneous.",
     "This bear is homogeneous, so what the sites differ by is the method's own error.", teddy},
}};

}  // namespace

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
