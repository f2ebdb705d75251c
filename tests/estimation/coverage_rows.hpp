// SPDX-License-Identifier: Apache-2.0
// What the coverage table is about: rows (what is wrong with a recording) and scenes (what is pressed, where, and seen from where).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/lab/box_surface.hpp"
#include "palpate/lab/implicit_surface.hpp"

namespace palpate::coverage {

/// What is wrong with a recording: a row of the table. Each is drawn with the standard deviation that the recording states.
struct Row {
  std::string name;
  double outlier_share = 0;
  double tare_share = 0;  ///< of the highest force
  double pose_m = 0, pose_rad = 0;
  double rest_m = 0, rest_length_m = 0.04;
  double contact_m = 0;
  double correlated_m = 0, correlated_length_m = 0.015;
  double depth_m = 0.02;
};

inline std::vector<Row> rows() {
  constexpr double degree = EIGEN_PI / 180;
  std::vector<Row> all(8);
  all[0].name = "clean";
  all[1].name = "outliers", all[1].outlier_share = 0.05;
  all[2].name = "tare", all[2].tare_share = 0.02;
  all[3].name = "pose", all[3].pose_m = 1e-3, all[3].pose_rad = 0.2 * degree;
  all[4].name = "rest", all[4].rest_m = 5e-4;
  all[5].name = "contact", all[5].contact_m = 4e-3;
  all[6].name = "correlated", all[6].correlated_m = 3e-4;
  all[7] = {"all", 0.05, 0.02, 1e-3, 0.2 * degree, 5e-4, 0.04, 4e-3, 3e-4, 0.015, 0.04};
  return all;
}

struct SceneSpec {
  std::string name;
  TriMesh surface;
  std::vector<Support> supports;
  Vec3 contact_m, direction, eye_m;
  double pad_radius_m = 0.015;
  int true_tetrahedra = 24000;  ///< some eight times the fit's, or three times
};

inline Support table() {
  Support support;
  support.name = "table";
  support.kind = SupportKind::plane;
  support.select = NodeSelection::plane;
  return support;
}

inline SceneSpec cube_top() {
  return {"cube_top", lab::box_surface({-0.075, -0.075, 0}, {0.075, 0.075, 0.15}, 10), {table()}, {0, 0, 0.15}, -Vec3::UnitZ(),
          {0.3, -0.35, 0.55}};
}

inline SceneSpec ball_top() {
  const Vec3 centre(0, 0, 0.065);
  return {"ball_top",
          lab::implicit_surface([centre](const Vec3& p) { return (p - centre).norm() - 0.075; },
                                {Vec3(-0.085, -0.085, 0), Vec3(0.085, 0.085, 0.15), 0.004}),
          {table()}, {0, 0, 0.14}, -Vec3::UnitZ(), {0.3, -0.35, 0.5}};
}

inline SceneSpec bar_oblique() {
  return {"bar_oblique", lab::box_surface({-0.03, -0.03, 0}, {0.03, 0.03, 0.18}, 12), {table()}, {0, 0, 0.18},
          Vec3(1, 0, -1).normalized(), {-0.3, -0.35, 0.5}};
}

/// The optional data's teddy, standing, 0.3 m high, pushed into the belly.
inline std::optional<SceneSpec> teddy_belly() {
  const std::filesystem::path file = std::filesystem::path(PALPATE_SHARED_DIR) / "data/meshes/teddy_autoknit.obj";
  if (!std::filesystem::exists(file)) return std::nullopt;
  SceneSpec spec;
  spec.name = "teddy_belly";
  const TriMesh given = io::read_tri_mesh(file);
  spec.surface = given;
  spec.surface.vertices_m.col(1) = -given.vertices_m.col(2);  // y is up in the file
  spec.surface.vertices_m.col(2) = given.vertices_m.col(1);
  spec.surface.vertices_m *= 0.3 / (given.vertices_m.col(1).maxCoeff() - given.vertices_m.col(1).minCoeff());
  const double foot_m = spec.surface.vertices_m.col(2).minCoeff();
  spec.surface.vertices_m.col(2).array() -= foot_m;
  Support glue;
  glue.name = "glue";
  glue.kind = SupportKind::box;
  glue.select = NodeSelection::box;
  glue.box_min_m = Vec3(-1, -1, -0.01);
  glue.box_max_m = Vec3(1, 1, 0.02);
  spec.supports = {glue};
  const auto hit = geometry::TriangleTree(spec.surface).cast({0, -1, 0.12}, Vec3::UnitY());
  spec.contact_m = Vec3(0, -1 + hit->range_m, 0.12);
  spec.direction = Vec3::UnitY();
  spec.eye_m = Vec3(0.35, -0.5, 0.3);
  spec.true_tetrahedra = 80000;  // its fits refine their mesh
  return spec;
}

inline std::vector<SceneSpec> scenes() {
  std::vector<SceneSpec> all{cube_top(), ball_top(), bar_oblique()};
  if (auto teddy = teddy_belly()) all.push_back(*teddy);
  return all;
}

}  // namespace palpate::coverage
