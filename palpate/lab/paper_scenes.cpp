// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/paper_scenes.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/core/error.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab {
namespace {

/// How deep a push goes, and in which steps of force.
struct Depth {
  double travel_m = 0, force_step_n = 0;
  int samples = 0;  ///< at most
};

double young_at(const LabObject& object, const PushSite& site) {
  for (const TrueRegion& one : object.regions)
    if (one.region.name == site.name) return one.young_modulus_pa;
  return object.young_modulus_pa;
}

Depth depth_of(const PaperScene& scene, const LabObject& object, const PushSite& site) {
  if (scene.travel_m == 0) {  // a step of the object is a quarter of the way to its limit, were it of one stuff
    const double share = young_at(object, site) / object.young_modulus_pa;
    return {object.travel_limit_m, share * object.force_step_at(site) * 4 / scene.samples, scene.samples + 1};
  }
  // Deep in a block, the curve of a soft pad is nearly straight, at about half the slope of its start on a half space.
  const double start_n_m = 2 * object.pad_radius_m * object.young_modulus_pa / (1 - object.poisson_ratio * object.poisson_ratio);
  return {scene.travel_m, 0.5 * start_n_m * scene.travel_m / scene.samples, scene.samples};
}

bool presses(const Step& step) { return !step.loads.empty(); }

// One push of rising forces; `recorded` is called at every step of it. False: the user has had enough.
// @param why  if given: what ended a push that never pressed
bool push_at(LabRobot& robot, const acquisition::PushPlan& plan, const Depth& depth, Push& push, const std::function<void()>& recorded,
             const OnProgress& progress, double done, double share, std::string* why = nullptr) {
  acquisition::PushOptions protocol;
  protocol.travel_limit_m = depth.travel_m;
  protocol.unloading_steps = 0;
  protocol.force_step_n = depth.force_step_n;
  protocol.force_limit_n = std::max(protocol.force_limit_n, 2 * depth.samples * depth.force_step_n);  // travel is what ends it
  // A soft animal pushes back with less than the usual threshold; noise still counts for more.
  protocol.contact.threshold_n = std::min(protocol.contact.threshold_n, 0.2 * protocol.force_step_n);
  std::vector<Step> steps;
  bool wanted = true;
  const acquisition::PushReport report = acquisition::run_push(
      robot, plan, protocol,
      [&](const Push& now, const Step& step) {
        push = now;
        steps.push_back(step);
        if (recorded) recorded();
      },
      [&] {
        const double part = std::min(1.0, static_cast<double>(steps.size()) / (depth.samples + 1));
        wanted = !progress || progress("pushing", done + share * part);
        return wanted && static_cast<int>(steps.size()) <= depth.samples;
      });
  push.steps = std::move(steps);
  if (why != nullptr && std::none_of(push.steps.begin(), push.steps.end(), presses)) *why = report.message;
  // Asked to stop after the last sample, the arm stands where it is, deep in the object perhaps: no way to the next push.
  if (report.stop == acquisition::StopReason::user) {
    Pose T_base_out = Pose::Identity();
    T_base_out.linear() = plan.R_base_tip;
    T_base_out.translation() = plan.contact_m - protocol.start_distance_m * plan.direction;
    robot.move(T_base_out, protocol.approach_speed_m_s);
  }
  if (report.drift) take_off(*report.drift, push);
  // Sideways the tip is where the plan puts it; one place then serves all seeds.
  for (Step& step : push.steps)
    for (Load& load : step.loads) load.contact_m = plan.contact_m;
  return wanted;
}

// From the sample `first` on (the unloaded step is number 0) the tip was elsewhere, and what the arm's encoders read has come
// deeper by what it lost; the recording goes on saying the first place.
void slip(Push& push, const Push& aside, std::size_t first, double deeper_m) {
  push.steps.resize(std::min(push.steps.size(), first));
  const Vec3 contact_m = push.steps.back().loads.empty() ? Vec3::Zero() : push.steps.back().loads[0].contact_m;
  for (std::size_t s = first; s < aside.steps.size(); ++s) {
    Step step = aside.steps[s];
    for (Load& load : step.loads) load.contact_m = contact_m;
    if (presses(step))
      for (Observation& observation : step.observations)
        if (auto* travel = std::get_if<ToolTravel>(&observation)) travel->travel_m += deeper_m;
    push.steps.push_back(std::move(step));
  }
}

ObjectOptions truth_of(const PaperScene& scene, std::uint64_t seed) {
  ObjectOptions truth;
  truth.seed = seed;
  truth.poisson_steps = 20;
  if (!scene.apparent) truth.material = scene.true_law;  // a skin takes no law but its own
  if (scene.young_modulus_pa > 0) truth.young_modulus_pa = scene.young_modulus_pa;
  if (scene.poisson_ratio > 0) truth.poisson_ratio = scene.poisson_ratio;
  truth.region_ratio = scene.region_ratio;
  if (scene.coarse_truth) {
    truth.tetrahedra = 5000;
    truth.cells_in_radius = 3;
  }
  return truth;
}

LabObject made(const PaperScene& scene, const ObjectOptions& truth) {
  return scene.make != nullptr      ? scene.make(truth)
         : scene.surface != nullptr ? object_from_surface(*scene.surface, std::string(scene.object), truth)
                                    : make_object(scene.object, truth);
}

LabObject object_of(const PaperScene& scene, std::uint64_t seed, PressedMemory& memory) {
  ObjectOptions truth = truth_of(scene, seed);
  LabObject object = made(scene, truth);
  if (scene.sites > 0) object.sites.resize(static_cast<std::size_t>(scene.sites));
  if (scene.apparent) return object;  // a skin under pressure does not scale with its E
  const std::string what = std::string(scene.name) + " " + std::to_string(object.poisson_ratio) + (scene.coarse_truth ? " coarse" : "");
  object.press = [scene, truth, what, &memory, young_modulus_pa = object.young_modulus_pa](const PushSite& site) {
    return memory.at(what, young_modulus_pa, site, [scene, truth](double pa, const PushSite& at) mutable {
      truth.young_modulus_pa = pa;
      return made(scene, truth).press(at);
    });
  };
  return object;
}

// A second pad presses back from below, as hard. The ball between them moves with half of the travel, against the camera: every
// image's pose holds that, and the encoders' travel says nothing of it.
void say_free(Recording& recording, double foot_z_m, double travel_m) {
  recording.free = true;
  recording.supports.clear();
  Tool post = recording.tools.front();
  post.name = "post";
  recording.tools.push_back(post);
  for (Push& push : recording.pushes)
    for (Step& step : push.steps) {
      std::erase_if(step.observations, [](const Observation& one) { return std::holds_alternative<ToolTravel>(one); });
      for (Observation& one : step.observations)
        if (auto* image = std::get_if<DepthFrame>(&one)) image->pose_std_m = std::max(image->pose_std_m, 0.5 * travel_m);
      if (!presses(step)) continue;
      Load back = step.loads.front();
      back.tool = post.name;
      back.force_n = -*back.force_n;
      back.direction *= -1;
      back.contact_m.z() = foot_z_m;
      step.loads.push_back(back);
    }
}

void tilt_cameras(Recording& recording, double tilt_rad) {
  for (Push& push : recording.pushes)
    for (Step& step : push.steps)
      for (Observation& one : step.observations)
        if (auto* image = std::get_if<DepthFrame>(&one)) image->T_base_camera.rotate(Eigen::AngleAxisd(tilt_rad, Vec3::UnitX()));
}

}  // namespace

PaperTrial make_paper_trial(const PaperScene& scene, std::uint64_t seed, const OnProgress& progress, const PaperFault& fault,
                            PressedMemory* memory) {
  PressedMemory of_this_seed;
  LabOptions options;
  options.seed = seed;
  options.depth = depth_sensor(scene.depth_sensor);
  options.force = force_sensor(scene.force_sensor);
  if (scene.force_sensor == "ideal") {  // the paper simulated: no arm's repeat error turns a stick's weight
    options.relaxation = 0;
    options.force.bias_n = options.force.tool_mass_kg = 0;
  }
  LabObject object = object_of(scene, seed, memory != nullptr ? *memory : of_this_seed);
  const PushSite again = object.sites.back();
  const PushSite unused = scene.unused ? place_on(object, "unused", Vec3(scene.unused->aim_m.data()), Vec3(scene.unused->direction.data()))
                                       : again;
  LabRobot robot(options, std::move(object));
  const std::vector<PushSite> sites = robot.object().sites;
  PaperTrial trial;
  trial.recording = robot.scene();
  trial.recording.model.material = scene.law;
  trial.young_modulus_pa = young_at(robot.object(), sites.front());
  trial.poisson_ratio = robot.object().poisson_ratio;
  if (scene.shape != PaperShape::given) {
    trial.recording.rest.surface.reset();
    trial.recording.rest.views = scene.shape == PaperShape::four_views
                                     ? robot.look_around(4)
                                     : robot.look_from({{scene.view_azimuth_rad, scene.view_elevation_rad}});
  }
  const double slip_m = scene.slip_m + fault.slip_m, deeper_m = scene.slip_deeper_m + fault.slip_deeper_m;
  const double share = 1 / static_cast<double>(sites.size() + 1);
  for (std::size_t s = 0; s < sites.size(); ++s) {
    Push push;
    Depth depth = depth_of(scene, robot.object(), sites[s]);
    const int before_slip = scene.slip_m > 0 ? 1 : (depth.samples + 1) / 2;
    const int all = depth.samples;
    if (slip_m > 0) depth.samples = before_slip;
    const auto must_press = [&](const std::string& why) {
      if (!why.empty()) throw Error(why + ", so that there is nothing to estimate from", "push at " + sites[s].name);
    };
    std::string why;
    if (!push_at(robot, robot.plan(s), depth, push, nullptr, progress, share * static_cast<double>(s), share, &why)) return trial;
    must_press(why);
    if (slip_m > 0) {
      Push aside;
      depth.samples = all;
      const Vec3 place_m = sites[s].contact_m + slip_m * acquisition::tip_along(sites[s].direction).col(0);
      if (!push_at(robot, robot.plan_at(place_m, sites[s].direction), depth, aside, nullptr, progress, share * static_cast<double>(s), share, &why))
        return trial;
      must_press(why);
      slip(push, aside, static_cast<std::size_t>(before_slip) + 1, deeper_m);
    }
    trial.recording.pushes.push_back(std::move(push));
    trial.site_young_pa.push_back(young_at(robot.object(), sites[s]));
  }
  Depth depth = depth_of(scene, robot.object(), sites.front());
  depth.force_step_n *= scene.unused ? 0.8 : 0.93;  // other forces than those of the fit
  const auto truth = [&] {
    trial.unused_force_n.push_back(robot.true_force_n());
    if (!trial.recording.supports.empty()) trial.unused_surface.push_back(robot.true_surface());
  };
  push_at(robot, robot.plan_at(unused.contact_m, unused.direction), depth, trial.unused, truth, progress, 1 - share, share, &trial.unused_stop);
  if (trial.recording.supports.empty()) {
    trial.recording.pushes.push_back(std::move(trial.unused));  // for as long as both are made free
    say_free(trial.recording, robot.object().foot_m.z(), depth.travel_m);
    trial.unused = std::move(trial.recording.pushes.back());
    trial.recording.pushes.pop_back();
  }
  if (fault.camera_tilt_rad != 0) tilt_cameras(trial.recording, fault.camera_tilt_rad);
  trial.recording.tools.front().radius_m *= fault.said_radius;
  return trial;
}

}  // namespace palpate::lab
