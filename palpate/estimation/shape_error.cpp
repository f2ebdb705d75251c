// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/shape_error.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/estimation/unseen_side.hpp"

namespace palpate::estimation {
namespace {

constexpr Index rays_a_frame = 1500;   // the same few for every shape: only how the answers differ counts
constexpr double strange_pull = 3;     // of what a push's instruments are off by
constexpr double worse = 0.1;          // of chi-square: such a shape is ruled out
constexpr double clearly_better = 10;  // in half of chi-square, ...
constexpr double clearly_better_share = 0.03;  // ... and as a share of it: what no shape accounts for is some per cent itself

Inputs thinned(const Inputs& all, double& share) {
  Inputs few = all;
  double kept = 0, count = 0;
  for (auto& step : few) {
    for (auto& input : step) {
      auto* frame = std::get_if<RayObservation>(&input);
      if (frame == nullptr) continue;
      const RayCloud rays = frame->rays;
      const Index stride = std::max<Index>(1, static_cast<Index>(rays.range_m.size()) / rays_a_frame);
      std::vector<Index> rows;
      for (Index i = 0; i < rays.range_m.size(); i += stride) rows.push_back(i);
      frame->rays = {rays.origins_m(rows, Eigen::all), rays.directions(rows, Eigen::all), rays.range_m(rows), rays.sigma_m(rows), {}};
      if (rays.pixel.rows() == rays.range_m.size()) frame->rays.pixel = rays.pixel(rows, Eigen::all);
      kept += static_cast<double>(rows.size()), count += static_cast<double>(rays.range_m.size());
    }
  }
  share = count > 0 ? kept / count : 1;
  return few;
}

struct Answer {
  VectorX fitted;      ///< to the shape as it was put there: log E of the first region, nu, log E of the others over the first
  VectorX parameters;  ///< where its unseen side leans as the pushes have it
  MatrixX widening;    ///< of their covariance, by how far that is not known
  double cost = 0;
  bool strange = false;  ///< wants an instrument to be off by more than it is
};

/// @param change  of the parameters
/// @param ratios  how many of them are log ratios of regions
AnswerShift shift_of(const VectorX& change, Index ratios) {
  AnswerShift out;
  out.log_young = change(log_young);
  out.poisson = change(poisson);
  out.region_log_young = change.segment(first_ratio, ratios).array() + change(log_young);
  out.region_poisson = change.tail(change.size() - first_ratio - ratios);
  return out;
}

bool about_instruments(const std::string& name) {
  return name.starts_with("travel_zero") || name.starts_with("travel_offset") || name.starts_with("force_tare") || name.starts_with("force_scale") ||
         name.starts_with("force_cross_talk");
}

/// A fit of one shape to few of the rays, and what leaning its unseen side does to it. A lean changes what it does itself (a thin
/// back gives way by the cube of its thickness): it is looked for again where the first step led.
std::optional<Answer> answer_of(const Recording& recording, SimulatedObject object, const std::optional<UnseenSide>& side,
                                const Inputs& inputs, const Objective& objective, const Optimum& optimum, const Loss& loss,
                                const FitOptions& options, const OptimiseOptions& optimiser, double most_cost, SolveCount& solved,
                                const OnProgress& progress) {
  constexpr int most_rounds = 2;
  constexpr double settled = 0.3;  // standard deviations of a mode
  OptimiseOptions quiet = optimiser;
  quiet.on_accepted = {};
  const Unknowns& known = objective.unknowns();
  const TetMesh as_put = object.mesh;
  std::optional<Answer> answer;
  VectorX amounts = VectorX::Zero(unseen_mode_count), last;
  for (int round = 0; round < most_rounds; ++round) {
    Unknowns unknowns;
    if (round > 0) object.mesh = with_unseen_moved(as_put, *side, amounts);
    std::optional<ForwardModel> model;
    try {
      model.emplace(recording, object, unknowns, statics_options(recording, object, options));
    } catch (const Error&) {  // so it cannot lean as far; as it was put, it can be solved for
      if (answer) return answer;
      throw;
    }
    const CountsAtEnd counts(*model, solved);
    Objective other(*model, inputs, unknowns);
    for (int k : {log_young, poisson}) unknowns[k] = known[k];
    // the rest surface's error has modes of its own on each shape
    std::map<std::string, int> place;
    for (int k = 0; k < known.size(); ++k)
      if (known[k].name.rfind("rest_surface[", 0) != 0) place[known[k].name] = k;
    VectorX start = unknowns.prior_mean();
    for (int k = 0; k < unknowns.size(); ++k)
      if (const auto it = place.find(unknowns[k].name); it != place.end()) start(k) = optimum.unknowns(it->second);
    if (last.size() == start.size()) start = last;
    Optimum found = optimise(other, start, loss, quiet, progress);
    if (found.termination != Termination::converged || !found.evaluation.usable) return answer;
    VectorX at = found.unknowns;
    double cost = found.evaluation.cost + 0.5 * amounts.squaredNorm();  // a shape that leans is less likely
    MatrixX widening = MatrixX::Zero(unknowns.parameter_count(), unknowns.parameter_count());
    bool moves = false;
    if (side) {
      other.set_reuse(0);
      found.evaluation = other.evaluate(found.unknowns, loss);
      if (const auto modes = unseen_modes(*side, amounts, recording, object, other, found, loss, tukey_information_factor(loss.tukey), options, &solved)) {
        at += modes->change;
        cost -= modes->gain;
        widening = modes->widening;
        moves = (modes->amounts - amounts).cwiseAbs().maxCoeff() > settled;
        amounts = modes->amounts;
      }
    }
    if (!answer) answer.emplace().fitted = found.unknowns.head(unknowns.parameter_count());
    answer->parameters = at.head(unknowns.parameter_count());
    answer->widening = widening;
    answer->cost = cost;
    answer->strange = false;
    for (int k = 0; k < unknowns.size(); ++k)
      answer->strange = answer->strange || (about_instruments(unknowns[k].name) &&
                                            std::abs(at(k) - unknowns[k].prior_mean) > strange_pull * unknowns[k].prior_std);
    last = found.unknowns;
    if (!moves || answer->strange || answer->cost > most_cost) break;
  }
  return answer;
}

}  // namespace

std::optional<ShapeEffect> shape_effect(const ShapeDoubt& doubt, const Recording& recording, const Inputs& inputs, const Objective& objective, const Optimum& optimum,
                                        const Loss& loss, const FitOptions& options, const OptimiseOptions& optimiser,
                                        const OnProgress& progress, SolveCount* solved) {
  SolveCount nobody_asks;
  SolveCount& count = solved != nullptr ? *solved : nobody_asks;
  double share = 1;
  // The rim between seen and guessed is elsewhere on each shape: none is to be blamed for points on another's.
  Inputs common = inputs;
  for (const AlternativeShape& shape : doubt.shapes)
    if (!shape.seen.empty()) drop_unseen(*shape.recording.rest.surface, shape.seen, shape.plane, common);
  const Inputs few = thinned(common, share);
  Loss weighed = loss;  // fewer neighbours, less that they share
  weighed.rays.clear();
  weighed.surface_weight = std::min(1.0, loss.surface_weight / share / (loss.noise ? loss.noise->of_wide : 1));
  weighed.noise = nullptr;
  const auto fitted = answer_of(recording, objective.model().object(), doubt.side, few, objective, optimum, weighed, options, optimiser, std::numeric_limits<double>::infinity(), count, progress);
  if (!fitted) return std::nullopt;
  std::vector<std::optional<Answer>> alternatives(doubt.shapes.size());
  for (std::size_t s = 0; s < doubt.shapes.size(); ++s) {
    if (progress && !progress("unseen side", static_cast<double>(s) / static_cast<double>(doubt.shapes.size()))) return std::nullopt;
    try {
      alternatives[s] = answer_of(doubt.shapes[s].recording, doubt.shapes[s].object, doubt.shapes[s].side, few, objective, optimum, weighed, options, optimiser, (1 + worse) * fitted->cost, count, {});
    } catch (const Error&) {  // it is not held, or a tool does not reach it: no such shape was pushed
    }
  }
  if (std::none_of(alternatives.begin(), alternatives.end(), [](const auto& there) { return there.has_value(); })) return std::nullopt;

  // Of shapes that were as likely beforehand the pushes may say which one it is.
  std::optional<std::size_t> better;
  const Answer* best = &*fitted;
  for (std::size_t s = 0; s < alternatives.size(); ++s) {
    if (!doubt.shapes[s].as_likely || !alternatives[s] || alternatives[s]->strange) continue;
    const double clearly = std::max(clearly_better, clearly_better_share * best->cost);
    if (alternatives[s]->cost < best->cost - clearly) best = &*alternatives[s], better = s;
  }
  // The others stay, as far as they agree with what was measured: a mean over models, each with what it does not know itself.
  std::vector<std::pair<const Answer*, double>> shapes;
  const auto consider = [&](const Answer& shape, double likely) {
    const double worse_by = (shape.cost - best->cost) / best->cost;
    if (&shape != best && ((shape.strange && !best->strange) || worse_by > worse)) return;
    shapes.emplace_back(&shape, likely * std::min(1.0, std::exp(-worse_by / clearly_better_share)));
  };
  consider(*fitted, 1);
  for (std::size_t s = 0; s < alternatives.size(); ++s)
    if (alternatives[s]) consider(*alternatives[s], doubt.shapes[s].likelihood);
  double all = 0;
  VectorX mean = VectorX::Zero(best->parameters.size());
  for (const auto& [shape, weight] : shapes) all += weight, mean += weight * shape->parameters;
  mean /= all;
  MatrixX spread = MatrixX::Zero(mean.size(), mean.size());
  ShapeEffect out;
  out.better = better;
  out.softest_pa = std::numeric_limits<double>::infinity();
  for (const auto& [shape, weight] : shapes) {
    const VectorX off = shape->parameters - mean;
    spread += weight / all * (shape->widening + off * off.transpose());
    out.softest_pa = std::min(out.softest_pa, std::exp(shape->parameters(log_young)));
    out.stiffest_pa = std::max(out.stiffest_pa, std::exp(shape->parameters(log_young)));
  }
  const Index ratios = objective.unknowns().ratio_count();
  out.move = shift_of(mean - best->fitted, ratios);
  const Eigen::SelfAdjointEigenSolver<MatrixX> parts(spread);
  for (Index k = 0; k < mean.size(); ++k) {
    const double variance = parts.eigenvalues()(k);
    if (variance > 0) out.shifts.push_back(shift_of(std::sqrt(variance) * parts.eigenvectors().col(k), ratios));
  }
  return out;
}

}  // namespace palpate::estimation
