// SPDX-License-Identifier: Apache-2.0
// A block of a few dozen tetrahedra, how it is held and pushed: what the tests of this room share.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/estimation/forward_model.hpp"
#include "palpate/estimation/terms/term.hpp"
#include "palpate/fem/regions.hpp"

namespace palpate::estimation {

/// nx x ny x nz cells of six Kuhn tetrahedra, from the origin to `size_m`.
inline TetMesh kuhn_block(int nx, int ny, int nz, const Vec3& size_m) {
  TetMesh mesh;
  const auto id = [&](const std::array<int, 3>& at) { return (at[2] * (ny + 1) + at[1]) * (nx + 1) + at[0]; };
  mesh.nodes_m.resize((nx + 1) * (ny + 1) * (nz + 1), 3);
  mesh.tetrahedra.resize(6 * nx * ny * nz, 4);
  for (int k = 0; k <= nz; ++k)
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i)
        mesh.nodes_m.row(id({i, j, k})) << size_m.x() * i / nx, size_m.y() * j / ny, size_m.z() * k / nz;
  Index row = 0;
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        std::array<int, 3> order{0, 1, 2};
        do {  // one tetrahedron for every way along the edges from one corner of the cell to the opposite one
          std::array<int, 3> at{i, j, k};
          std::array<Index, 4> node{id(at), 0, 0, 0};
          for (std::size_t step = 0; step < 3; ++step) {
            ++at[static_cast<std::size_t>(order[step])];
            node[step + 1] = id(at);
          }
          Mat3 edges;
          for (int a = 0; a < 3; ++a) {
            edges.col(a) = (mesh.nodes_m.row(node[static_cast<std::size_t>(a) + 1]) - mesh.nodes_m.row(node[0])).transpose();
          }
          if (edges.determinant() < 0) std::swap(node[2], node[3]);
          for (int a = 0; a < 4; ++a) mesh.tetrahedra(row, a) = node[static_cast<std::size_t>(a)];
          ++row;
        } while (std::next_permutation(order.begin(), order.end()));
      }
  return mesh;
}

inline std::vector<Index> nodes_where(const TetMesh& mesh, const std::function<bool(const Vec3&)>& chosen) {
  std::vector<Index> nodes;
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    if (chosen(mesh.nodes_m.row(i).transpose())) nodes.push_back(i);
  }
  return nodes;
}

inline SimulatedObject simulated(const TetMesh& mesh, const std::string& material) {
  return {mesh, SimulatedSurface::boundary_of(mesh, nullptr), material, {}, {}};
}

/// Thirds of the block along x, the middle one first.
inline void put_three_regions(SimulatedObject& object) {
  const double length_m = object.mesh.nodes_m.col(0).maxCoeff();
  for (Index e = 0; e < object.mesh.tetrahedra.rows(); ++e) {
    const double third = 3 * fem::element_centre(object.mesh, e).x() / length_m;
    object.region.push_back(third < 1 ? 1 : third < 2 ? 0 : 2);
  }
  object.region_names = {"middle", "clamped", "free"};
}

inline Support sliding(const std::string& name, const Vec3& point_m, const Vec3& normal) {
  Support support;
  support.name = name;
  support.kind = SupportKind::plane;
  support.select = NodeSelection::plane;
  support.plane = {point_m, normal};
  support.tolerance_m = 1e-6;
  support.contact = ContactLaw::frictionless;
  return support;
}

inline const Vec3 block_size_m(0.06, 0.04, 0.03);

/// The block clamped at x = 0 in a clamp whose pose is uncertain, under its own weight. Push "tip": a measured force at the
/// free end, and an unloaded step. Push "plate": a smooth platen pressed into the top. Push "disc": a pad whose place is not
/// exactly known. The rest surface has a slow error. Every nuisance has a prior.
inline Recording clamped_block(const TetMesh& mesh, bool weight = true) {
  Recording recording;
  Support clamp;
  clamp.name = "clamp";
  clamp.kind = SupportKind::clamp;
  clamp.vertices = nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; });
  clamp.pose_std_m = 1e-3;
  clamp.pose_std_rad = 0.02;
  clamp.pose_varies = PoseVaries::push;
  clamp.spread_std_m = 2e-4;
  clamp.compliance_m_per_n = 6e-5;
  clamp.compliance_std_m_per_n = 4e-5;
  recording.supports.push_back(clamp);
  if (weight) {
    recording.environment.gravity_m_s2 = Vec3(0, 0, -9.81);
    recording.density_kg_m3 = 1000;
    recording.density_std_kg_m3 = 50;
  }
  recording.force_scale_std = 0.02;
  recording.force_cross_talk_std = 0.015;
  recording.time_offset_std_s = 0.02;

  Tool tip;
  tip.name = "tip";
  tip.shape = ToolShape::vertices;
  tip.vertices =
      nodes_where(mesh, [](const Vec3& x) { return x.x() > block_size_m.x() - 1e-9 && x.z() > block_size_m.z() - 1e-9; });
  Tool plate;
  plate.name = "plate";
  plate.shape = ToolShape::platen;
  plate.plane = {Vec3(0, 0, block_size_m.z()), -Vec3::UnitZ()};
  plate.contact = ContactLaw::frictionless;
  Tool disc;
  disc.name = "disc";
  disc.shape = ToolShape::disc;
  disc.radius_m = 0.012;
  disc.radius_std_m = 1.5e-3;
  disc.compliance_std_m_per_n = 2e-3;
  plate.compliance_std_m_per_n = 3e-4;
  recording.tools = {tip, plate, disc};
  recording.rest.surface_std_m = 4e-4;
  recording.rest.surface_correlation_m = 0.03;

  Push by_tip;
  by_tip.name = "tip";
  by_tip.force_tare_std_n = 0.01;
  by_tip.travel_offset_std_m = 5e-4;
  Load force;
  force.tool = "tip";
  force.force_n = Vec3(0.04, 0.03, -0.12);
  force.direction = Vec3(0.2, 0.1, -1).normalized();
  force.force_std_n = 0.005;
  force.force_relative_std = 0.02;
  force.force_rate_n_s = Vec3(0.02, -0.01, -0.3);
  by_tip.steps.resize(2);
  by_tip.steps[0].loads = {force};

  Push by_plate;
  by_plate.name = "plate";
  by_plate.force_tare_std_n = 0.02;
  by_plate.travel_offset_std_m = 3e-4;
  Load travel;
  travel.tool = "plate";
  travel.travel_m = 0.002;
  travel.direction = -Vec3::UnitZ();
  by_plate.steps.resize(1);
  by_plate.steps[0].loads = {travel};
  Wrench read;  // what the plate's compliance works on
  read.tool = "plate";
  read.force_n = Vec3(0.1, 0, -1.5);
  read.force_sigma_n = 0.05;
  by_plate.steps[0].observations = {read};

  Push by_disc;
  by_disc.name = "disc";
  Load press;
  press.tool = "disc";
  press.force_n = Vec3(0.02, 0, -0.15);
  press.contact_m = Vec3(0.04, 0.02, block_size_m.z());
  press.direction = Vec3(0.1, 0, -1).normalized();
  press.contact_std_m = 2e-3;
  by_disc.steps.resize(1);
  by_disc.steps[0].loads = {press};

  recording.pushes = {by_tip, by_plate, by_disc};
  return recording;
}

/// A state far from rest: every nuisance stands off its prior mean by a good part of its standard deviation.
inline VectorX away_from_rest(const Unknowns& unknowns) {
  VectorX at = unknowns.prior_mean();
  for (int k = 2; k < unknowns.size(); ++k) at(k) += (0.9 - 0.23 * (k % 8)) * unknowns[k].prior_std;
  at(log_young) = std::log(2e4);
  at(poisson) = 0.3;
  return at;
}

/// A step for central differences: small against the scale on which predictions bend.
inline double difference_of(const Unknowns& unknowns, int k) { return k <= poisson ? 2e-5 : 1e-3 * unknowns[k].prior_std; }

/// Solved so tightly that differences of two solutions are those of the model.
inline fem::StaticsOptions tight() {
  fem::StaticsOptions options;
  options.residual_tolerance = 1e-12;
  return options;
}

}  // namespace palpate::estimation
