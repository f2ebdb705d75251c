// SPDX-License-Identifier: Apache-2.0
// Drake: SDF 1.8 with drake:deformable_properties; one collision, no inertial, mesh as legacy ASCII VTK. Nodes can be held where
// they are all that lie in an open half space (drake:wall_boundary_condition, a child of the link).
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <limits>

#include "palpate/io/export_formats.hpp"

namespace palpate::io {

std::optional<Plane> held_half_space(const ExportModel& model) {
  if (model.fixed.empty()) return std::nullopt;
  const Points& nodes = model.mesh.nodes_m;
  std::vector<char> held(static_cast<std::size_t>(nodes.rows()), 0);
  Vec3 centre = Vec3::Zero();
  for (const Index node : model.fixed) {
    held[static_cast<std::size_t>(node)] = 1;
    centre += nodes.row(node).transpose() / double(model.fixed.size());
  }
  Mat3 spread = Mat3::Zero();
  for (const Index node : model.fixed) {
    const Vec3 off = nodes.row(node).transpose() - centre;
    spread += off * off.transpose();
  }
  // A foot is flat: across it, or along an axis.
  Eigen::Matrix<double, 3, 4> ways;
  ways << Mat3::Identity(), Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvectors().col(0);
  const double size_m = (nodes.colwise().maxCoeff() - nodes.colwise().minCoeff()).norm();
  for (const double sign : {1.0, -1.0})
    for (int w = 0; w < ways.cols(); ++w) {
      const Vec3 normal = sign * ways.col(w);
      double last = -std::numeric_limits<double>::infinity(), first = std::numeric_limits<double>::infinity();
      for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
        const double height = nodes.row(i).dot(normal);
        if (held[static_cast<std::size_t>(i)])
          last = std::max(last, height);
        else
          first = std::min(first, height);
      }
      if (first - last > 1e-6 * size_m && std::isfinite(first)) return Plane{0.5 * (first + last) * normal, normal};
    }
  return std::nullopt;
}

ExportFiles export_drake(const ExportModel& model) {
  std::string text = fmt::format(
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
      "        <drake:material_model>linear_corotated</drake:material_model>\n      </drake:deformable_properties>\n",
      model.name, model.young_modulus_pa, model.poisson_ratio, model.density_kg_m3);
  const std::optional<Plane> wall = held_half_space(model);
  if (wall) {
    const Vec3 &q = wall->point_m, &n = wall->normal;
    text += fmt::format("      <drake:wall_boundary_condition>\n        <drake:point_on_plane>{:.15g} {:.15g} {:.15g}</drake:point_on_plane>\n"
                        "        <drake:outward_normal>{:.15g} {:.15g} {:.15g}</drake:outward_normal>\n      </drake:wall_boundary_condition>\n",
                        q.x(), q.y(), q.z(), n.x(), n.y(), n.z());
  }
  ExportFiles files = {{"object.sdf", text + "    </link>\n  </model>\n</sdf>\n"}, {"object.vtk", ascii_vtk(model)}};
  if (!model.fixed.empty() && !wall) files["held_nodes.txt"] = held_nodes_file(model);
  return files;
}

}  // namespace palpate::io
