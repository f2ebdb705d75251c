// SPDX-License-Identifier: Apache-2.0
#include "palpate/online.hpp"

#include <algorithm>

#include "palpate/core/error.hpp"
#include "palpate/estimation/finer_model.hpp"

namespace palpate {
namespace {

bool forces(const Load& load) { return load.travel_m || (load.force_n && load.force_n->norm() > 0); }

/// True where a step so far has both a load (or the object's weight) and something that was seen.
bool says_something(const Recording& recording, const estimation::Inputs& inputs) {
  const bool weight = recording.environment.gravity_m_s2.norm() > 0 && recording.rest.state == RestState::stress_free;
  std::size_t s = 0;
  for (const Push& push : recording.pushes) {
    for (const Step& step : push.steps) {
      const bool loaded = weight || std::any_of(step.loads.begin(), step.loads.end(), forces);
      if (loaded && !inputs[s].empty()) return true;
      ++s;
    }
  }
  return false;
}

}  // namespace

OnlineEstimator::OnlineEstimator(const Recording& scene, const IdentifyOptions& options)
    : options_(options), recording_(with_overrides(scene, options)), fit_(options.fit) {
  inputs_ = observe(recording_);
  estimate_.message = "no step was taken in";
}

void OnlineEstimator::begin(const Push& push) {
  for (const Push& known : recording_.pushes) {
    if (known.name == push.name) throw Error("a push of this name was made already", "pushes." + push.name);
  }
  recording_.pushes.push_back(push);
  Recording alone = recording_;
  alone.pushes = {push};
  for (auto& terms : observe(alone)) inputs_.push_back(std::move(terms));
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
  simulated_ = recording_;
  object_ = build_simulated_object(simulated_, progress);
  if (simulated_.model.refine == "auto") {
    if (auto better = estimation::refined_within(simulated_, *object_, options_.mesh_tolerance)) {
      simulated_ = std::move(better->recording);
      object_ = std::move(better->object);
    }
  }
  fit_.forget_object();
}

const Identification& OnlineEstimator::add(const Step& step, const OnProgress& progress) {
  if (recording_.pushes.empty()) throw Error("say which push the step belongs to (begin)", "OnlineEstimator.add");
  Recording alone = recording_;
  alone.pushes = {recording_.pushes.back()};
  alone.pushes.back().steps = {step};
  auto terms = observe(alone).front();
  const bool rebuild = !object_ || new_contact(step);
  recording_.pushes.back().steps.push_back(step);
  inputs_.push_back(std::move(terms));
  try {
    if (!says_something(recording_, inputs_)) {
      estimate_.message = "no load has been seen to deform the object yet";
      object_.reset();
      return estimate_;
    }
    if (rebuild) build(progress);
    simulated_.pushes = recording_.pushes;
    estimate_ = fit_.update(simulated_, *object_, inputs_, progress);
  } catch (...) {
    recording_.pushes.back().steps.pop_back();
    inputs_.pop_back();
    if (rebuild) object_.reset();
    throw;
  }
  return estimate_;
}

Identified OnlineEstimator::answer(const OnProgress& progress) const { return identify(recording_, options_, progress); }

}  // namespace palpate
