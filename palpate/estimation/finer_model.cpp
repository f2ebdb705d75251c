// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/finer_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/discretisation.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/geometry/embedding.hpp"

namespace palpate::estimation {
namespace {

constexpr Index most_uniform = 5000;  // tetrahedra of a mesh that is halved everywhere
constexpr double most_filled = 24000;  // of one that is filled anew
constexpr Index most_growth = 4;      // of the number of nodes, where it is not
constexpr Index most_corners = 4000;  // of a mesh that is fitted with
/// Where a mesh does not follow the outline, most of its error is in parts that are too thin or too curved for its edges, and
/// falls faster than their square (estimation_filling_order_test).
constexpr double order_of_filling = 3;
constexpr double unsure_of_filling = 0.15;  // of a linear body: small strains say too little of what a mesh does to another

struct RoundContact {
  fem::ContactPatch patch;
  Vec3 direction = Vec3::Zero();  ///< of the force, or of a motion that is imposed
};

/// Of a place smaller than an edge: that of the nearest one.
double longest_edge_near(const TetMesh& mesh, const Vec3& centre_m, double radius_m) {
  double longest = 0, nearest_m = std::numeric_limits<double>::infinity(), length_m = 0;
  for (Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
    for (int a = 0; a < 4; ++a) {
      for (int b = a + 1; b < 4; ++b) {
        const Vec3 from = mesh.nodes_m.row(mesh.tetrahedra(t, a)), to = mesh.nodes_m.row(mesh.tetrahedra(t, b));
        const double away_m = (0.5 * (from + to) - centre_m).norm();
        if (away_m < radius_m) longest = std::max(longest, (to - from).norm());
        if (away_m < nearest_m) nearest_m = away_m, length_m = (to - from).norm();
      }
    }
  }
  return longest > 0 ? longest : length_m;
}

bool is_bar(const Tool& tool) { return tool.shape == ToolShape::capsule || tool.shape == ToolShape::edge; }

/// A round tool that is moved touches as much as its dent is wide (Hertz 1882), which is less than its radius.
double touched_radius_m(const Tool& tool, const Load& load) {
  const bool flat = tool.shape == ToolShape::disc;
  if (!load.travel_m || flat) return tool.radius_m;
  return std::min(tool.radius_m, std::sqrt(tool.radius_m * std::abs(*load.travel_m)));
}

/// Places of tools with a radius, and the first force there.
std::vector<RoundContact> round_contacts(const Recording& recording) {
  std::vector<RoundContact> contacts;
  for (const auto& push : recording.pushes) {
    for (const auto& step : push.steps) {
      for (const auto& load : step.loads) {
        for (const auto& tool : recording.tools) {
          const bool pressed = load.force_n && load.force_n->norm() > 0, moved = load.travel_m && *load.travel_m != 0;
          if (tool.name != load.tool || !(tool.radius_m > 0) || !(pressed || moved)) continue;
          const double radius_m = touched_radius_m(tool, load);
          const auto known = std::find_if(contacts.begin(), contacts.end(), [&](const RoundContact& each) {
            return (each.patch.centre_m - load.contact_m).norm() < 1e-6;
          });
          if (known != contacts.end()) {
            if (moved) known->patch.radius_m = std::max(known->patch.radius_m, radius_m);
            continue;
          }
          contacts.push_back({{load.contact_m, radius_m, is_bar(tool) ? Vec3(0.5 * tool.length_m * tool.axis) : Vec3(Vec3::Zero()), tool.pressure},
                              moved ? load.direction : *load.force_n});
        }
      }
    }
  }
  return contacts;
}

bool lists_nodes(const Recording& recording) {
  const auto lists = [](const auto& part) { return !part.vertices.empty(); };
  return std::any_of(recording.supports.begin(), recording.supports.end(), lists) ||
         std::any_of(recording.tools.begin(), recording.tools.end(), lists);
}

bool may_be_finer(const Recording& recording, const SimulatedObject& object) {
  return recording.rest.volume && recording.rest.volume->tetrahedra.cols() == 4 && object.mesh.tetrahedra.cols() == 10;
}

void take(Recording& recording, const fem::RefinedMesh& refined) {
  for (auto& support : recording.supports) support.vertices = fem::extend_nodes(support.vertices, refined);
  for (auto& tool : recording.tools) tool.vertices = fem::extend_nodes(tool.vertices, refined);
  recording.rest.volume = refined.mesh;
}

/// The object on a recording's finer volume; `object` gives everything else.
FinerModel on_volume(Recording finer, const Recording& recording, const SimulatedObject& object) {
  FinerModel out;
  out.recording = std::move(finer);
  out.object.mesh = fem::to_quadratic(*out.recording.rest.volume);
  out.object.material = object.material;
  if (!object.region.empty()) {
    out.object.region = fem::regions_of(out.object.mesh, recording.regions, &*recording.rest.volume);
    out.object.region_names = object.region_names;
  }
  const TriMesh& surface = object.surface.rest();  // the same vertices on both meshes
  out.object.surface =
      SimulatedSurface::embedded(out.object.mesh, surface, geometry::embed(surface.vertices_m, out.object.mesh));
  return out;
}

/// The same object filled anew; how much finer it came out says the number of elements. Nothing where the mesher refuses.
std::optional<FinerModel> filled(const Recording& recording, const SimulatedObject& object, const FillAnew& fill_anew, double edge_share) {
  Recording anew = recording;
  Filled inside;
  try {
    inside = fill_anew(recording, edge_share);
  } catch (const Error&) {
    return std::nullopt;
  }
  const double growth = static_cast<double>(inside.volume.tetrahedra.rows()) /
                        static_cast<double>(recording.rest.volume->tetrahedra.rows());
  anew.rest.volume = std::move(inside.volume);
  anew.supports = std::move(inside.supports);
  FinerModel out = on_volume(std::move(anew), recording, object);
  out.edge_share = std::min(0.9, 1 / std::cbrt(growth));
  out.order = order_of_filling;
  if (fem::material_law(object.material).is_linear()) out.unsure = unsure_of_filling;
  return out;
}

}  // namespace

std::optional<FinerModel> finer_model(const Recording& recording, const SimulatedObject& object, const FillAnew& fill_anew) {
  if (!may_be_finer(recording, object)) return std::nullopt;
  if (fill_anew && !lists_nodes(recording)) {
    const double share = std::max(0.5, std::cbrt(static_cast<double>(recording.rest.volume->tetrahedra.rows()) / most_filled));
    if (share < 0.8) {
      if (auto anew = filled(recording, object, fill_anew, share)) return anew;
    }
  }
  if (lists_nodes(recording) || recording.rest.volume->tetrahedra.rows() > most_uniform) return finer_under_tools(recording, object);
  Recording finer = recording;
  finer.rest.volume = fem::refine_uniform(*recording.rest.volume);
  return on_volume(std::move(finer), recording, object);
}

std::optional<FinerModel> finer_under_tools(const Recording& recording, const SimulatedObject& object) {
  if (!may_be_finer(recording, object)) return std::nullopt;
  const auto contacts = round_contacts(recording);
  if (contacts.empty()) return std::nullopt;
  Recording finer = recording;
  const Index node_limit = most_growth * static_cast<Index>(recording.rest.volume->nodes_m.rows());
  for (const auto& [patch, direction] : contacts) {
    const double edge_m = longest_edge_near(*recording.rest.volume, patch.centre_m, 1.2 * patch.radius_m);
    take(finer, fem::refine_near(*finer.rest.volume, patch.centre_m, patch.radius_m, 0.5 * edge_m, 1.0, node_limit));
  }
  FinerModel out = on_volume(std::move(finer), recording, object);
  out.everywhere = false;
  return out;
}

std::optional<FinerModel> refined_within(const Recording& recording, const SimulatedObject& object, double tolerance,
                                         const FillAnew& fill_anew) {
  if (!may_be_finer(recording, object)) return std::nullopt;
  fem::DiscretisationOptions options;
  options.tolerance = tolerance;
  options.node_limit = most_corners;
  options.poisson_ratio = recording.model.poisson_fixed.value_or(0.3);
  Recording finer = recording;
  bool changed = false;
  for (const auto& [patch, direction] : round_contacts(recording)) {
    const auto boundary_on = [&, &where = patch](const TetMesh& mesh, const fem::RefinedMesh& linear) {
      fem::Boundary boundary;
      boundary.forces = fem::spread_over_patch(mesh, where);
      boundary.inertia_relief = recording.free;
      if (recording.free) return boundary;
      auto supports = held_both_ways(finer.supports);  // small strains decide on the mesh
      for (auto& support : supports) support.vertices = fem::extend_nodes(support.vertices, linear);
      boundary.constraints = hold(mesh, supports, {}).constraints;
      return boundary;
    };
    const fem::Discretisation chosen = fem::discretise(*finer.rest.volume, patch, boundary_on, direction.normalized(), options);
    if (chosen.base_young_error <= options.tolerance) continue;
    take(finer, chosen.linear);
    changed = true;
  }
  if (changed) {
    FinerModel out = on_volume(std::move(finer), recording, object);
    out.everywhere = false;
    return out;
  }
  if (fill_anew && !lists_nodes(recording)) {
    auto better = filled(recording, object, fill_anew, 2.0 / 3);
    if (better && better->recording.rest.volume->nodes_m.rows() > most_corners) return std::nullopt;
    return better;
  }
  if (lists_nodes(recording) || recording.rest.volume->tetrahedra.rows() > most_uniform) return std::nullopt;
  finer.rest.volume = fem::refine_uniform(*recording.rest.volume);
  if (finer.rest.volume->nodes_m.rows() > most_corners) return std::nullopt;
  return on_volume(std::move(finer), recording, object);
}

}  // namespace palpate::estimation
