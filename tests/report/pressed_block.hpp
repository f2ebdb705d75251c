// SPDX-License-Identifier: Apache-2.0
// A block with a dimple that grows from step to step: an Identification whose every number is known by formula, for tests of
// the page. It stands for no measurement.
#pragma once

#include <cmath>
#include <random>
#include <string>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"

namespace pressed_block {

struct Size {
  int cells = 14;  ///< along an edge of the block
  int pushes = 2;
  int steps = 8;
  int points = 1200;  ///< a step
  unsigned seed = 1;
};

constexpr double edge_m = 0.15, noise_m = 0.001, young_pa = 20300, poisson = 0.31;

inline palpate::TriMesh block(int cells) {
  palpate::TriMesh mesh;
  const int side = cells + 1;
  mesh.vertices_m.resize(6 * side * side, 3);
  mesh.triangles.resize(12 * cells * cells, 3);
  Eigen::Index vertex = 0, triangle = 0;
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const bool far = face % 2 == 1;
    const Eigen::Index first = vertex;
    for (int i = 0; i < side; ++i) {
      for (int j = 0; j < side; ++j) {
        palpate::Vec3 p;
        p(axis) = far ? 1 : 0;
        p((axis + 1) % 3) = double(i) / cells;
        p((axis + 2) % 3) = double(j) / cells;
        mesh.vertices_m.row(vertex++) = edge_m * (p - palpate::Vec3(0.5, 0.5, 0));
      }
    }
    for (int i = 0; i < cells; ++i) {
      for (int j = 0; j < cells; ++j) {
        const auto a = static_cast<palpate::Index>(first + i * side + j), b = a + side, c = b + 1, d = a + 1;
        mesh.triangles.row(triangle++) = far ? Eigen::RowVector3i(a, b, c) : Eigen::RowVector3i(a, c, b);
        mesh.triangles.row(triangle++) = far ? Eigen::RowVector3i(a, c, d) : Eigen::RowVector3i(a, d, c);
      }
    }
  }
  return mesh;
}

/// Dimple of the top around `centre`, fading towards the bottom.
inline palpate::Points dimpled(const palpate::Points& points, const palpate::Vec3& centre, double depth_m) {
  palpate::Points moved = points;
  for (Eigen::Index i = 0; i < moved.rows(); ++i) {
    const double r2 = (points.row(i).head<2>() - centre.head<2>().transpose()).squaredNorm();
    const double height = points(i, 2) / edge_m;
    const double sink = depth_m * std::exp(-r2 / (2 * 0.03 * 0.03)) * height;
    moved(i, 2) -= sink;
    moved(i, 0) += 0.25 * sink * (points(i, 0) - centre.x()) / 0.03 * height;
    moved(i, 1) += 0.25 * sink * (points(i, 1) - centre.y()) / 0.03 * height;
  }
  return moved;
}

inline palpate::Identification identification(const Size& size = {}) {
  using namespace palpate;
  std::mt19937_64 random(size.seed);
  std::normal_distribution<double> normal;
  Identification id;
  id.material = "neo_hookean";
  id.termination = Termination::converged;
  id.message = "relative step below tolerance";
  id.parameters = {{"young_modulus", "", "Pa", young_pa, 410, 19520, 21120, true},
                   {"poisson_ratio", "", "", poisson, 0.05, 0.21, 0.41, true}};
  id.nuisances = {{"pose z of push 1", "m", 0.0004, 0.0002, 0, 0.0008, 0.001, 0.4},
                  {"force scale", "", 1.01, 0.008, 0.995, 1.026, 0.01, 1.0},
                  {"clamp angle", "rad", 0.11, 0.01, 0.09, 0.13, 0.03, 3.6}};
  id.verdicts = {
      {"nuisance_beyond_prior", "The clamp is turned by 6.3 degrees, 3.6 times what was thought likely: check it."}};
  id.budget = {
      {"force scale", 1.0, 0.001}, {"contact point", 0.6, 0.004}, {"rest surface", 1.7, 0.02}, {"mesh", 0.3, 0.001}};
  id.provenance = {{"options", "--material neo_hookean"}, {"seed", "1"}};
  id.timing_s = {{"object", 0.4}, {"fit", 2.1}};
  id.prediction = {true, "push 2", 0.021, 0.0011, 0.0062, 0.0029, 0.001, 0.994};
  id.surface = block(size.cells);
  const auto vertices = id.surface.vertices_m.rows();
  double squares = 0;
  std::size_t points = 0;
  for (int p = 0; p < size.pushes; ++p) {
    const Vec3 contact((p % 3 - 0.5) * 0.04, (p / 3) * 0.03, edge_m);
    const std::string name = "push " + std::to_string(p + 1);
    for (int s = 0; s < size.steps; ++s) {
      StepFit step;
      step.push = name;
      step.step = s;
      step.travel_m = 0.04 * s / std::max(1, size.steps - 1);
      step.travel_predicted_m = step.travel_m;
      step.surface_m = dimpled(id.surface.vertices_m, contact, step.travel_m);
      step.observed_m.resize(size.points, 3);
      step.residual_m.resize(size.points);
      for (int i = 0; i < size.points; ++i) {
        const auto v = static_cast<Eigen::Index>(random() % static_cast<std::uint64_t>(vertices));
        const double r = noise_m * normal(random);
        step.observed_m.row(i) = step.surface_m.row(v) + Eigen::RowVector3d(0, 0, r);
        step.residual_m(i) = i % 50 == 49 ? std::nan("") : r;
        if (i % 50 != 49) squares += r * r, ++points;
      }
      step.force_predicted_n = 0.9e3 * step.travel_m * (1 + 6 * step.travel_m);
      step.force_predicted_std_n = 0.02 * step.force_predicted_n + 0.2;
      step.force_measured_n = step.force_predicted_n * (1 + 0.02 * normal(random));
      step.force_n = Vec3(0, 0, -step.force_measured_n);
      step.contact_m = contact;
      step.tool_radius_m = 0.012;
      step.von_mises_pa = (step.surface_m - id.surface.vertices_m).rowwise().norm() * (young_pa / edge_m);
      step.masked_m = Points::Zero(40, 3);  // a strip of table beside the block
      for (int i = 0; i < 40; ++i) step.masked_m.row(i) << edge_m * (0.55 + 0.005 * i), edge_m * (0.02 * i - 0.4), 0;
      id.steps.push_back(step);
    }
    id.per_push.push_back(
        {"young_modulus", name, "Pa", young_pa * (1 + 0.02 * p), 600, 19100.0 + 400 * p, 21500.0 + 400 * p, true});
  }
  if (size.pushes > 1) {  // the first two at one place, the others at another
    id.per_site = {{"young_modulus", "left", "Pa", young_pa * 1.01, 500, 19300, 21300, true},
                   {"young_modulus", "right", "Pa", young_pa * 0.99, 500, 18900, 20900, true}};
  }
  id.fit = {std::sqrt(squares / static_cast<double>(points)),   1.03, points, static_cast<std::size_t>(size.pushes),
            static_cast<std::size_t>(size.pushes * size.steps), 6,    9};
  const Eigen::Index n = 41;
  id.posterior.young_modulus_pa = VectorX::LinSpaced(n, std::log(18300), std::log(22500)).array().exp();
  id.posterior.poisson_ratio = VectorX::LinSpaced(n, 0.1, 0.4995);
  id.posterior.density.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const double a = std::log(id.posterior.young_modulus_pa(i) / young_pa) / 0.02,
                   b = (id.posterior.poisson_ratio(j) - poisson) / 0.05;
      id.posterior.density(i, j) = std::exp(-(a * a - 2 * 0.7 * a * b + b * b) / (2 * (1 - 0.49)));
    }
  }
  for (int k = 0; k < 7; ++k)
    id.trace.push_back({young_pa * (1 + 0.8 * std::exp(-1.2 * k)), poisson, 7000 + 90000 * std::exp(-2.4 * k)});
  return id;
}

inline palpate::Recording recording() {
  palpate::Recording r;
  r.source = "recordings/pressed_block";
  palpate::Tool tool;
  tool.name = "stick";
  tool.radius_m = 0.012;
  r.tools.push_back(tool);
  palpate::Support support;
  support.kind = palpate::SupportKind::table;
  r.supports.push_back(support);
  r.environment.gravity_m_s2 = palpate::Vec3(0, 0, -9.81);
  r.input_hashes["recording.yaml"] = std::string(64, 'a');
  return r;
}

}  // namespace pressed_block
