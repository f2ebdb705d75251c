// SPDX-License-Identifier: Apache-2.0
// FEBio 4 (febio_spec 4.0). Its `neo-Hookean` has the stress (mu (b - I) + lambda ln J I) / J, our neo_hookean; `isotropic
// elastic` is St. Venant-Kirchhoff. E and nu are those of small strains.
#include <fmt/format.h>

#include <array>

#include "palpate/io/export_formats.hpp"

namespace palpate::io {
namespace {

/// A comment of XML ends at two of them, and a name may hold anything.
std::string without_dashes(std::string name) {
  for (char& c : name)
    if (c == '-' || c == '<' || c == '>' || c == '&') c = '_';
  return name;
}

}  // namespace

ExportFiles export_febio(const ExportModel& model) {
  const auto& mesh = model.mesh;
  std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<febio_spec version=\"4.0\">\n  <Module type=\"solid\"/>\n  <Control>\n"
      "    <analysis>STATIC</analysis>\n    <time_steps>10</time_steps>\n    <step_size>0.1</step_size>\n"
      "    <solver type=\"solid\"/>\n  </Control>\n";
  const std::vector<ExportRegion> one{{"", model.young_modulus_pa, model.poisson_ratio}};
  const std::vector<ExportRegion>& parts = model.regions.empty() ? one : model.regions;
  const auto numbered = [&](const char* name, std::size_t r) { return model.regions.empty() ? std::string(name) : fmt::format("{}{}", name, r + 1); };
  text += "  <Material>\n";
  for (std::size_t r = 0; r < parts.size(); ++r) {
    if (!model.regions.empty()) text += "    <!-- region " + std::to_string(r + 1) + ": " + without_dashes(parts[r].name) + " -->\n";
    text += fmt::format(
        "    <material id=\"{}\" name=\"{}\" type=\"{}\">\n      <density>{:.15g}</density>\n"
        "      <E>{:.15g}</E>\n      <v>{:.15g}</v>\n    </material>\n",
        r + 1, numbered("learned", r), model.law == "stvk" ? "isotropic elastic" : "neo-Hookean",
        model.density_kg_m3 > 0 ? model.density_kg_m3 : 1.0, parts[r].young_modulus_pa, parts[r].poisson_ratio);
  }
  text += "  </Material>\n  <Mesh>\n    <Nodes name=\"all\">\n";
  for (Eigen::Index i = 0; i < mesh.nodes_m.rows(); ++i)
    text += fmt::format("      <node id=\"{}\">{:.15g},{:.15g},{:.15g}</node>\n", i + 1, mesh.nodes_m(i, 0),
                        mesh.nodes_m(i, 1), mesh.nodes_m(i, 2));
  text += "    </Nodes>\n";
  for (std::size_t r = 0; r < parts.size(); ++r) {
    text += fmt::format("    <Elements type=\"{}\" name=\"{}\">\n", mesh.tetrahedra.cols() == 10 ? "tet10" : "tet4", numbered("object", r));
    for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
      if (!model.regions.empty() && model.region[static_cast<std::size_t>(t)] != static_cast<int>(r)) continue;
      text += fmt::format("      <elem id=\"{}\">", t + 1);
      for (Eigen::Index k = 0; k < mesh.tetrahedra.cols(); ++k)
        text += (k > 0 ? "," : "") + std::to_string(mesh.tetrahedra(t, k) + 1);
      text += "</elem>\n";
    }
    text += "    </Elements>\n";
  }
  if (!model.fixed.empty()) text += "    <NodeSet name=\"fixed\">" + joined_indices(model.fixed, ",", 1) + "</NodeSet>\n";
  std::array<std::vector<Index>, 3> slides;
  for (const auto& [node, axis] : model.sliding) slides[static_cast<std::size_t>(axis)].push_back(node);
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (!slides[axis].empty()) text += fmt::format("    <NodeSet name=\"slides{}\">{}</NodeSet>\n", axis + 1, joined_indices(slides[axis], ",", 1));
  for (std::size_t i = 0; i < model.forces_n.size(); ++i)
    text += fmt::format("    <NodeSet name=\"load{}\">{}</NodeSet>\n", i + 1, model.forces_n[i].first + 1);
  text += "  </Mesh>\n  <MeshDomains>\n";
  for (std::size_t r = 0; r < parts.size(); ++r)
    text += fmt::format("    <SolidDomain name=\"{}\" mat=\"{}\"/>\n", numbered("object", r), numbered("learned", r));
  text += "  </MeshDomains>\n";
  if (!model.fixed.empty() || !model.sliding.empty()) text += "  <Boundary>\n";
  const auto held = [&](const std::string& nodes, int x, int y, int z) {
    text += fmt::format("    <bc name=\"held {0}\" node_set=\"{0}\" type=\"zero displacement\">\n      <x_dof>{1}</x_dof>\n"
                        "      <y_dof>{2}</y_dof>\n      <z_dof>{3}</z_dof>\n    </bc>\n", nodes, x, y, z);
  };
  if (!model.fixed.empty()) held("fixed", 1, 1, 1);
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (!slides[axis].empty()) held(fmt::format("slides{}", axis + 1), axis == 0, axis == 1, axis == 2);
  if (!model.fixed.empty() || !model.sliding.empty()) text += "  </Boundary>\n";
  const bool falls = model.gravity_m_s2.norm() > 0 && model.density_kg_m3 > 0;
  if (falls || !model.forces_n.empty()) {
    text += "  <Loads>\n";
    // FEBio's body force acts against its vector.
    if (falls)
      text += fmt::format(
          "    <body_load name=\"gravity\" type=\"body force\">\n      <force lc=\"1\">{:.15g},{:.15g},{:.15g}</force>\n    "
          "</body_load>\n",
          -model.gravity_m_s2.x(), -model.gravity_m_s2.y(), -model.gravity_m_s2.z());
    for (std::size_t i = 0; i < model.forces_n.size(); ++i) {
      const Vec3& f = model.forces_n[i].second;
      text += fmt::format(
          "    <nodal_load name=\"load{0}\" node_set=\"load{0}\" type=\"nodal_force\">\n      <value "
          "lc=\"1\">{1:.15g},{2:.15g},{3:.15g}</value>\n    </nodal_load>\n",
          i + 1, f.x(), f.y(), f.z());
    }
    text +=
        "  </Loads>\n  <LoadData>\n    <load_controller id=\"1\" name=\"ramp\" type=\"loadcurve\">\n      "
        "<interpolate>LINEAR</interpolate>\n"
        "      <points>\n        <pt>0,0</pt>\n        <pt>1,1</pt>\n      </points>\n    </load_controller>\n  "
        "</LoadData>\n";
  }
  return {{"object.feb", text + "</febio_spec>\n"}};
}

}  // namespace palpate::io
