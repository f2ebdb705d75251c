// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/push_information.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "palpate/core/error.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/estimation/push_visibility.hpp"
#include "palpate/estimation/region_at.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

constexpr const char* candidate_name = "candidate ";  // and a number: how unknowns of one push are told from those of all
constexpr double robust_efficiency = 0.95;  // of Tukey's biweight at the fit's usual cut

Points seen_points(const TermInput& view) {
  if (const auto* rays = std::get_if<RayObservation>(&view))
    return rays->rays.origins_m + rays->rays.range_m.asDiagonal() * rays->rays.directions;
  if (const auto* cloud = std::get_if<PointCloud>(&view)) return cloud->points_m;
  return Points(0, 3);
}

/// Mean distance between neighbours of points on a surface of this area.
double spacing_m(const TriMesh& surface, Index points) {
  double area = 0;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(t, k))); };
    area += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
  }
  return std::sqrt(area / std::max<double>(1, static_cast<double>(points)));
}

const Tool& tool_named(const Recording& scene, const std::string& name) {
  for (const auto& tool : scene.tools)
    if (tool.name == name) return tool;
  throw Error("no tool of this name", "tool " + name);
}

/// Metres of travel per newton, along each candidate; negative where supports leave free what the push works on.
VectorX compliances_m_per_n(const Recording& scene, const SimulatedObject& object, const Tool& tool,
                            const std::vector<PushCandidate>& candidates, const Knowledge& knowledge,
                            const fem::StaticsOptions& options) {
  std::map<std::array<double, 3>, Index> first_column;
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<Index> column;
  for (const auto& candidate : candidates) {
    const std::array<double, 3> place{candidate.contact_m.x(), candidate.contact_m.y(), candidate.contact_m.z()};
    const auto [at, fresh] = first_column.emplace(place, static_cast<Index>(3 * first_column.size()));
    column.push_back(at->second);
    if (!fresh) continue;
    Load load;
    load.contact_m = candidate.contact_m;
    const auto columns = load_columns(object.mesh, tool, load);
    for (int d = 0; d < 3; ++d)
      for (Eigen::SparseMatrix<double>::InnerIterator it(columns, d); it; ++it)
        entries.emplace_back(static_cast<int>(it.row()), static_cast<int>(at->second) + d, it.value());
  }
  fem::Boundary boundary;
  const Index dofs = static_cast<Index>(3 * object.mesh.nodes_m.rows());
  boundary.forces.resize(dofs, static_cast<Index>(3 * first_column.size()));
  boundary.forces.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SparseMatrix<double> forces = boundary.forces;
  MatrixX free_motions(dofs, 0);
  boundary.motions.resize(dofs, 0);
  boundary.inertia_relief = scene.free;
  if (!scene.free) {
    HeldBody held = hold(object.mesh, held_both_ways(scene.supports), {});
    boundary.constraints = std::move(held.constraints);
    free_motions = std::move(held.free_motions);
  }
  const fem::ResponseQuery query{knowledge.young_modulus_pa, knowledge.poisson_ratio,
                                 VectorX::Zero(boundary.forces.cols()), VectorX::Zero(boundary.motions.cols())};
  fem::Response::Options response_options;
  response_options.statics = options;
  if (!object.region.empty()) {
    response_options.statics.region = object.region;
    response_options.statics.region_stiffness = VectorX::Ones(1 + knowledge.log_ratio.size());
    response_options.statics.region_stiffness.tail(knowledge.log_ratio.size()) = knowledge.log_ratio.array().exp();
  }
  response_options.poisson_lower = response_options.poisson_upper = knowledge.poisson_ratio;
  const fem::Response response(object.mesh, "linear", std::move(boundary), Eigen::SparseMatrix<double>(0, dofs), response_options);
  const fem::ResponseState unit = response.at(query);
  VectorX compliance(static_cast<Index>(candidates.size()));
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const Vec3& d = candidates[c].direction;
    const Index k = column[c];
    compliance(static_cast<Index>(c)) = d.dot(unit.d_conjugate.block<3, 3>(k, unit.parameters + k) * d);
    if (free_motions.cols() == 0) continue;
    const VectorX load = forces.middleCols(k, 3) * d;
    if ((free_motions.transpose() * load).cwiseAbs().maxCoeff() > 1e-6 * load.lpNorm<1>())
      compliance(static_cast<Index>(c)) = -1;
  }
  return compliance;
}

/// What one step adds, before nuisances are integrated out.
struct Block {
  std::vector<int> unknowns;
  MatrixX information;
};

Block block_of(const TermRows& rows, double weight) {
  MatrixX jacobian = rows.jacobian;
  for (Index i = 0; i < rows.residual.size(); ++i)
    if (!std::isfinite(rows.residual(i))) jacobian.row(i).setZero();  // a ray beside the deformed object
  return {rows.unknowns, weight * (jacobian.transpose() * jacobian)};
}

}  // namespace

struct PushInformation::Impl {
  Recording planned;  // the candidates as pushes; `model` refers to it
  SensorPlan sensors;
  RankOptions options;
  Tool tool;
  std::vector<PushCandidate> candidates;  // of planned.pushes
  std::vector<int> region;                // that it presses on
  std::vector<Points> seen_m;             // a view
  std::vector<double> spacing;            // a view
  std::optional<geometry::TriangleTree> surface;
  int left_out = 0;
  bool rest_step = false;
  Unknowns unknowns;
  std::map<std::string, int> shared;
  std::unique_ptr<ForwardModel> model;
  double log_young_value = 0, poisson_value = 0;
  VectorX log_ratio;
  int force_scale = -1;
  std::vector<int> all_share;  // unknowns that no push has for itself, in the order in which they came up

  /// An error that comes again with every push: one would take from it what only another calibration can. The rest surface's has too many
  /// numbers to be carried along.
  bool is_shared(int unknown) const {
    const std::string& name = unknowns[unknown].name;
    const bool of_one = name.find(std::string("[") + candidate_name) != std::string::npos;
    return unknown >= unknowns.parameter_count() && !of_one && !name.starts_with("rest_surface[");
  }

  Push made_up(const PushCandidate& candidate, double highest_n, const std::string& name) const {
    Push push;
    push.name = name;
    push.force_tare_std_n = sensors.force_tare_std_n;
    push.travel_offset_std_m = sensors.travel_offset_std_m;
    if (rest_step) push.steps.emplace_back();
    for (int level = 1; level <= sensors.levels; ++level) {
      Load load;
      load.tool = tool.name;
      load.force_n = highest_n * level / sensors.levels * candidate.direction;
      load.force_std_n = sensors.force_std_n;
      load.force_relative_std = sensors.force_relative_std;
      load.contact_m = candidate.contact_m;
      load.direction = candidate.direction;
      load.contact_std_m = sensors.contact_std_m;
      push.steps.emplace_back().loads.push_back(load);
    }
    return push;
  }

  VectorX values() const {
    VectorX at = unknowns.prior_mean();
    at(log_young) = log_young_value;
    at(poisson) = poisson_value;
    at.segment(first_ratio, log_ratio.size()) = log_ratio;
    return at;
  }

  /// Schur complement of all that is not (log E, nu, log ratios, force scale, what all pushes share).
  MatrixX marginal(const std::vector<const Block*>& blocks) {
    std::map<int, Index> at;
    for (int k = 0; k < unknowns.parameter_count(); ++k) at.emplace(k, k);
    const Index scale = unknowns.parameter_count();
    if (force_scale >= 0) at.emplace(force_scale, scale);
    std::vector<int> of_one;
    for (const Block* block : blocks)
      for (const int unknown : block->unknowns) {
        if (unknowns[unknown].fixed || at.count(unknown) > 0) continue;
        if (!is_shared(unknown))
          of_one.push_back(unknown);
        else if (std::find(all_share.begin(), all_share.end(), unknown) == all_share.end())
          all_share.push_back(unknown);
      }
    Index size = scale + 1;
    for (const int unknown : all_share) at.emplace(unknown, size++);
    const Index kept = size;
    for (const int unknown : of_one) size += at.emplace(unknown, size).second;
    MatrixX all = MatrixX::Zero(size, size);
    for (const Block* block : blocks) {
      for (std::size_t i = 0; i < block->unknowns.size(); ++i) {
        const auto a = at.find(block->unknowns[i]);
        if (a == at.end()) continue;
        for (std::size_t j = 0; j < block->unknowns.size(); ++j) {
          const auto b = at.find(block->unknowns[j]);
          if (b != at.end()) all(a->second, b->second) += block->information(static_cast<Index>(i), static_cast<Index>(j));
        }
      }
    }
    for (const auto& [unknown, k] : at)
      if (k >= kept && std::isfinite(unknowns[unknown].prior_std)) all(k, k) += std::pow(unknowns[unknown].prior_std, -2);
    if (size == kept) return all;
    const MatrixX own = all.bottomRightCorner(size - kept, size - kept), cross = all.bottomLeftCorner(size - kept, kept);
    return all.topLeftCorner(kept, kept) - cross.transpose() * own.ldlt().solve(cross);
  }
};

PushInformation::PushInformation(const Recording& scene, const SimulatedObject& object, const std::string& tool_name,
                                 const std::vector<PushCandidate>& candidates, const SensorPlan& sensors,
                                 const Knowledge& knowledge, const RankOptions& options)
    : impl_(std::make_unique<Impl>()) {
  Impl& plan = *impl_;
  if (sensors.views.empty() && !sensors.travel_sigma_m)
    throw Error("nothing would be measured: give a view or the travel's sigma", "SensorPlan");
  if (sensors.levels < 1) throw Error("must be at least 1", "SensorPlan.levels");
  if (!(sensors.variance_inflation >= 1)) throw Error("must be at least 1", "SensorPlan.variance_inflation");
  plan.sensors = sensors;
  plan.options = options;
  plan.tool = tool_named(scene, tool_name);
  plan.planned = scene;
  plan.planned.pushes.clear();
  plan.planned.supports = held_both_ways(scene.supports);
  plan.planned.model.poisson_fixed = knowledge.poisson_ratio;  // one ratio, one factorisation
  plan.log_young_value = std::log(knowledge.young_modulus_pa);
  plan.poisson_value = knowledge.poisson_ratio;
  plan.log_ratio = knowledge.log_ratio;
  plan.rest_step = scene.rest.surface_std_m > 0;
  plan.surface.emplace(object.surface.rest());
  for (const auto& view : sensors.views) {
    plan.seen_m.push_back(seen_points(view.sees));
    plan.spacing.push_back(spacing_m(object.surface.rest(), static_cast<Index>(plan.seen_m.back().rows())));
    const auto* rays = std::get_if<RayObservation>(&view.sees);
    plan.rest_step = plan.rest_step || (rays != nullptr && (rays->bias_std_m > 0 || rays->scatter));
  }
  SimulatedObject small_strains = object;
  small_strains.material = "linear";
  if (knowledge.regions.empty()) {
    small_strains.region.clear();
    small_strains.region_names.clear();
  } else if (small_strains.region_names != knowledge.regions) {
    throw Error("the result tells other regions apart than the recording names; estimate again with those of the recording",
                "result: parameters");
  }
  FitOptions fit_options;
  fit_options.threads = options.threads;
  const fem::StaticsOptions statics = statics_options(plan.planned, small_strains, fit_options);
  const VectorX compliance = compliances_m_per_n(scene, small_strains, plan.tool, candidates, knowledge, statics);
  const double pressed_m2 = EIGEN_PI * plan.tool.radius_m * plan.tool.radius_m;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const double give = compliance(static_cast<Index>(c));
    if (!(give > 0)) {
      ++plan.left_out;
      continue;
    }
    const PushCandidate& candidate = candidates[c];
    const PushLimits& limits = options.limits;
    // The encoder goes on by what stick and arm give way; the object gives without them.
    double highest_n = std::min(limits.force_n, limits.travel_m / (give + plan.tool.compliance_m_per_n));
    const int region = region_at(small_strains, candidate.contact_m);
    highest_n = std::min(highest_n, limits.pressure_over_young * knowledge.young_modulus_of(region) * pressed_m2);
    if (candidate.thickness_m > 0) highest_n = std::min(highest_n, limits.thickness_share * candidate.thickness_m / give);
    plan.planned.pushes.push_back(plan.made_up(candidate, highest_n, candidate_name + std::to_string(c)));
    plan.candidates.push_back(candidate);
    plan.region.push_back(region);
  }
  if (plan.candidates.empty()) return;
  plan.planned.model.poisson_by_region = false;  // planned for as if they shared it
  plan.model = std::make_unique<ForwardModel>(plan.planned, std::move(small_strains), plan.unknowns, statics);
  for (int k = 0; k < plan.unknowns.size(); ++k)
    if (plan.unknowns[k].name == "force_scale") plan.force_scale = k;
}
PushInformation::~PushInformation() = default;

std::size_t PushInformation::count() const { return impl_->candidates.size(); }
int PushInformation::left_out() const { return impl_->left_out; }

VectorX PushInformation::shared_information() const {
  VectorX out(static_cast<Index>(impl_->all_share.size()));
  for (Index k = 0; k < out.size(); ++k) out(k) = std::pow(impl_->unknowns[impl_->all_share[static_cast<std::size_t>(k)]].prior_std, -2);
  return out;
}

std::vector<RatedPush> PushInformation::rate(std::size_t c) {
  Impl& plan = *impl_;
  const PushCandidate& candidate = plan.candidates[c];
  // Views that show the place, without what the stick hides.
  std::vector<std::pair<int, TermInput>> views;
  std::vector<double> shares;
  for (std::size_t v = 0; v < plan.sensors.views.size(); ++v) {
    TermInput sees = plan.sensors.views[v].sees;
    Points left_m = plan.seen_m[v];
    if (const auto* rays = std::get_if<RayObservation>(&sees)) {
      sees = without_stick(*rays, candidate, plan.tool.radius_m, plan.options.limits.stick_length_m);
      left_m = seen_points(sees);
    }
    if (left_m.rows() == 0) continue;
    std::optional<Vec3> eye_m;
    if (const auto* rays = std::get_if<RayObservation>(&sees)) eye_m = rays->rays.origins_m.row(0);
    const double share = seen_share(*plan.surface, left_m, eye_m, candidate, plan.tool.radius_m, plan.spacing[v]);
    if (share < plan.options.least_seen_share) continue;
    views.emplace_back(static_cast<int>(v), std::move(sees));
    shares.push_back(share);
  }
  if (views.empty() && !plan.sensors.views.empty()) return {};

  const Push& push = plan.planned.pushes[c];
  const std::size_t first = c * push.steps.size();  // every candidate has as many
  const double surface_weight = robust_efficiency / plan.sensors.variance_inflation;
  std::vector<Block> tool_blocks(push.steps.size());
  std::vector<std::vector<Block>> view_blocks(views.size(), std::vector<Block>(push.steps.size()));
  std::vector<double> travel_m(push.steps.size(), 0);
  for (std::size_t s = 0; s < push.steps.size(); ++s) {
    const TermContext context{*plan.model, first + s, plan.unknowns, plan.shared};
    std::unique_ptr<Term> travel;
    const bool loaded = !push.steps[s].loads.empty();
    if (loaded && plan.sensors.travel_sigma_m) {
      ToolTravel reading;
      reading.tool = plan.tool.name;
      reading.sigma_m = *plan.sensors.travel_sigma_m;
      travel = make_term(reading, context);
    }
    std::vector<std::unique_ptr<Term>> looks;
    for (const auto& view : views) looks.push_back(make_term(view.second, context));
    const VectorX at = plan.values();
    const StepPrediction predicted = plan.model->predict(first + s, at);
    if (loaded) travel_m[s] = predicted.travel_m(0);
    if (travel) tool_blocks[s] = block_of(travel->rows(predicted, at, {}), 1);
    for (std::size_t v = 0; v < looks.size(); ++v) {
      const TermRows rows = looks[v]->rows(predicted, at, {});
      view_blocks[v][s] = block_of(rows, rows.robust ? surface_weight : 1);
    }
  }
  plan.model->forget_steps();

  std::vector<RatedPush> rated;
  for (std::size_t v = 0; v < std::max<std::size_t>(1, views.size()); ++v) {
    std::vector<const Block*> blocks;
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      blocks.push_back(&tool_blocks[s]);
      if (!views.empty()) blocks.push_back(&view_blocks[v][s]);
      if (push.steps[s].loads.empty()) continue;
      RatedPush one;
      one.candidate = candidate;
      one.view = views.empty() ? -1 : views[v].first;
      one.seen_share = views.empty() ? 0 : shares[v];
      one.force_n = push.steps[s].loads[0].force_n->norm();
      one.travel_m = travel_m[s] + plan.tool.compliance_m_per_n * one.force_n;
      one.steps = static_cast<int>(s + 1 - (plan.rest_step ? 1 : 0));
      one.region = plan.region[c];
      one.information = plan.marginal(blocks);
      rated.push_back(std::move(one));
    }
  }
  return rated;
}

}  // namespace palpate::estimation
