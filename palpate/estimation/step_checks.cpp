// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/step_checks.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "palpate/estimation/cell_sums.hpp"
#include "palpate/estimation/held_out.hpp"
#include "palpate/estimation/homogeneity.hpp"
#include "palpate/estimation/region_at.hpp"
#include "palpate/estimation/slips.hpp"

namespace palpate::estimation {
namespace {

std::string in_push(const ForwardModel& model, std::size_t s) { return "[" + model.push(s).name + "]"; }
std::string in_step(const ForwardModel& model, std::size_t s) {
  return "[" + model.push(s).name + ":" + std::to_string(model.index(s).step) + "]";
}

bool has_rows(const Objective& objective, std::size_t s) { return s < objective.last_rows().size() && !objective.last_rows()[s].empty(); }

/// What one step asks of a few unknowns, its frames' poses and the torque's tare free under their priors and all else where
/// the fit put it: the change and its covariance.
struct Asked {
  VectorX change;
  MatrixX covariance;
};
std::optional<Asked> asked_by(const Objective& objective, const Optimum& optimum, std::size_t s, const std::vector<int>& about, double factor) {
  const Unknowns& unknowns = objective.unknowns();
  const Evaluation evaluation = objective.of_step(s, optimum.unknowns, optimum.loss);
  MatrixX hessian = evaluation.information(factor);
  VectorX gradient = evaluation.gradient;
  for (int k : about) {  // the data alone
    if (!std::isfinite(unknowns[k].prior_std) || unknowns[k].fixed) continue;  // no prior was added: Objective::add_priors
    const double precision = 1 / (unknowns[k].prior_std * unknowns[k].prior_std);
    hessian(k, k) -= precision;
    gradient(k) -= precision * (optimum.unknowns(k) - unknowns[k].prior_mean);
  }
  std::vector<int> frames;
  const std::string suffix = in_step(objective.model(), s), tare = "torque_tare" + in_push(objective.model(), s);
  for (int k : free_unknowns(unknowns)) {
    const std::string& name = unknowns[k].name;
    const bool own = name.size() > suffix.size() && name.compare(name.size() - suffix.size(), suffix.size(), suffix) == 0;
    // Without its tare a torque at a light load asks for another contact than at a heavy one.
    const bool of_torque = name.size() == tare.size() + 2 && name.rfind(tare + "_", 0) == 0;
    if ((own && name.rfind("frame", 0) == 0) || of_torque) frames.push_back(k);
  }
  MatrixX left = hessian(about, about);
  VectorX slope = gradient(about);
  if (!frames.empty()) {
    const MatrixX across = hessian(about, frames);
    const Eigen::LDLT<MatrixX> own(hessian(frames, frames));
    left -= across * own.solve(across.transpose());
    slope -= across * own.solve(VectorX(gradient(frames)));
  }
  const Eigen::LLT<MatrixX> factorised(left);
  if (factorised.info() != Eigen::Success) return std::nullopt;
  return Asked{-factorised.solve(slope), factorised.solve(MatrixX::Identity(left.rows(), left.cols()))};
}

/// Steps of a push, and for each a vector with its covariance: where do they change most?
struct Told {
  std::size_t step;
  VectorX value;
  MatrixX covariance;
};
std::optional<StepChange> largest_change(const std::vector<Told>& told) {
  if (told.size() < 2) return std::nullopt;
  const Index size = static_cast<Index>(told.front().value.size());
  const auto mean = [&](std::size_t from, std::size_t to) {
    MatrixX information = MatrixX::Zero(size, size);
    VectorX sum = VectorX::Zero(size);
    for (std::size_t i = from; i < to; ++i) {
      const MatrixX one = told[i].covariance.inverse();
      information += one;
      sum += one * told[i].value;
    }
    const MatrixX covariance = information.inverse();
    return std::pair<VectorX, MatrixX>(covariance * sum, covariance);
  };
  StepChange best;
  for (std::size_t k = 1; k < told.size(); ++k) {
    const auto before = mean(0, k), after = mean(k, told.size());
    const VectorX change = after.first - before.first;
    const double chi2 = change.dot((before.second + after.second).ldlt().solve(change));
    const double p = std::min(1.0, chi_square_tail(chi2, static_cast<int>(size)) * static_cast<double>(told.size() - 1));
    if (p < best.p_value) best = {told[k].step, change.norm(), p};
  }
  return best;
}

/// The most significant of what was asked. Of many one looks rare by chance: as often as all of them together are asked.
struct Rarest {
  std::optional<StepChange> one;
  int asked = 0;

  void ask(const std::optional<StepChange>& other) {
    if (!other) return;
    ++asked;
    if (!one || other->p_value < one->p_value) one = other;
  }
  std::optional<StepChange> of_all() const {
    std::optional<StepChange> out = one;
    if (out) out->p_value = std::min(1.0, asked * out->p_value);
    return out;
  }
};

std::optional<int> unknown_named(const Unknowns& unknowns, const std::string& name) {
  for (int k = 0; k < unknowns.size(); ++k) {
    if (unknowns[k].name == name) return k;
  }
  return std::nullopt;
}

/// Whether tools go on with what they did: the same force, or the same motion where that is imposed.
bool is_held(const std::vector<Load>& before, const std::vector<Load>& after) {
  constexpr double same = 0.01;
  const auto same_load = [](const Load& one, const Load& other) {
    const bool forced = one.force_n.has_value();
    if (one.tool != other.tool || forced != other.force_n.has_value() || (!forced && one.travel_m.has_value() != other.travel_m.has_value())) return false;
    if (forced) return (*other.force_n - *one.force_n).norm() <= same * one.force_n->norm();
    return !one.travel_m || std::abs(*other.travel_m - *one.travel_m) <= same * std::abs(*one.travel_m);
  };
  return std::equal(before.begin(), before.end(), after.begin(), after.end(), same_load);
}

bool concerns(const std::vector<TermRows>& rows, int unknown) {
  return std::any_of(rows.begin(), rows.end(), [&](const TermRows& term) {
    return std::find(term.unknowns.begin(), term.unknowns.end(), unknown) != term.unknowns.end();
  });
}

}  // namespace

std::optional<StepChange> contact_slip(const Objective& objective, const Optimum& optimum, double factor) {
  const ForwardModel& model = objective.model();
  std::map<std::size_t, std::vector<Told>> pushes;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const auto first = unknown_named(objective.unknowns(), "contact_shift" + stretch_of(model.push(s), model.index(s).step) + "_1");
    if (!first || !has_rows(objective, s) || !concerns(objective.last_rows()[s], *first)) continue;
    const auto asked = asked_by(objective, optimum, s, {*first, *first + 1}, factor);
    if (asked) pushes[model.index(s).push].push_back({s, asked->change, asked->covariance});
  }
  Rarest rarest;
  for (const auto& [push, told] : pushes) rarest.ask(largest_change(told));
  return rarest.of_all();
}

std::optional<StepChange> object_motion(const Objective& objective, const Optimum& optimum) {
  const ForwardModel& model = objective.model();
  std::map<std::size_t, std::vector<Told>> pushes;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const auto first = unknown_named(objective.unknowns(), "frame_x" + in_step(model, s));
    if (!has_rows(objective, s) || !first || objective.unknowns()[*first].fixed) continue;
    // An estimate under its prior scatters by less than the prior itself: the test errs on the quiet side.
    const double std_m = objective.unknowns()[*first].prior_std;
    pushes[model.index(s).push].push_back({s, optimum.unknowns.segment<3>(*first), std_m * std_m * MatrixX::Identity(3, 3)});
  }
  Rarest rarest;
  for (const auto& [push, told] : pushes) rarest.ask(largest_change(told));
  return rarest.of_all();
}

std::optional<StepChange> settling(const Objective& objective, const Optimum& optimum, double factor) {
  const ForwardModel& model = objective.model();
  Rarest rarest;
  for (std::size_t from = 0; from < model.step_count(); ++from) {
    if (load_of(model.step(from)) == 0 || !has_rows(objective, from)) continue;
    std::size_t last = from;
    while (last + 1 < model.step_count() && model.index(last + 1).push == model.index(from).push && has_rows(objective, last + 1) &&
           is_held(model.step(from).loads, model.step(last + 1).loads)) {
      ++last;
    }
    if (last == from) continue;
    const auto one = asked_by(objective, optimum, from, {log_young}, factor), other = asked_by(objective, optimum, last, {log_young}, factor);
    if (one && other) {
      const double fell = one->change(0) - other->change(0);
      const double deviate = fell / std::sqrt(one->covariance(0, 0) + other->covariance(0, 0));
      rarest.ask(StepChange{last, 1 - std::exp(-fell), 0.5 * std::erfc(deviate / std::sqrt(2.0))});
    }
    from = last;
  }
  return rarest.of_all();
}

Pattern residual_pattern(const Objective& objective, const Loss& loss) {
  double between = 0, total = 0, cells = 0, count = 0;
  for (const auto& step : objective.last_rows()) {
    for (const TermRows& rows : step) {
      if (rows.cell.empty()) continue;
      CellSums sums(rows.cell);
      for (Index i = 0; i < rows.residual.size(); ++i) {
        const double r = rows.residual(i);
        if (!(std::abs(r) < loss.tukey)) continue;
        sums.add(rows.cell[static_cast<std::size_t>(i)], r);
        total += r * r;
        ++count;
      }
      sums.for_each([&](const CellSums::Cell& cell) {
        between += cell.sum * cell.sum / cell.count;
        ++cells;
      });
    }
  }
  Pattern out;
  if (cells < 10 || count < 2 * cells) return out;  // a cell of one point has no neighbours
  const double within = std::max(1.0, total / count);  // where residuals are smaller than sigma they say nothing about the sensor
  const double ratio = between / cells / within / (loss.noise ? loss.noise->of_cells : 1);
  out.inflation = std::max(1.0, ratio);
  out.deviate = (std::cbrt(ratio) - (1 - 2 / (9 * cells))) / std::sqrt(2 / (9 * cells));
  return out;
}

PatchPressure highest_pressure(const Objective& objective, const Optimum& optimum) {
  const ForwardModel& model = objective.model();
  PatchPressure highest;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    for (const Load& load : model.step(s).loads) {
      const Tool& tool = model.tool(load.tool);
      const bool round = tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc;
      if (!round || !load.force_n || !(tool.radius_m > 0)) continue;
      const double pressure_pa = std::abs(load.force_n->dot(load.direction.normalized())) / (EIGEN_PI * tool.radius_m * tool.radius_m);
      const int region = region_at(model.object(), load.contact_m);
      const double log_ratio = region > 0 ? optimum.unknowns(first_ratio + region - 1) : 0;
      const double over_young = pressure_pa / std::exp(optimum.unknowns(log_young) + log_ratio);
      if (over_young > highest.over_young) highest = {over_young, s, region};
    }
  }
  return highest;
}

}  // namespace palpate::estimation
