// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/exporters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "palpate/core/error.hpp"
#include "palpate/io/export_formats.hpp"
#include "palpate/io/yaml_field.hpp"

namespace palpate::io {

std::span<const Exporter> exporters() {
  static const std::vector<Exporter> table = {
      {.name = "calculix",
       .main_file = "object.inp",
       .about = "CalculiX: C3D4 or C3D10, *HYPERELASTIC, NEO HOOKE (its volume change costs K/2 (J - 1)^2); *ELASTIC of what was "
                "learned as linear or stvk",
       .laws = {"neo_hookean_isochoric", "linear", "stvk"},
       .quadratic = true,
       .by_region = true,
       .carries_gravity = true,
       .slides = true,
       .write = export_calculix},
      {.name = "abaqus",
       .main_file = "object.inp",
       .about = "Abaqus: C3D4 or C3D10, *HYPERELASTIC, NEO HOOKE (its volume change costs K/2 (J - 1)^2); *ELASTIC of what was "
                "learned as linear, *HYPERFOAM of foam",
       .laws = {"neo_hookean_isochoric", "linear", "foam"},
       .quadratic = true,
       .by_region = true,
       .carries_gravity = true,
       .slides = true,
       .write = export_abaqus},
      {.name = "febio",
       .main_file = "object.feb",
       .about = "FEBio 4: tet4 or tet10, neo-Hookean; isotropic elastic of what was learned as stvk",
       .laws = {"neo_hookean", "stvk"},
       .quadratic = true,
       .by_region = true,
       .carries_gravity = true,
       .slides = true,
       .write = export_febio},
      {.name = "sofa",
       .main_file = "object.scn",
       .about = "SOFA: TetrahedronFEMForceField, method large (corotational); E and nu as they are",
       .laws = {"corotational"},
       .needs_density = true,
       .by_region = true,
       .carries_gravity = true,
       .write = export_sofa},
      {.name = "mujoco",
       .main_file = "object.xml",
       .about = "MuJoCo 3.13 or later: flex (stvk); E and nu are changed so that its energy, which uses 2 lambda, becomes ours",
       .laws = {"stvk"},
       .needs_density = true,
       .carries_gravity = true,
       .write = export_mujoco},
      {.name = "drake",
       .main_file = "object.sdf",
       .about = "Drake: SDF with deformable_properties, linear_corotated (its neohookean would act softer)",
       .laws = {"corotational"},
       .needs_density = true,
       .gravity_set_by = "plant.mutable_gravity_field().set_gravity_vector()",
       .holds = Holds::half_space,
       .write = export_drake},
      {.name = "bullet",
       .main_file = "object.py",
       .about = "PyBullet: loadSoftBody with its Neo-Hookean law (neo_hookean_stable); its constants are changed so that small strains agree",
       .laws = {"neo_hookean_stable"},
       .needs_density = true,
       .carries_gravity = true,
       .write = export_bullet},
      {.name = "usd",
       .main_file = "object.usda",
       .about = "USD: volume deformable body and material of UsdPhysics; the law is the reader's",
       .needs_density = true,
       .gravity_set_by = "the stage's PhysicsScene",
       .holds = Holds::nothing,
       .write = export_usd},
  };
  return table;
}

const Exporter& exporter_named(const std::string& name) {
  std::vector<std::string> known;
  for (const Exporter& one : exporters()) {
    if (one.name == name) return one;
    known.push_back(one.name);
  }
  const auto near = nearest_word(name, known);
  throw Error("is no simulator that is known" + (near ? "; did you mean '" + *near + "'?" : std::string()) +
                  "; known are " + fmt::format("{}", fmt::join(known, ", ")),
              name);
}

std::string written_law(const Exporter& exporter, const std::string& learned) {
  if (exporter.laws.empty()) return {};
  const auto same = std::find(exporter.laws.begin(), exporter.laws.end(), learned);
  return same == exporter.laws.end() ? exporter.laws.front() : *same;
}

namespace {

void check_regions(const Exporter& exporter, const ExportModel& model) {
  const int count = static_cast<int>(model.regions.size());
  if (static_cast<Eigen::Index>(model.region.size()) != model.mesh.tetrahedra.rows() ||
      std::any_of(model.region.begin(), model.region.end(), [&](int r) { return r < 0 || r >= count; }))
    throw Error("needs one of the regions for each element", "export: region");
  for (const ExportRegion& one : model.regions)
    if (!(one.young_modulus_pa > 0) || !(one.poisson_ratio >= 0 && one.poisson_ratio < 0.5))
      throw Error("needs E above 0 and nu in [0, 0.5)", "export: region " + one.name);
  if (exporter.by_region) return;
  std::vector<std::string> taking;
  for (const Exporter& other : exporters())
    if (other.by_region) taking.push_back(other.name);
  throw Error(fmt::format("its file holds one stiffness an object, and this one has {} regions; {} take them, or estimate it without "
                          "(`--regions none`)",
                          count, fmt::join(taking, ", ")),
              "--to " + exporter.name);
}

}  // namespace

ExportModel written_model(const Exporter& exporter, const ExportModel& model, LinearElements elements) {
  const auto nodes = model.mesh.nodes_m.rows();
  if (model.mesh.tetrahedra.rows() == 0) throw Error("has no tetrahedra", "export: mesh");
  if (model.mesh.tetrahedra.minCoeff() < 0 || model.mesh.tetrahedra.maxCoeff() >= nodes)
    throw Error("names nodes that are not there", "export: mesh");
  if (!(model.young_modulus_pa > 0)) throw Error("must be positive", "export: young_modulus_pa");
  if (!(model.poisson_ratio >= 0 && model.poisson_ratio < 0.5)) throw Error("must be in [0, 0.5)", "export: poisson_ratio");
  if (!model.regions.empty()) check_regions(exporter, model);
  if (exporter.needs_density && !(model.density_kg_m3 > 0))
    throw Error(exporter.name + " simulates motion: give the object's density, kg/m3", "export: density_kg_m3");
  if (exporter.carries_gravity && model.gravity_m_s2.norm() > 0 && !(model.density_kg_m3 > 0))
    throw Error("gravity needs the object's density, kg/m3", "export: density_kg_m3");
  const auto outside = [&](Index node) { return node < 0 || node >= nodes; };
  if (std::any_of(model.fixed.begin(), model.fixed.end(), outside) ||
      std::any_of(model.sliding.begin(), model.sliding.end(), [&](const auto& one) { return outside(one.first) || one.second < 0 || one.second > 2; }) ||
      std::any_of(model.forces_n.begin(), model.forces_n.end(), [&](const auto& one) { return outside(one.first); }))
    throw Error("names nodes that are not there", "export: fixed, sliding, forces_n");
  ExportModel written = exporter.quadratic ? model : with_linear_elements(model, elements);
  written.law = written_law(exporter, model.law);
  if (written.law == "foam" && model.law_parameters.size() != 1) throw Error("foam needs its alpha", "export: law_parameters");
  return written;
}

ExportFiles export_files(const Exporter& exporter, const ExportModel& model, LinearElements elements) {
  return exporter.write(written_model(exporter, model, elements));
}

LameConstants lame_constants(double young, double nu) {
  return {young / (2 * (1 + nu)), young * nu / ((1 + nu) * (1 - 2 * nu))};
}

std::string joined_indices(const std::vector<Index>& indices, const char* separator, Index first) {
  std::string text;
  for (const Index index : indices) text += (text.empty() ? "" : separator) + std::to_string(index + first);
  return text;
}

std::string held_nodes_file(const ExportModel& model) {
  return "# nodes that supports hold, counted from 0: hold them in the simulator\n" + joined_indices(model.fixed, "\n", 0) + "\n";
}

std::vector<Index> elements_of(const ExportModel& model, std::size_t region) {
  std::vector<Index> elements;
  for (std::size_t e = 0; e < model.region.size(); ++e)
    if (model.region[e] == static_cast<int>(region)) elements.push_back(static_cast<Index>(e));
  return elements;
}

std::string ascii_vtk(const ExportModel& model) {
  std::string text = fmt::format("# vtk DataFile Version 3.0\n{}\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
                                 model.name, model.mesh.nodes_m.rows());
  for (Eigen::Index i = 0; i < model.mesh.nodes_m.rows(); ++i)
    text += fmt::format("{} {} {}\n", model.mesh.nodes_m(i, 0), model.mesh.nodes_m(i, 1), model.mesh.nodes_m(i, 2));
  const Eigen::Index cells = model.mesh.tetrahedra.rows();
  text += fmt::format("CELLS {} {}\n", cells, 5 * cells);
  for (Eigen::Index t = 0; t < cells; ++t) {
    const auto tet = model.mesh.tetrahedra.row(t);
    text += fmt::format("4 {} {} {} {}\n", tet(0), tet(1), tet(2), tet(3));
  }
  text += fmt::format("CELL_TYPES {}\n", cells);
  for (Eigen::Index t = 0; t < cells; ++t) text += "10\n";
  return text;
}

Triangles export_surface(const ExportModel& model) {
  constexpr int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  std::map<std::array<Index, 3>, std::pair<int, std::array<Index, 3>>> seen;
  for (Eigen::Index t = 0; t < model.mesh.tetrahedra.rows(); ++t) {
    for (const auto& face : faces) {
      const std::array<Index, 3> as_is = {model.mesh.tetrahedra(t, face[0]), model.mesh.tetrahedra(t, face[1]),
                                          model.mesh.tetrahedra(t, face[2])};
      std::array<Index, 3> key = as_is;
      std::sort(key.begin(), key.end());
      auto& entry = seen[key];
      ++entry.first;
      entry.second = as_is;
    }
  }
  std::vector<std::array<Index, 3>> boundary;
  for (const auto& [key, entry] : seen)
    if (entry.first == 1) boundary.push_back(entry.second);
  Triangles triangles(static_cast<Eigen::Index>(boundary.size()), 3);
  for (std::size_t i = 0; i < boundary.size(); ++i)
    for (int k = 0; k < 3; ++k) triangles(static_cast<Eigen::Index>(i), k) = boundary[i][static_cast<std::size_t>(k)];
  return triangles;
}

}  // namespace palpate::io
