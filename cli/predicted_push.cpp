// SPDX-License-Identifier: Apache-2.0
#include "cli/predicted_push.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "cli/pressed_scene.hpp"
#include "palpate/core/error.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/fem/discretisation.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/report/words.hpp"

namespace palpate::cli {
namespace {

Tool tool_of(const AskedPush& asked, const Recording& object) {
  Tool tool;
  const auto found =
      std::find_if(object.tools.begin(), object.tools.end(), [&](const Tool& one) { return one.name == asked.tool; });
  if (!asked.tool.empty()) {
    if (found == object.tools.end()) throw Error("the recording had no tool of this name", asked.option + "tool " + asked.tool);
    tool = *found;
  } else if (asked.radius_m > 0) {
    tool.name = "disc";
    tool.shape = ToolShape::disc;
  } else if (object.tools.size() == 1) {
    tool = object.tools.front();
  } else {
    throw Error(fmt::format("say what pushes: this (a name of the recording's) or {}radius, in metres", asked.option), asked.option + "tool");
  }
  if (asked.radius_m > 0) tool.radius_m = asked.radius_m;
  return tool;
}

double mesh_size_m(const TetMesh& mesh) { return (mesh.nodes_m.colwise().maxCoeff() - mesh.nodes_m.colwise().minCoeff()).norm(); }

std::string words(const Vec3& at) {
  constexpr double rounding_m = 1e-9;
  const Vec3 shown = at.unaryExpr([](double one) { return std::abs(one) < rounding_m ? 0.0 : one; });
  return fmt::format("{:.4g} {:.4g} {:.4g}", shown.x(), shown.y(), shown.z());
}

/// A place beside the surface would be pressed by the part of the patch that reaches it: it is moved there, or refused.
void put_on_surface(const TetMesh& mesh, const AskedPush& asked, PredictedPush& push) {
  Load& load = push.load;
  const TriMesh surface = geometry::boundary_surface(mesh).surface;
  const auto foot = geometry::TriangleTree(surface).closest(load.contact_m);
  const double off_m = std::sqrt(foot.squared_distance_m2), near_m = 0.01 * mesh_size_m(mesh);
  if (off_m > std::max(near_m, 0.5 * push.tool.radius_m))
    throw Error(fmt::format("lies {} away from the object's surface; the nearest place on it is {}", report::quantity(off_m, "m"), words(foot.point_m)),
                asked.option + "contact " + words(load.contact_m));
  if (off_m > near_m) push.warnings.push_back(fmt::format("the contact is moved by {} onto the surface, to {}", report::quantity(off_m, "m"), words(foot.point_m)));
  load.contact_m = foot.point_m;
  const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(foot.triangle, k))); };
  const Vec3 outwards = (corner(1) - corner(0)).cross(corner(2) - corner(0));
  if (load.direction.dot(outwards) > 0)
    throw Error("points out of the object there, and a tool can only push; into it is about " + words(-outwards.normalized()),
                asked.option + "direction " + words(load.direction));
}

void must_be_positive(double value, const std::string& where) {
  if (!(value > 0) || !std::isfinite(value)) throw Error(fmt::format("must be a number above 0, is {:g}", value), where);
}

double disc_area_m2(double radius_m) { return EIGEN_PI * radius_m * radius_m; }

/// The fit judges its law as far as its pushes went. A harder one is the law's word alone.
std::optional<std::string> beyond_what_was_seen(const Identification& answer, const Tool& tool, double force_n) {
  double most_n = 0, most_pa = 0;
  for (const StepFit& step : answer.steps) {
    const double pressed_n = step.force_n.norm();
    most_n = std::max(most_n, pressed_n);
    if (step.tool_radius_m > 0) most_pa = std::max(most_pa, pressed_n / disc_area_m2(step.tool_radius_m));
  }
  constexpr double clearly = 1.5;
  const bool round = tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc;
  if (round && tool.radius_m > 0 && most_pa > 0) {
    const double asked_pa = std::abs(force_n) / disc_area_m2(tool.radius_m);
    if (asked_pa > clearly * most_pa)
      return fmt::format("this presses {:.2g} times as hard as any push that the object was learned from ({} on the patch, those up to {}): "
                         "the band knows of E and nu only, not of whether the law still holds there",
                         asked_pa / most_pa, report::quantity(asked_pa, "Pa"), report::quantity(most_pa, "Pa"));
  } else if (most_n > 0 && std::abs(force_n) > clearly * most_n) {
    return fmt::format("this is {:.2g} times the force of any push that the object was learned from ({}): the band knows of E and nu only, "
                       "not of whether the law still holds there",
                       std::abs(force_n) / most_n, report::quantity(most_n, "N"));
  }
  return std::nullopt;
}

/// The mesh was made fine where the object was pushed, and what it still does to E there was taken out.
std::optional<std::string> coarse_there(const LearnedObject& learned, const Tool& tool, const Load& load) {
  const TetMesh& mesh = *learned.object.rest.volume;
  const double radius_m = tool.radius_m, edge_m = fem::longest_edge_near(mesh, {load.contact_m, radius_m});
  constexpr double fine = 0.75;  // quadratic elements follow a patch of one and a half edges a radius
  if (!(radius_m > 0) || edge_m < fine * radius_m) return std::nullopt;
  double pushed_m = std::numeric_limits<double>::infinity();
  for (const StepFit& step : learned.answer.steps)
    if (step.force_n.norm() > 0 && step.tool_radius_m > 0) pushed_m = std::min(pushed_m, fem::longest_edge_near(mesh, {step.contact_m, step.tool_radius_m}));
  constexpr double clearly = 1.25;
  if (!(edge_m > clearly * pushed_m)) return std::nullopt;
  return fmt::format("the mesh has edges of {} here, for a patch of {} radius, and of {} where the object was pushed: a coarse mesh is stiff, and "
                     "the travel comes out too small by more than the band. A push here, in what the object is learned from, makes it fine here, too",
                     report::quantity(edge_m, "m"), report::quantity(radius_m, "m"), report::quantity(pushed_m, "m"));
}

/// A solver looks long for an equilibrium that no material has.
void must_be_bearable(const AskedPush& push, const Tool& tool, const TetMesh& mesh, double young_modulus_pa) {
  const double size_m = mesh_size_m(mesh);
  if (push.travel_m && *push.travel_m > size_m)
    throw Error(fmt::format("is further than the object is large ({}); it is in metres", report::quantity(size_m, "m")),
                fmt::format("{}travel {:g}", push.option, *push.travel_m));
  const bool round = tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc;
  const double area_m2 = round && tool.radius_m > 0 ? disc_area_m2(tool.radius_m) : size_m * size_m;
  constexpr double most_over_young = 10;
  if (push.force_n && *push.force_n > most_over_young * young_modulus_pa * area_m2)
    throw Error(fmt::format("is {:.2g} times what E ({}) bears on the pressed patch; no such object stands that. It is in newtons",
                            *push.force_n / (young_modulus_pa * area_m2), report::quantity(young_modulus_pa, "Pa")),
                fmt::format("{}force {:g}", push.option, *push.force_n));
}

/// As the fit had them: what nu was expected there decides how the volume change is integrated.
fem::StaticsOptions statics_options(const LearnedObject& learned, int threads) {
  estimation::SimulatedObject object;
  object.mesh = *learned.object.rest.volume;
  estimation::FitOptions fit;
  fit.threads = threads;
  fem::StaticsOptions options = estimation::statics_options(learned.object, object, fit);
  // Loads that an object stands take a handful of steps; it folds under those that take more, and nobody waits for minutes.
  options.max_load_steps = 20;
  return options;
}

}  // namespace

PredictedPush predict_push(const LearnedObject& learned, const AskedPush& asked, int threads) {
  const TetMesh& mesh = *learned.object.rest.volume;
  PredictedPush out;
  out.tool = tool_of(asked, learned.object);
  Load& load = out.load;
  load.tool = out.tool.name;
  // A patch that is stated is pressed evenly, whatever the object was learned with.
  const bool patch_is_stated = asked.tool.empty() && asked.radius_m > 0;
  const bool rigid = !patch_is_stated && moves_rigidly(learned.answer, out.tool);
  const bool platen = out.tool.shape == ToolShape::platen;
  const bool somewhere = out.tool.shape != ToolShape::vertices && !platen;
  if (asked.contact_m)
    load.contact_m = *asked.contact_m;
  else if (somewhere)
    throw Error("say where it acts, X Y Z in metres", asked.option + "contact");
  if (!(asked.direction.norm() > 0)) throw Error("must not be zero", asked.option + "direction");
  load.direction = platen ? Vec3(out.tool.plane.normal.normalized()) : Vec3(asked.direction.normalized());
  if (somewhere) put_on_surface(mesh, asked, out);
  prediction::NewPush push;
  push.direction = load.direction;
  push.force_n = asked.force_n;
  push.travel_m = asked.travel_m;
  if (push.force_n.has_value() == push.travel_m.has_value())
    throw Error(fmt::format("give either this or {}travel", asked.option), asked.option + "force");
  if (push.force_n) must_be_positive(*push.force_n, asked.option + "force");
  if (push.travel_m) must_be_positive(*push.travel_m, asked.option + "travel");
  PressedScene scene = pressed_scene(learned, out.tool, load, rigid);
  must_be_held(scene, mesh, load, asked.option + "direction " + words(load.direction));
  push.background = scene.background;
  out.elasticity = elasticity_of(learned);
  must_be_bearable(asked, out.tool, mesh, out.elasticity.highest_young_modulus_pa());
  out.found = prediction::predict(mesh, out.elasticity, scene.boundary, push, statics_options(learned, threads), scene.around);
  if (!out.found.converged) return out;
  if (!out.found.reason.empty()) out.warnings.push_back(out.found.reason);
  // By the stiffness: a tiny force moves everything by little.
  constexpr double held_over_object = 1e6;
  if (!(std::abs(out.found.stiffness_n_m) < held_over_object * out.elasticity.highest_young_modulus_pa() * mesh_size_m(mesh)))
    throw Error("a support holds the object at this place: nothing moves there", asked.option + "contact " + words(load.contact_m));
  if (somewhere)
    if (const auto said = coarse_there(learned, out.tool, load)) out.warnings.push_back(*said);
  if (const auto said = beyond_what_was_seen(learned.answer, out.tool, out.found.force_n.value)) out.warnings.push_back(*said);
  constexpr double noticeable = 0.02;
  if (const double aside_n = unheld_n(scene, mesh, load, out.found.pressed_n); rigid && aside_n > noticeable * out.found.pressed_n.norm())
    out.warnings.push_back(fmt::format("{} of the tool's force act along motions that nothing holds: the object would slide away, which is not simulated",
                                       report::quantity(aside_n, "N")));
  if (out.elasticity.covariance.norm() == 0) out.warnings.push_back("the result holds no covariance: the bands have no width");
  return out;
}

}  // namespace palpate::cli
