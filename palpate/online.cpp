// SPDX-License-Identifier: Apache-2.0
#include "palpate/online.hpp"

#include <algorithm>

#include "palpate/core/error.hpp"
#include "palpate/core/recording_values.hpp"
#include "palpate/estimation/contacts_on_surface.hpp"
#include "palpate/estimation/finer_model.hpp"
#include "palpate/estimation/moved_balls.hpp"
#include "palpate/estimation/slips.hpp"

namespace palpate {
namespace {

bool forces(const Load& load) { return load.travel_m || (load.force_n && load.force_n->norm() > 0); }

/// True where an input tells more than what was imposed on the object does.
bool is_seen(const estimation::TermInput& input, const Step& step) {
  const auto imposed = [&](const std::string& tool, bool travel) {
    return std::any_of(step.loads.begin(), step.loads.end(), [&](const Load& load) {
      return (tool.empty() || load.tool == tool) && load.travel_m.has_value() == travel;
    });
  };
  if (const auto* wrench = std::get_if<Wrench>(&input)) return imposed(wrench->tool, true);
  if (const auto* travel = std::get_if<ToolTravel>(&input)) return imposed(travel->tool, false);
  return true;
}

/// True where a step so far has both a load (or the object's weight) and something that was seen.
bool says_something(const Recording& recording, const estimation::Inputs& inputs) {
  const bool weight = recording.environment.gravity_m_s2.norm() > 0 && recording.rest.state == RestState::stress_free;
  std::size_t s = 0;
  for (const Push& push : recording.pushes) {
    for (const Step& step : push.steps) {
      const bool loaded = weight || std::any_of(step.loads.begin(), step.loads.end(), forces);
      if (loaded && std::any_of(inputs[s].begin(), inputs[s].end(), [&](const auto& one) { return is_seen(one, step); })) return true;
      ++s;
    }
  }
  return false;
}

/// What a model of the step wants to know: not what a camera saw of the surface, which is large.
Step without_surfaces(Step step) {
  std::erase_if(step.observations, [](const Observation& one) { return std::holds_alternative<DepthFrame>(one) || std::holds_alternative<PointCloud>(one); });
  return step;
}

bool is_moved(const Push& push) {
  for (const Step& step : push.steps)
    if (std::any_of(step.loads.begin(), step.loads.end(), [](const Load& load) { return load.travel_m.has_value(); })) return true;
  return false;
}

/// Whether a tool is moved now whose force acted before, or the other way round: another model. With some steps a travel may be lacking.
bool moves_otherwise(const std::vector<Push>& before, const std::vector<Push>& now) {
  for (std::size_t p = 0; p < now.size(); ++p)
    if (is_moved(now[p]) != (p < before.size() && is_moved(before[p]))) return true;
  return false;
}

Push without_surfaces(Push push) {
  for (Step& step : push.steps) step = without_surfaces(std::move(step));
  return push;
}

/// What was seen otherwise of the same steps, and the surfaces as they were.
estimation::Inputs with_surfaces_of(const estimation::Inputs& all, estimation::Inputs others) {
  for (std::size_t s = 0; s < all.size(); ++s)
    for (const estimation::TermInput& one : all[s])
      if (std::holds_alternative<estimation::RayObservation>(one) || std::holds_alternative<PointCloud>(one)) others[s].push_back(one);
  return others;
}

}  // namespace

OnlineEstimator::OnlineEstimator(const Recording& scene, const IdentifyOptions& options)
    : options_(options), recording_(with_overrides(scene, options)), fit_(options.fit) {
  const auto demand = [](bool fine, const std::string& where, const std::string& cure) {
    if (!fine) throw Error(cure, where);
  };
  demand(options.method == "palpate", "method " + options.method, "the paper's method wants all steps at once: call identify");
  demand(options.regions != "by-site" || !recording_.regions.empty(), "regions by-site",
         "no site has been pushed yet: give the recording its regions");
  demand_right_values(wrong_values(recording_));
  take_in(recording_);
  light_ = recording_;
  light_.rest.views.clear();
  for (Push& push : light_.pushes) push = without_surfaces(std::move(push));
  estimate_.message = "no step was taken in";
}

void OnlineEstimator::take_in(const Recording& part) {
  auto all = observe(part);
  std::size_t s = 0;
  for (const Push& push : part.pushes) {
    for (const Step& step : push.steps) {
      std::vector<const DepthFrame*> frames;
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one)) frames.push_back(frame);
      std::size_t frame = 0;
      for (estimation::TermInput& input : all[s])
        if (auto* rays = std::get_if<estimation::RayObservation>(&input)) rays->camera = camera_of(*frames[frame++]);
      ++s;
    }
  }
  for (auto& terms : all) inputs_.push_back(std::move(terms));
}

/// The camera of a frame, told when the frame arrives and not changed by those that come later: one that was at this place before;
/// else one of the same intrinsics that is carried around; else a new one.
std::string OnlineEstimator::camera_of(const DepthFrame& frame) {
  const SeenFrom* carried = nullptr;
  for (const SeenFrom& one : cameras_) {
    if (one.camera != frame.camera) continue;
    if (one.T_base_camera.matrix().isApprox(frame.T_base_camera.matrix(), 1e-9)) {
      const std::string name = one.name;
      cameras_.push_back({frame.camera, frame.T_base_camera, name, true});
      return name;
    }
    const bool stands = std::any_of(cameras_.begin(), cameras_.end(), [&](const SeenFrom& other) { return other.name == one.name && other.again; });
    if (!stands && carried == nullptr) carried = &one;
  }
  const std::string name = carried != nullptr ? carried->name : std::to_string(cameras_.size());
  cameras_.push_back({frame.camera, frame.T_base_camera, name, false});
  return name;
}

void OnlineEstimator::begin(const Push& push) {
  for (const Push& known : light_.pushes) {
    if (known.name == push.name) throw Error("a push of this name was made already", "pushes." + push.name);
  }
  Recording alone = light_;
  alone.pushes = {push};
  if (!alone.rest.volume && !alone.rest.surface) alone.rest.views = recording_.rest.views;  // they are its shape
  demand_right_values(wrong_values(alone));
  take_in(alone);
  recording_.pushes.push_back(push);
  light_.pushes.push_back(without_surfaces(push));
  if (!push.steps.empty()) object_.reset();  // it may touch elsewhere
}

bool OnlineEstimator::new_contact(const Step& step) const {
  for (const Load& load : step.loads) {
    const auto same = [&](const Load& known) {
      return known.tool == load.tool && known.contact_m == load.contact_m && known.travel_m.has_value() == load.travel_m.has_value();
    };
    bool known = false;
    for (const Push& push : recording_.pushes) {
      for (const Step& before : push.steps) known = known || std::any_of(before.loads.begin(), before.loads.end(), same);
    }
    if (!known) return true;
  }
  return false;
}

void OnlineEstimator::build(const OnProgress& progress) {
  const bool out_of_views = !recording_.rest.volume && !recording_.rest.surface;
  simulated_ = estimation::with_balls_moved(out_of_views ? recording_ : light_);
  object_ = build_simulated_object(simulated_, progress);
  if (simulated_.model.refine == "auto") {
    if (auto better = estimation::refined_within(simulated_, *object_, options_.mesh_tolerance)) {
      simulated_ = std::move(better->recording);
      object_ = std::move(better->object);
    }
  }
  simulated_.rest.views.clear();  // the shape is made
  fit_.forget_object();
}

const Identification& OnlineEstimator::add(const Step& step, const OnProgress& progress) {
  if (recording_.pushes.empty()) throw Error("say which push the step belongs to (begin)", "OnlineEstimator.add");
  const std::vector<Step>& before = light_.pushes.back().steps;
  const std::string place = "pushes[" + std::to_string(light_.pushes.size() - 1) + "].steps[" + std::to_string(before.size()) + "].";
  demand_right_values(wrong_values(step, light_.tools, place));
  if (!before.empty() && step.time_s < before.back().time_s) throw Error("goes back, from that of the step before", place + "time_s");
  Recording alone = light_;
  alone.pushes = {light_.pushes.back()};
  alone.pushes.back().steps = {step};
  bool rebuild = !object_ || new_contact(step);
  const std::size_t cameras = cameras_.size();
  take_in(alone);
  recording_.pushes.back().steps.push_back(step);
  light_.pushes.back().steps.push_back(without_surfaces(step));
  try {
    if (!says_something(light_, inputs_)) {
      estimate_.message = "no load has been seen to deform the object yet";
      object_.reset();
      return estimate_;
    }
    Recording moved = estimation::with_balls_moved(light_);
    const bool balls_move = moved.warnings.size() > light_.warnings.size();
    rebuild = rebuild || moves_otherwise(simulated_.pushes, moved.pushes);
    if (rebuild) build(progress);
    // As the object was built with them: the step may touch beside the surface, or be the first after a slip.
    simulated_.pushes = std::move(moved.pushes);
    estimation::put_contacts_on_surface(simulated_, object_->mesh);
    estimation::free_contacts_after_slips(simulated_);
    estimate_ = fit_.update(simulated_, *object_, balls_move ? with_surfaces_of(inputs_, observe(simulated_)) : inputs_, progress);
  } catch (...) {
    recording_.pushes.back().steps.pop_back();
    light_.pushes.back().steps.pop_back();
    inputs_.pop_back();
    cameras_.resize(cameras);
    if (rebuild) object_.reset();
    throw;
  }
  return estimate_;
}

Identified OnlineEstimator::answer(const OnProgress& progress) const { return identify(recording_, options_, progress); }

}  // namespace palpate
