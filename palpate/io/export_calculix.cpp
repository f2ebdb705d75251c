// SPDX-License-Identifier: Apache-2.0
// Input decks of CalculiX and Abaqus: same keywords; each prints the displacements in its own way. Their ten-node tetrahedra
// number the midpoints of edges 01, 12, 02, 03, 13, 23, as TetMesh does.
//
// NEO HOOKE is mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2, our neo_hookean_isochoric, with C10 = mu/2 and D1 = 2/K; HYPERFOAM with
// one term is our foam (for Abaqus: ccx 2.20 stops at the matrix of its own at rest). *ELASTIC with NLGEOM is St. Venant-Kirchhoff in CalculiX; Abaqus has a law of rates there, which is
// none of ours.
#include <fmt/format.h>

#include "palpate/io/export_formats.hpp"

namespace palpate::io {
namespace {

// CalculiX reads 20 characters of a number and no more: 13 digits fit with sign and exponent.

std::string material_card(const ExportModel& model, double young_pa, double poisson) {
  const LameConstants lame = lame_constants(young_pa, poisson);
  if (model.law == "foam") return fmt::format("*HYPERFOAM, N=1\n{:.13g}, {:.13g}, {:.13g}\n", lame.mu_pa, model.law_parameters(0), poisson);
  if (model.law == "neo_hookean_isochoric")
    return fmt::format("*HYPERELASTIC, NEO HOOKE\n{:.13g}, {:.13g}\n", lame.mu_pa / 2, 2 / (lame.lambda_pa + lame.mu_pa * 2 / 3));
  return fmt::format("*ELASTIC\n{:.13g}, {:.13g}\n", young_pa, poisson);
}

/// @param tight  makes its equilibria as sharp as what it prints
std::string deck(const ExportModel& model, const std::string& tight, const std::string& output) {
  const auto& mesh = model.mesh;
  std::string text = fmt::format("*HEADING\n{}: metres, newtons, pascals\n*NODE, NSET=NALL\n", model.name);
  for (Eigen::Index i = 0; i < mesh.nodes_m.rows(); ++i)
    text +=
        fmt::format("{}, {:.13g}, {:.13g}, {:.13g}\n", i + 1, mesh.nodes_m(i, 0), mesh.nodes_m(i, 1), mesh.nodes_m(i, 2));
  text += fmt::format("*ELEMENT, TYPE={}, ELSET=EALL\n", mesh.tetrahedra.cols() == 10 ? "C3D10" : "C3D4");
  for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
    text += std::to_string(t + 1);
    for (Eigen::Index k = 0; k < mesh.tetrahedra.cols(); ++k) text += ", " + std::to_string(mesh.tetrahedra(t, k) + 1);
    text += "\n";
  }
  const auto material = [&](const std::string& name, const std::string& elements, double young_pa, double poisson) {
    text += fmt::format("*MATERIAL, NAME={}\n", name) + material_card(model, young_pa, poisson);
    if (model.density_kg_m3 > 0) text += fmt::format("*DENSITY\n{:.13g}\n", model.density_kg_m3);
    text += fmt::format("*SOLID SECTION, ELSET={}, MATERIAL={}\n", elements, name);
  };
  if (model.regions.empty()) material("LEARNED", "EALL", model.young_modulus_pa, model.poisson_ratio);
  for (std::size_t r = 0; r < model.regions.size(); ++r) {  // names of regions may be no words of a deck
    const ExportRegion& one = model.regions[r];
    text += fmt::format("** region {}: {}\n*ELSET, ELSET=E{}\n{}\n", r + 1, one.name, r + 1, joined_indices(elements_of(model, r), ",\n", 1));
    material(fmt::format("LEARNED{}", r + 1), fmt::format("E{}", r + 1), one.young_modulus_pa, one.poisson_ratio);
  }
  if (!model.fixed.empty()) {
    text += "*NSET, NSET=FIXED\n" + joined_indices(model.fixed, ",\n", 1) + "\n*BOUNDARY\nFIXED, 1, 3\n";
  }
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<Index> nodes;
    for (const auto& [node, along] : model.sliding)
      if (along == axis) nodes.push_back(node);
    if (!nodes.empty())
      text += fmt::format("*NSET, NSET=SLIDES{0}\n{1}\n*BOUNDARY\nSLIDES{0}, {0}, {0}\n", axis + 1, joined_indices(nodes, ",\n", 1));
  }
  // Large loads are not borne at once: five increments, and more where the solver needs them.
  text += model.law == "linear" ? "*STEP\n*STATIC\n" : "*STEP, NLGEOM, INC=200\n*STATIC\n0.2, 1.\n" + tight;
  const double g = model.gravity_m_s2.norm();
  if (g > 0 && model.density_kg_m3 > 0) {
    const Vec3 way = model.gravity_m_s2 / g;
    text += fmt::format("*DLOAD\nEALL, GRAV, {:.13g}, {:.13g}, {:.13g}, {:.13g}\n", g, way.x(), way.y(), way.z());
  }
  if (!model.forces_n.empty()) {
    text += "*CLOAD\n";
    for (const auto& [node, force] : model.forces_n)
      for (int d = 0; d < 3; ++d)
        if (force(d) != 0) text += fmt::format("{}, {}, {:.13g}\n", node + 1, d + 1, force(d));
  }
  return text + output + "*END STEP\n";
}

}  // namespace

ExportFiles export_calculix(const ExportModel& model) {
  return {{"object.inp", deck(model, "*CONTROLS, PARAMETERS=FIELD\n1.E-7, 1.E-7\n", "*NODE PRINT, NSET=NALL\nU\n*NODE FILE\nU\n*EL FILE\nS\n")}};
}

ExportFiles export_abaqus(const ExportModel& model) {
  return {{"object.inp", deck(model, "", "*OUTPUT, FIELD\n*NODE OUTPUT\nU\n*ELEMENT OUTPUT\nS\n")}};
}

}  // namespace palpate::io
