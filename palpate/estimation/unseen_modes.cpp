// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/unseen_modes.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/held_poisson.hpp"
#include "palpate/estimation/own_poisson.hpp"
#include "palpate/estimation/unknown_names.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

/// Directions along the support over height, breadth and depth, of a node at coordinates within minus one and one.
Eigen::Matrix<double, 3, unseen_mode_count> directions(const UnseenSide& side, double height, double breadth, double depth) {
  const Vec3 away = -side.toward, aside = side.up.cross(side.toward);
  Eigen::Matrix<double, 3, unseen_mode_count> out;
  const Vec3 from_middle = away * depth + aside * breadth, outward = from_middle / std::max(1.0, from_middle.norm());
  if (side.from_above) out << away, away * breadth, away * depth, aside, aside * breadth, aside * depth, outward;
  else out << away, away * height, away * breadth, aside, aside * breadth, aside * breadth * height, outward;
  return out;
}

/// 3 x modes a node, metres a standard deviation.
std::vector<Eigen::Matrix<double, 3, unseen_mode_count>> motions(const TetMesh& mesh, const UnseenSide& side) {
  const geometry::TriangleTree seen(side.seen);
  const Vec3 aside = side.up.cross(side.toward);
  const auto within = [&](const Vec3& direction) {
    const VectorX along = mesh.nodes_m * direction;
    const double low = along.minCoeff(), high = along.maxCoeff();
    return high > low ? VectorX(2 * (along.array() - low) / (high - low) - 1) : VectorX::Zero(along.size());
  };
  const VectorX height = within(side.up), breadth = within(aside), depth = within(-side.toward);
  std::vector<Eigen::Matrix<double, 3, unseen_mode_count>> out;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const Vec3 node = mesh.nodes_m.row(i);
    double far_m = std::sqrt(seen.closest(node).squared_distance_m2);
    for (const Vec3& touch : side.touched_m) far_m = std::min(far_m, (node - touch).norm());
    out.push_back(unseen_lean_std * far_m * directions(side, height(i), breadth(i), depth(i)));
  }
  // Edges stay as straight as they were: an element whose corners are in order is then in order.
  constexpr int edges[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};
  for (Index t = 0; mesh.tetrahedra.cols() == 10 && t < mesh.tetrahedra.rows(); ++t)
    for (int e = 0; e < 6; ++e) {
      const auto of = [&](int k) { return static_cast<std::size_t>(mesh.tetrahedra(t, k)); };
      out[of(4 + e)] = 0.5 * (out[of(edges[e][0])] + out[of(edges[e][1])]);
    }
  return out;
}

/// True where an element has lost nearly all of its volume, or turned over.
bool crushes(const TetMesh& before, const Points& after_m) {
  constexpr double least = 0.1;
  const auto volume = [&](const Points& nodes_m, Index t) {
    const auto node = [&](int k) { return Vec3(nodes_m.row(before.tetrahedra(t, k))); };
    return (node(1) - node(0)).cross(node(2) - node(0)).dot(node(3) - node(0));
  };
  for (Index t = 0; t < before.tetrahedra.rows(); ++t)
    if (!(volume(after_m, t) > least * volume(before.nodes_m, t))) return true;
  return false;
}

TetMesh moved_by(const TetMesh& mesh, const std::vector<Eigen::Matrix<double, 3, unseen_mode_count>>& motion, const VectorX& amounts) {
  TetMesh moved = mesh;
  for (std::size_t i = 0; i < motion.size(); ++i) moved.nodes_m.row(static_cast<Index>(i)) += (motion[i] * amounts).transpose();
  return moved;
}

/// How many times the mean of what a part of the image shows, over all steps, varies more than noise: what no mode says is the same
/// in every step, or grows with the load, and modes would be taken for it.
double shared_by_steps(const std::vector<std::vector<TermRows>>& rows, double cut) {
  struct Sum {
    double residual = 0, count = 0;
  };
  std::map<int, Sum> parts;
  double squares = 0, count = 0;
  for (const auto& of_step : rows)
    for (const TermRows& each : of_step)
      for (std::size_t i = 0; i < each.cell.size(); ++i) {
        const double r = each.residual(static_cast<Index>(i));
        if (each.cell[i] < 0 || !(std::abs(r) < cut)) continue;
        Sum& part = parts[each.cell[i]];
        part.residual += r, ++part.count;
        squares += r * r, ++count;
      }
  double between = 0, points = 0;
  for (const auto& [cell, part] : parts) between += part.residual * part.residual, points += part.count;
  return count > 0 ? std::max(1.0, between / points / (squares / count)) : 1;
}

}  // namespace

TetMesh with_unseen_moved(const TetMesh& mesh, const UnseenSide& side, VectorX& amounts) {
  constexpr int most_halvings = 4;
  const auto motion = motions(mesh, side);
  for (int k = 0; k < most_halvings; ++k, amounts /= 2) {
    TetMesh moved = moved_by(mesh, motion, amounts);
    if (!crushes(mesh, moved.nodes_m)) return moved;
  }
  amounts.setZero();
  return mesh;
}

std::optional<UnseenModes> unseen_modes(const UnseenSide& side, const VectorX& amounts, const Recording& recording, const SimulatedObject& object,
                                        const Objective& objective, const Optimum& optimum, const Loss& loss, double factor,
                                        const FitOptions& options, SolveCount* solved) {
  constexpr double little = 0.2;  // of a standard deviation: far enough to be told from rounding, near enough to be linear
  Recording copy = recording;
  // By its bounds: were it said to be known, regions would lose the nu of their own.
  copy.model.poisson_lower = copy.model.poisson_upper = optimum.unknowns(poisson);
  const fem::StaticsOptions statics = statics_options(object, options, highest_poisson(objective.unknowns(), optimum.unknowns));
  copy.supports = held_both_ways(std::move(copy.supports));
  SolveCount nobody_asks;
  const auto predicted = [&](const TetMesh& mesh) {
    SimulatedObject body = object;
    body.mesh = mesh;
    body.material = "linear";
    Unknowns unknowns;
    ForwardModel model(copy, std::move(body), unknowns, statics, objective.model().surface_modes(), 1e-3);
    const VectorX at = values_by_name(unknowns, objective.unknowns(), optimum.unknowns);
    const CountsAtEnd counts(model, solved != nullptr ? *solved : nobody_asks);
    std::vector<StepPrediction> out(model.step_count());
    for (std::size_t s = 0; s < out.size(); ++s) {
      if (objective.sees(s)) out[s] = model.predict(s, at);
      if (objective.sees(s) && !out[s].converged) throw Error(out[s].reason, "unseen side");
    }
    return out;
  };

  const std::size_t steps = objective.last_rows().size();
  const int known = objective.unknowns().size();
  std::vector<std::vector<TermRows>> rows = objective.last_rows();
  std::vector<int> places(unseen_mode_count);
  std::iota(places.begin(), places.end(), known);
  for (auto& of_step : rows)
    for (TermRows& each : of_step) {
      each.jacobian.conservativeResize(Eigen::NoChange, each.jacobian.cols() + unseen_mode_count);
      each.unknowns.insert(each.unknowns.end(), places.begin(), places.end());
    }
  try {
    const auto here = predicted(object.mesh);
    const auto motion = motions(object.mesh, side);
    for (int m = 0; m < unseen_mode_count; ++m) {
      const auto there = predicted(moved_by(object.mesh, motion, little * VectorX::Unit(unseen_mode_count, m)));
      for (std::size_t s = 0; s < steps; ++s) {
        if (!objective.sees(s)) continue;
        StepPrediction moved = objective.last_predictions()[s];
        const Points change_m = there[s].surface_m - here[s].surface_m;
        moved.surface_m += change_m;
        if (moved.field != nullptr) moved.material_m += change_m;
        moved.travel_m += there[s].travel_m - here[s].travel_m;
        const auto after = objective.rows_of(s, moved, optimum.unknowns, loss);
        for (std::size_t t = 0; t < after.size(); ++t) {
          const VectorX change = (after[t].residual - objective.last_rows()[s][t].residual) / little;
          rows[s][t].jacobian.col(rows[s][t].jacobian.cols() - unseen_mode_count + m) = change.array().isFinite().select(change, 0);
        }
      }
    }
  } catch (const Error&) {
    return std::nullopt;
  }

  Loss weighed = loss;
  weighed.surface_weight /= shared_by_steps(rows, loss.tukey);
  Evaluation all = Evaluation::nothing(known + unseen_mode_count);
  for (std::size_t s = 0; s < steps; ++s)
    for (const TermRows& each : rows[s]) add_rows(each, weighed, each.unknowns, all);
  const Evaluation before = objective.assemble(objective.last_rows(), optimum.unknowns, weighed);  // with priors
  const auto of_known = Eigen::seqN(0, known);
  MatrixX information = all.information(factor);
  information(of_known, of_known) = before.information(factor);
  VectorX gradient = all.gradient;
  gradient(of_known) = before.gradient;
  for (int m = 0; m < unseen_mode_count; ++m) {
    information(known + m, known + m) += 1;
    gradient(known + m) += amounts(m);
  }
  std::vector<int> moving = free_unknowns(objective.unknowns());
  const Index free = static_cast<Index>(moving.size());
  const auto inverse = [](const MatrixX& m) { return MatrixX(m.ldlt().solve(MatrixX::Identity(m.rows(), m.cols()))); };
  const MatrixX without = inverse(information(moving, moving));
  const MatrixX effect = -without * information(moving, places);  // of one standard deviation of a mode
  moving.insert(moving.end(), places.begin(), places.end());
  const MatrixX with = inverse(information(moving, moving));
  NewtonStep step;
  step.move = -with * gradient(moving);
  step.gain = -0.5 * gradient(moving).dot(step.move);
  // A ratio that would leave its range stops there, and E does not go along with the rest of its way.
  if (leaves_range(objective.unknowns(), optimum.unknowns, moving, step.move))
    step = step_in_range(objective.unknowns(), optimum.unknowns, information, gradient, moving);
  const VectorX& change = step.move;
  if (!change.allFinite()) return std::nullopt;

  UnseenModes out;
  out.change = VectorX::Zero(known);
  for (Index k = 0; k < free; ++k) out.change(moving[static_cast<std::size_t>(k)]) = change(k);
  out.amounts = amounts + change.tail(unseen_mode_count);
  out.gain = step.gain;
  const int parameters = objective.unknowns().parameter_count();
  out.widening = MatrixX::Zero(parameters, parameters);
  for (Index a = 0; a < free; ++a)
    for (Index b = 0; b < free; ++b) {
      const int i = moving[static_cast<std::size_t>(a)], j = moving[static_cast<std::size_t>(b)];
      if (i < parameters && j < parameters) out.widening(i, j) = with(a, b) - without(a, b) + std::pow(unseen_rough_share, 2) * effect.row(a).dot(effect.row(b));
    }
  return out;
}

}  // namespace palpate::estimation
