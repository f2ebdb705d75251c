// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/forward_model.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "palpate/core/error.hpp"
#include "palpate/core/observed_travel.hpp"
#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/names_of_unknowns.hpp"
#include "palpate/estimation/slips.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
namespace {

const std::vector<std::string> xyz{"_x", "_y", "_z"};

/// How hard each step presses: its force, or else its imposed travel, as a share of the recording's highest.
std::vector<double> efforts(const Recording& recording) {
  std::vector<double> force, travel;
  for (const auto& push : recording.pushes) {
    for (const auto& step : push.steps) {
      force.push_back(0);
      travel.push_back(0);
      for (const auto& load : step.loads) {
        force.back() += load.force_n.value_or(Vec3::Zero()).norm();
        travel.back() = std::max(travel.back(), std::abs(load.travel_m.value_or(0)));
      }
    }
  }
  const auto highest = [](const std::vector<double>& all) {
    return all.empty() ? 0 : *std::max_element(all.begin(), all.end());
  };
  const double most_n = highest(force), most_m = highest(travel);
  for (std::size_t s = 0; s < force.size(); ++s)
    force[s] = force[s] > 0 ? force[s] / most_n : travel[s] > 0 ? travel[s] / most_m : 0;
  return force;
}

/// Of an imposed motion in this one step: what the encoder that read it says of itself; 0 where none does.
double travel_std_m(const Step& step, const Load& load) {
  const ToolTravel* read = observed_travel(step, load);
  return read != nullptr && read->sigma_m > 0 ? read->sigma_m : 0;
}

}  // namespace

ForwardModel::~ForwardModel() = default;

bool ForwardModel::Solved::holds_for(const Solved& other) const {
  const auto same = [](const VectorX& a, const VectorX& b) { return a.size() == b.size() && a == b; };
  return material == other.material && nodes == other.nodes && vertices == other.vertices && place_m == other.place_m &&
         supports == other.supports && spreads == other.spreads && options.dilatation == other.options.dilatation &&
         options.threads == other.options.threads && options.residual_tolerance == other.options.residual_tolerance &&
         options.region == other.options.region && same(options.region_stiffness, other.options.region_stiffness) &&
         options.region_poisson.size() == other.options.region_poisson.size() &&  // their values are said with every question
         poisson_lower == other.poisson_lower && poisson_upper == other.poisson_upper &&
         response_tolerance == other.response_tolerance && bodies.size() == other.bodies.size();
}

std::shared_ptr<ForwardModel::Solved> ForwardModel::surface_modes() const {
  auto out = std::make_shared<Solved>();
  out->vertices = solved_->vertices;
  out->field = solved_->field;
  out->field_std_m = solved_->field_std_m;
  out->field_correlation_m = solved_->field_correlation_m;
  return out;
}

ForwardModel::ForwardModel(const Recording& recording, SimulatedObject object, Unknowns& unknowns, fem::StaticsOptions options,
                           std::shared_ptr<Solved> earlier, double response_tolerance,
                           std::optional<std::pair<double, double>> poisson_expected)
    : recording_(&recording), object_(std::move(object)), options_(options) {
  // From a hundredth of a pascal to diamond: beyond that the fit has lost its way.
  unknowns.add({"young_modulus", "log Pa", 0, std::numeric_limits<double>::infinity(), std::log(1e-2), std::log(1.2e12)});
  unknowns.add({"poisson_ratio", "1", 0, std::numeric_limits<double>::infinity(), recording.model.poisson_lower,
                recording.model.poisson_upper});
  if (object_.region_names.size() > 1) {
    const std::vector<std::string> further{object_.region_names.begin() + 1, object_.region_names.end()};
    unknowns.add_ratios(further);
    options_.region = object_.region;
    if (recording.model.poisson_by_region && !recording.model.poisson_fixed) {
      if (recording.model.poisson_lower < 0)
        throw Error("regions with a nu of their own need a lower bound of 0 or more", "model.poisson_range");
      unknowns.add_own_poisson(further, recording.model.poisson_lower, recording.model.poisson_upper);
    }
  }
  parameters_ = unknowns.parameter_count();
  first_own_poisson_ = unknowns.first_own_poisson();
  options_.region_poisson = region_poisson(unknowns.prior_mean());
  force_scale_ = unknowns.add_block("force_scale", "1", recording.force_scale_std, {""});
  const bool moves = std::any_of(recording.pushes.begin(), recording.pushes.end(), [](const Push& push) {
    return std::any_of(push.steps.begin(), push.steps.end(), [](const Step& step) {
      return std::any_of(step.loads.begin(), step.loads.end(), [](const Load& load) { return !load.force_rate_n_s.isZero(0); });
    });
  });
  if (moves) time_offset_ = unknowns.add_block("time_offset", "s", recording.time_offset_std_s, {""});
  for (const Tool& one : recording.tools) {
    if (one.compliance_std_m_per_n > 0)
      compliance_[one.name] = unknowns.add({"compliance[" + one.name + "]", "m/N", 0, one.compliance_std_m_per_n});
  }
  const bool weight_acts = recording.rest.state == RestState::stress_free && recording.environment.gravity_m_s2.norm() > 0;
  if (weight_acts) {
    if (!(recording.density_kg_m3 > 0)) throw Error("gravity acts, so the density is needed", "density_kg_m3");
    density_ = unknowns.add_block("density", "kg/m3", recording.density_std_kg_m3, {""});
    if (density_ >= 0) unknowns[density_].prior_mean = recording.density_kg_m3;
  }

  solved_ = std::make_shared<Solved>();
  if (recording.rest.surface_std_m > 0) {
    solved_->field_std_m = recording.rest.surface_std_m;
    solved_->field_correlation_m = recording.rest.surface_correlation_m;
    if (earlier && earlier->field && earlier->vertices == object_.surface.vertex_count() &&
        earlier->field_std_m == solved_->field_std_m && earlier->field_correlation_m == solved_->field_correlation_m) {
      solved_->field = earlier->field;
    } else {
      solved_->field =
          std::make_shared<const SurfaceField>(object_.surface.rest(), solved_->field_std_m, solved_->field_correlation_m);
    }
    field_ = solved_->field.get();
    field_unknown_ = unknowns.size();
    for (Index k = 0; k < field_->modes(); ++k) unknowns.add({"rest_surface[" + std::to_string(k) + "]", "1", 0, 1});
  }

  // The clamp moves with everything that it holds: one rigid offset of the object in the base frame.
  const Support* clamp = nullptr;
  for (const auto& support : recording.supports) {
    if (support.pose_std_m > 0 || support.pose_std_rad > 0) {
      if (clamp != nullptr) throw Error("only one support may have an uncertain pose", "supports." + support.name);
      clamp = &support;
    }
  }
  const auto add_clamp = [&](const std::string& suffix) {
    const int first = unknowns.size();
    for (const auto& axis : xyz)
      unknowns.add({"clamp" + axis + suffix, "m", 0, clamp->pose_std_m, -1, 1, clamp->pose_std_m <= 0});
    for (const auto& axis : xyz) {
      unknowns.add({"clamp_rotation" + axis + suffix, "rad", 0, clamp->pose_std_rad, -1, 1, clamp->pose_std_rad <= 0});
    }
    return first;
  };
  if (clamp != nullptr) {
    const auto held = fem::support_nodes(object_.mesh, *clamp);
    for (Index node : held) clamp_pivot_m_ += object_.mesh.nodes_m.row(node).transpose() / static_cast<double>(held.size());
  }
  int common_clamp = clamp != nullptr && clamp->pose_varies == PoseVaries::never ? add_clamp("") : -1;

  for (const auto& support : recording.supports) {
    if (!recording.free && spreads(support))
      spread_.push_back(unknowns.add({"support_spread[" + support.name + "]", "m", 0, support.spread_std_m}));
  }

  std::map<std::string, int> radius_of;  // a tool's name: its unknown
  std::map<std::string, int> shift_of;   // a push's contact: first of two unknowns
  for (std::size_t p = 0; p < recording.pushes.size(); ++p) {
    const Push& push = recording.pushes[p];
    const std::string in_push = "[" + push.name + "]";
    int push_clamp = clamp != nullptr && clamp->pose_varies == PoseVaries::push ? add_clamp(in_push) : common_clamp;
    std::map<std::string, std::size_t> errors_of_tool;
    for (const std::string& name : tools_of(push)) {  // each has sensors of its own
      const std::string of_tool = of_push(push, name);
      errors_of_tool[name] = tool_errors_.size();
      ToolErrors& errors = tool_errors_.emplace_back();
      // A single-axis load cell has a tare along its axis only.
      for (const auto& step : push.steps) {
        for (const auto& observation : step.observations) {
          const auto* wrench = std::get_if<Wrench>(&observation);
          if (wrench != nullptr && (name.empty() || wrench->tool.empty() || wrench->tool == name)) errors.tare_axis = wrench->along;
        }
      }
      const bool one_axis = errors.tare_axis.norm() > 0;
      errors.tare = unknowns.add_block("force_tare" + of_tool, "N", push.force_tare_std_n, one_axis ? std::vector<std::string>{""} : xyz);
      // A sensor that reads one axis reads nothing across it.
      const bool reads_across = !one_axis && std::any_of(push.steps.begin(), push.steps.end(), [&](const Step& step) {
        return std::any_of(step.loads.begin(), step.loads.end(),
                           [&](const Load& load) { return load.tool == name && load.force_n && load.force_n->norm() > 0; });
      });
      if (reads_across)
        errors.cross_talk = unknowns.add_block("force_cross_talk" + of_tool, "1", recording.force_cross_talk_std, {"_1", "_2"});
      const double offset_std_m =
          driven_tools(push).count(name) == 0 ? 0 : push.travel_offset_std_m;  // else it belongs to the readings
      errors.travel_offset = unknowns.add_block("travel_offset" + of_tool, "m", offset_std_m, {""});
    }
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      steps_.push_back({p, s});
      const std::string in_step = "[" + push.name + ":" + std::to_string(s) + "]";
      clamp_.push_back(clamp != nullptr && clamp->pose_varies == PoseVaries::step ? add_clamp(in_step) : push_clamp);
      std::vector<int> errors, shifts, radii;
      errors_of_.emplace_back();
      for (std::size_t l = 0; l < push.steps[s].loads.size(); ++l) {
        const Load& load = push.steps[s].loads[l];
        const std::string shift = stretch_of(push, s) + key_of(load), of_this = of_load(push, s, l);
        errors_of_.back().push_back(errors_of_tool.at(load.tool));
        if (load.contact_std_m > 0 && has_place(recording, load) && shift_of.count(shift) == 0) {
          shift_of[shift] = unknowns.add_block("contact_shift" + of_contact(push, s, load), "m", load.contact_std_m, {"_1", "_2"});
          shift_direction_[shift_of[shift]] = load.direction;
        }
        const auto known = shift_of.find(shift);
        shifts.push_back(known == shift_of.end() ? -1 : known->second);
        radii.push_back(-1);
        if (const Tool& touching = tool(load.tool); has_radius(touching, load)) {
          const auto [own, fresh] = radius_of.emplace(load.tool, 0);
          if (fresh) own->second = unknowns.add({"tool_radius[" + load.tool + "]", "m", 0, touching.radius_std_m});
          radii.back() = own->second;
        }
        const double std_n = load.force_n ? std::hypot(load.force_std_n, load.force_relative_std * load.force_n->norm()) : 0;
        errors.push_back(load.travel_m ? unknowns.add_block("travel_error" + of_this, "m", travel_std_m(push.steps[s], load), {""})
                                       : unknowns.add_block("force_error" + of_this, "N", std_n, xyz));
      }
      force_error_.push_back(errors);
      contact_shift_.push_back(shifts);
      patch_radius_.push_back(radii);
    }
  }
  if (steps_.empty()) throw Error("holds no step: there is nothing to learn from", "pushes");
  prepare_yielding_support(unknowns);
  effort_ = efforts(recording);
  memory_.resize(steps_.size());
  followed_.assign(steps_.size(), 0);
  contact_ = has_contacts(recording);
  path_ = depends_on_path(recording);
  workers_ = path_ ? 1 : std::clamp<std::size_t>(static_cast<std::size_t>(std::max(options_.threads, 1)), 1, steps_.size());
  // Unit responses are for one set of ratios; with regions a linear body is solved for at every step.
  linear_ = fem::material_law(object_.material).is_linear() && parameters_ == first_ratio && !contact_;
  poisson_lower_ = unknowns[poisson].lower;
  poisson_upper_ =
      recording.model.poisson_fixed ? poisson_lower_ : unknowns[poisson].upper;  // one ratio needs no polynomial
  if (poisson_expected && poisson_upper_ > poisson_lower_) {
    poisson_lower_ = std::max(poisson_lower_, poisson_expected->first);
    poisson_upper_ = std::min(poisson_upper_, poisson_expected->second);
  }
  // Steps share the threads; the solves in them use what is left over.
  if (!linear_) options_.threads = std::max(1, options_.threads / static_cast<int>(workers_));
  solved_->material = object_.material;
  solved_->nodes = static_cast<Index>(object_.mesh.nodes_m.rows());
  solved_->vertices = object_.surface.vertex_count();
  solved_->place_m = object_.mesh.nodes_m.sum();
  solved_->supports = recording.supports.size();
  solved_->spreads = spread_.size();
  solved_->options = options_;
  solved_->poisson_lower = poisson_lower_;
  solved_->poisson_upper = poisson_upper_;
  solved_->response_tolerance = response_tolerance;
  solved_->bodies.resize(linear_ ? 1 : workers_);
  if (earlier && !contact_ && solved_->holds_for(*earlier)) {
    solved_->bodies = std::move(earlier->bodies);
    solved_->rest_tree = earlier->rest_tree;
    solved_->surface_edges = earlier->surface_edges;
    for (auto& bodies : solved_->bodies) drop_if_unfit(bodies);
  }
  solves_.assign(workers_, 0);
  load_cases_before_ = unit_load_cases();
  for (std::size_t s = 0; s < steps_.size(); ++s) body_of(push(s), worker_of(s));
  add_slide_unknowns(unknowns);
}

std::vector<int> ForwardModel::parameter_columns() const {
  std::vector<int> columns(static_cast<std::size_t>(parameters_));
  std::iota(columns.begin(), columns.end(), 0);
  return columns;
}

std::size_t ForwardModel::worker_of(std::size_t s) const {
  std::size_t worker = 0;
  while (first_step_of(worker + 1) <= s) ++worker;
  return worker;
}

int ForwardModel::solves() const {
  int sum = 0;
  for (int n : solves_) sum += n;
  return sum;
}

int ForwardModel::unit_load_cases() const {
  int sum = 0;
  for (const auto& bodies : solved_->bodies)
    for (const auto& [tools, body] : bodies)
      sum += body->response->load_cases();
  return sum;
}

int ForwardModel::load_cases() const { return linear_ ? unit_load_cases() - load_cases_before_ : solves(); }

const Step& ForwardModel::step(std::size_t s) const { return push(s).steps[steps_[s].step]; }
const Push& ForwardModel::push(std::size_t s) const { return recording_->pushes[steps_[s].push]; }

const Tool& ForwardModel::tool(const std::string& name) const {
  for (const auto& tool : recording_->tools) {
    if (tool.name == name) return tool;
  }
  throw Error("no tool of this name", "loads.tool " + name);
}

std::shared_ptr<const geometry::TriangleTree> ForwardModel::rest_tree() const {
  if (!solved_->rest_tree) solved_->rest_tree = std::make_shared<const geometry::TriangleTree>(object_.surface.rest());
  return solved_->rest_tree;
}

std::shared_ptr<const std::vector<geometry::SurfaceEdge>> ForwardModel::surface_edges() const {
  if (!solved_->surface_edges)
    solved_->surface_edges = std::make_shared<const std::vector<geometry::SurfaceEdge>>(geometry::surface_edges(object_.surface.rest().triangles));
  return solved_->surface_edges;
}

void ForwardModel::forget_steps() {
  for (auto& memory : memory_) memory = Memory{};
}

void ForwardModel::forget() {
  forget_steps();
  for (auto& bodies : solved_->bodies) {
    for (auto& [tools, body] : bodies) {
      body->response->forget();
      body->lying = nullptr;
    }
  }
}

}  // namespace palpate::estimation
