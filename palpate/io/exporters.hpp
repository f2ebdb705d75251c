// SPDX-License-Identifier: Apache-2.0
// The learned object for other simulators. An exporter is one file export_NAME.cpp and one line in the table of
// exporters.cpp; the contract test and the command line loop over the table.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::io {

/// A part of the object with moduli of its own.
struct ExportRegion {
  std::string name;
  double young_modulus_pa = 0, poisson_ratio = 0;
};

/// What a simulator needs of an object. E and nu are those of small strains.
struct ExportModel {
  std::string name = "object";
  std::string law = "linear";  ///< that it was learned with; what a writer is given: that it is to write (written_law)
  VectorX law_parameters;      ///< the law's further ones (alpha of foam)
  TetMesh mesh;  ///< linear or quadratic
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< in regions: the first one's
  std::vector<ExportRegion> regions;               ///< empty: one
  std::vector<int> region;                         ///< an element: its region; empty: one
  double density_kg_m3 = 0;  ///< 0 = unknown
  std::vector<Index> fixed;  ///< nodes that supports hold
  std::vector<std::pair<Index, int>> sliding;  ///< nodes that are held along one axis (0, 1, 2) alone
  Vec3 gravity_m_s2 = Vec3::Zero();
  std::vector<std::pair<Index, Vec3>> forces_n;  ///< at nodes: a load to try the model with; static solvers take it
};

using ExportFiles =
    std::map<std::string, std::string>;  ///< file name -> bytes; the first to open stands in Exporter::main_file

/// What a simulator's file can hold.
enum class Holds { nodes, half_space, nothing };

/// What becomes of quadratic tetrahedra where only linear ones are taken.
enum class LinearElements {
  split,   ///< each in eight, with every node it has: much nearer to what was fitted
  corners  ///< its corners alone: an eighth of the elements
};

struct Exporter {
  std::string name;            ///< "calculix"
  std::string main_file;       ///< what to open, e.g. "object.inp"
  std::string about;           ///< what is written, and what was done so that E and nu mean there what they mean here
  /// Laws of palpate's that its file holds as they are; an object that was learned with another gets the first. Empty: the
  /// file names none, and whoever reads it chooses.
  std::vector<std::string> laws = {};
  bool quadratic = false;      ///< takes ten-node tetrahedra; others get linear ones (LinearElements)
  bool needs_density = false;  ///< simulates motion
  bool by_region = false;      ///< takes regions of different moduli
  bool carries_gravity = false;
  std::string gravity_set_by = {};  ///< where it does not: by what the user sets it
  Holds holds = Holds::nodes;       ///< else held_nodes.txt lists the nodes
  bool slides = false;              ///< holds nodes along one axis too
  ExportFiles (*write)(const ExportModel& model) = nullptr;
};

std::span<const Exporter> exporters();
/// @throws Error that lists the table's names.
const Exporter& exporter_named(const std::string& name);

/// The law that the simulator is given of an object that was learned with `learned`; empty: the reader's choice.
std::string written_law(const Exporter& exporter, const std::string& learned);

/// As the exporter is given it: checked, with the elements and the law that it takes.
/// @throws Error for E <= 0, nu outside [0, 0.5), a missing density where one is needed (motion, gravity), no tetrahedra, indices out
/// of range, regions that do not fit the elements or that the simulator does not take (naming those that do).
ExportModel written_model(const Exporter& exporter, const ExportModel& model, LinearElements elements = LinearElements::split);

/// Of written_model(). @throws Error as it does
ExportFiles export_files(const Exporter& exporter, const ExportModel& model, LinearElements elements = LinearElements::split);

/// Split: numbers of nodes stay, and curved elements stay curved. Corners: nodes renumbered (corner_places); loads of midpoints go to
/// their edge's ends, and midpoints are no longer held, since their ends are.
ExportModel with_linear_elements(const ExportModel& model, LinearElements elements);
/// A node: its number among the corners, or -1.
std::vector<Index> corner_places(const TetMesh& mesh);

/// Its normal points out of the half space that holds all held nodes and no other; nothing where there is none.
std::optional<Plane> held_half_space(const ExportModel& model);

}  // namespace palpate::io
