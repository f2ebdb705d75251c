// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/contacts_on_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

/// Radius of the round tool that a force acts under; 0: it is none.
double patch_radius_m(const Recording& recording, const Load& load) {
  if (!load.force_n || load.force_n->norm() == 0) return 0;
  const auto tool = std::find_if(recording.tools.begin(), recording.tools.end(), [&](const Tool& each) { return each.name == load.tool; });
  if (tool == recording.tools.end() || (tool->shape != ToolShape::sphere && tool->shape != ToolShape::disc)) return 0;
  return tool->radius_m;
}

}  // namespace

void put_contacts_on_surface(Recording& recording, const TetMesh& mesh) {
  constexpr double near_enough = 0.1;  // of the radius
  std::optional<geometry::TriangleTree> surface;
  for (Push& push : recording.pushes) {
    for (Step& step : push.steps) {
      for (Load& load : step.loads) {
        const double radius_m = patch_radius_m(recording, load);
        if (!(radius_m > 0)) continue;
        if (!surface) surface.emplace(TriMesh{mesh.nodes_m, fem::boundary_triangles(mesh)});
        const geometry::ClosestPoint foot = surface->closest(load.contact_m);
        const double off_m = std::sqrt(foot.squared_distance_m2);
        if (off_m > radius_m)
          throw Error(fmt::format("the contact point ({:.4g}, {:.4g}, {:.4g}) lies {:.3g} mm from the object's surface, further than '{}' is wide "
                                  "({:.3g} mm): is it in the frame of the object, and the tool's length right?",
                                  load.contact_m.x(), load.contact_m.y(), load.contact_m.z(), 1e3 * off_m, load.tool, 1e3 * radius_m),
                      (step.source.empty() ? "push '" + push.name + "'" : step.source) + ": loads.contact_m");
        if (off_m > near_enough * radius_m) load.contact_m = foot.point_m;
      }
    }
  }
}

std::vector<Verdict> contacts_off_surface(const Recording& stated, const Recording& moved) {
  constexpr double worth_a_word = 0.25;  // of the radius
  std::vector<Verdict> out;
  for (std::size_t p = 0; p < std::min(stated.pushes.size(), moved.pushes.size()); ++p) {
    double off_m = 0;
    const Push &before = stated.pushes[p], &after = moved.pushes[p];
    for (std::size_t s = 0; s < std::min(before.steps.size(), after.steps.size()); ++s) {
      for (std::size_t l = 0; l < after.steps[s].loads.size(); ++l) {
        const double m = (after.steps[s].loads[l].contact_m - before.steps[s].loads[l].contact_m).norm();
        if (m > worth_a_word * patch_radius_m(moved, after.steps[s].loads[l])) off_m = std::max(off_m, m);
      }
    }
    if (off_m > 0)
      out.push_back({"contact_off_surface",
                     fmt::format("The contact point of push '{}' is stated {:.2g} mm from the object's surface; the nearest place on it was taken "
                                 "instead. The tool's length, the hand-eye calibration or the object's shape is wrong by that much.",
                                 before.name, 1e3 * off_m)});
  }
  return out;
}

}  // namespace palpate::estimation
