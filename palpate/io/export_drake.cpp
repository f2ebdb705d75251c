// SPDX-License-Identifier: Apache-2.0
// Drake: SDF 1.8 with drake:deformable_properties; one collision, no inertial, mesh as legacy ASCII VTK.
#include <fmt/format.h>

#include "palpate/io/export_formats.hpp"

namespace palpate::io {

ExportFiles export_drake(const ExportModel& model) {
  const std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<sdf version=\"1.8\" xmlns:drake=\"http://drake.mit.edu\">\n  <model name=\"{0}\">\n    "
      "<link name=\"{0}\">\n"
      "      <collision name=\"mesh\">\n        <geometry>\n          <mesh>\n            <uri>object.vtk</uri>\n          "
      "</mesh>\n        </geometry>\n"
      "        <drake:proximity_properties>\n          <drake:mu_dynamic>0.5</drake:mu_dynamic>\n        "
      "</drake:proximity_properties>\n      </collision>\n"
      "      <drake:deformable_properties>\n        <drake:youngs_modulus>{1:.15g}</drake:youngs_modulus>\n"
      "        <drake:poissons_ratio>{2:.15g}</drake:poissons_ratio>\n        "
      "<drake:mass_density>{3:.15g}</drake:mass_density>\n"
      "        <drake:mass_damping>0.1</drake:mass_damping>\n        "
      "<drake:stiffness_damping>0.01</drake:stiffness_damping>\n"
      "        <drake:material_model>linear_corotated</drake:material_model>\n      </drake:deformable_properties>\n    "
      "</link>\n  </model>\n</sdf>\n",
      model.name, model.young_modulus_pa, model.poisson_ratio, model.density_kg_m3);
  return {{"object.sdf", text}, {"object.vtk", ascii_vtk(model)}};
}

}  // namespace palpate::io
