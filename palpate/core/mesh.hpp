// SPDX-License-Identifier: Apache-2.0
// Geometry as plain data. Checks and algorithms live in the room `geometry`.
#pragma once

#include <string>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate {

struct TriMesh {
  Points vertices_m;
  Triangles triangles;
};

/// Volume mesh. `tetrahedra` has 4 columns (linear) or 10 (quadratic; VTK order: corners 0-3, then the midpoints of the
/// edges 01, 12, 02, 03, 13, 23). Corners are ordered so that det(x1-x0, x2-x0, x3-x0) > 0.
struct TetMesh {
  Points nodes_m;
  Tetrahedra tetrahedra;
};

/// Carries a surface along with a volume: surface vertex i = sum_k weights(i,k) * nodes(tetrahedra(element(i), k)), k < 4.
/// Weights sum to one; they may be negative for a vertex slightly outside its element.
struct SurfaceEmbedding {
  Eigen::Matrix<Index, Eigen::Dynamic, 1> element;
  Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor> weights;
};

enum class RestState {
  stress_free,     ///< the given shape carries no stress
  under_gravity,   ///< seen while it already sags under its own weight: loads are increments about the seen shape
  under_pressure,  ///< inflated: a solid model yields an apparent modulus only
};

struct Plane {
  Vec3 point_m = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();  ///< unit length, points away from the solid half space (into the object's side)
};

enum class SupportKind { vertices, plane, box, table, wall, clamp };
enum class ContactLaw { bonded, frictionless, friction };
enum class NodeSelection { vertices, plane, box };
enum class PoseVaries { never, push, step };

/// How the object is held. Where it touches is chosen by `vertices`, by a box or by a plane (nodes within tolerance_m of
/// it); `select` says by which (of interest for a clamp, the other kinds imply it).
struct Support {
  SupportKind kind = SupportKind::vertices;
  NodeSelection select = NodeSelection::vertices;
  std::vector<Index> vertices;  ///< 0-based node indices of the rest volume (or surface) mesh
  Plane plane;
  Vec3 box_min_m = Vec3::Zero();
  Vec3 box_max_m = Vec3::Zero();
  double tolerance_m = 1e-4;
  ContactLaw contact = ContactLaw::bonded;
  double friction_coefficient = 0.0;
  double pose_std_m = 0.0;                     ///< clamp: prior on its translation; 0 = exactly known
  double pose_std_rad = 0.0;                   ///< clamp: prior on its rotation; 0 = exactly known
  double spread_std_m = 0.0;                   ///< flat and bonded: prior on how far its rim slides outwards at the highest load
  double compliance_m_per_n = 0.0;      ///< how far it gives way as a whole, with what it holds, per newton of the loads
  double compliance_std_m_per_n = 0.0;  ///< its prior standard deviation; 0 = exactly known
  PoseVaries pose_varies = PoseVaries::never;  ///< clamp: one pose in the recording, or one a push, or one a step
  std::string name;
  std::string source;  ///< file and line, for messages
};

struct ObjectModel {
  TriMesh surface;
  TetMesh volume;
  SurfaceEmbedding embedding;  ///< of `surface` in `volume`
  RestState rest_state = RestState::stress_free;
  std::vector<Support> supports;
  bool free = false;                  ///< `supports: free`: inertia relief
  double unseen_share = 0.0;          ///< share of the surface that was completed and not seen (0 for a whole model)
  std::vector<std::string> warnings;  ///< plain words from the quality gate
};

}  // namespace palpate
