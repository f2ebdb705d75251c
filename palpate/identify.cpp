// SPDX-License-Identifier: Apache-2.0
#include "palpate/identify.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <tuple>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/core/recording_values.hpp"
#include "palpate/core/thread_count.hpp"
#include "palpate/core/version.hpp"
#include "palpate/estimation/contacts_on_surface.hpp"
#include "palpate/estimation/deep_loads.hpp"
#include "palpate/estimation/fit_on_fine_mesh.hpp"
#include "palpate/estimation/moved_balls.hpp"
#include "palpate/estimation/paper_method.hpp"
#include "palpate/estimation/slips.hpp"
#include "palpate/estimation/unseen_side.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/fem/regions_by_site.hpp"
#include "palpate/geometry/embedding.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/subdivide.hpp"
#include "palpate/geometry/tetrahedralise.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/reconstruction/build_object.hpp"
#include "palpate/reconstruction/finer_at_supports.hpp"
#include "palpate/sensing/free_space.hpp"
#include "palpate/sensing/images_at_rest.hpp"
#include "palpate/sensing/observe.hpp"

namespace palpate {
namespace {

constexpr Index default_tetrahedra = 3000;
constexpr double most_unseen = 0.1;  // of a surface: beyond that, what the rest may look like is part of the interval

/// Corners of quadratic tetrahedra alone, renumbered only if midpoints stood between them.
TetMesh to_linear(const TetMesh& mesh) {
  TetMesh linear{mesh.nodes_m, mesh.tetrahedra.leftCols(4)};
  if (linear.tetrahedra.maxCoeff() + 1 == linear.nodes_m.rows()) return linear;
  std::vector<char> used(static_cast<std::size_t>(mesh.nodes_m.rows()), 0);
  for (Index t = 0; t < linear.tetrahedra.rows(); ++t) {
    for (int k = 0; k < 4; ++k) used[static_cast<std::size_t>(linear.tetrahedra(t, k))] = 1;
  }
  const auto corners = std::count(used.begin(), used.end(), 1);
  if (!std::all_of(used.begin(), used.begin() + corners, [](char c) { return c == 1; })) {
    throw Error("corners and midpoints are mixed in the node list, so linear elements would renumber the nodes that supports "
                "and tools name; use quadratic ones (tet10), or give the mesh with its corners first",
                "model.element tet4");
  }
  linear.nodes_m = mesh.nodes_m.topRows(corners);
  return linear;
}

/// Edge of a regular tetrahedron of the mesh's mean volume.
double typical_edge_m(const TetMesh& mesh) {
  const geometry::VolumeCheck check = geometry::check_volume(mesh);
  return std::cbrt(6 * std::sqrt(2.0) * check.volume_m3 / static_cast<double>(mesh.tetrahedra.rows()));
}

/// Where round tools met the object.
std::vector<reconstruction::Touch> touched_places(const Recording& recording) {
  std::vector<reconstruction::Touch> touched;
  for (const auto& push : recording.pushes) {
    for (const auto& step : push.steps) {
      for (const auto& load : step.loads) {
        const auto tool = std::find_if(recording.tools.begin(), recording.tools.end(),
                                       [&](const Tool& each) { return each.name == load.tool; });
        if (tool == recording.tools.end() || !(tool->radius_m > 0)) continue;
        const bool known = std::any_of(touched.begin(), touched.end(),
                                       [&](const auto& each) { return (each.point_m - load.contact_m).norm() < 1e-6; });
        if (!known) touched.push_back({load.contact_m, load.direction.normalized(), tool->radius_m});
      }
    }
  }
  return touched;
}

/// The dent under a tool is what measures E, and its error is first in h / radius: three quadratic elements a radius keep it
/// within a few per cent.
std::vector<geometry::FinerNear> finer_under_tools(const Recording& recording) {
  std::vector<geometry::FinerNear> finer;
  for (const auto& touch : touched_places(recording)) finer.push_back({touch.point_m, 1.5 * touch.radius_m, touch.radius_m / 3});
  return finer;
}

/// Facets that follow the dent: half as long as the elements, and a third of those under a tool there, where the slope of the
/// surface turns within millimetres. Ones of a quarter of the pad's radius made E of a cube 0.2 % too high by themselves.
TriMesh follows_dents(const Recording& recording, double edge_m) {
  constexpr double share = 0.35, growth = 0.5;  // of the elements' edges; with the distance from where facets must be short
  std::vector<geometry::FinerNear> tools;
  if (recording.model.refine == "auto") tools = finer_under_tools(recording);
  return geometry::subdivided(geometry::without_shared_faces(*recording.rest.surface), [&](const Vec3& at) {
    double longest_m = edge_m;
    for (const auto& near : tools)
      longest_m = std::min(longest_m, share * near.edge_m + growth * std::max(0.0, (at - near.point_m).norm() - 0.85 * near.radius_m));
    return longest_m;
  });
}

/// Table that hides a side of the object from every view: where it rests, else the first plane of the environment.
std::optional<Plane> hiding_plane(const Recording& recording) {
  for (const auto& support : recording.supports) {
    if (support.kind == SupportKind::table || support.kind == SupportKind::plane) return support.plane;
  }
  if (!recording.environment.planes.empty()) return recording.environment.planes.front();
  return std::nullopt;
}

/// How far the seen part of a surface that was fused from views is off; 0 for one that was given.
double seen_std_m(const reconstruction::SeenVertices& surface) {
  double sum = 0;
  int count = 0;
  for (std::size_t v = 0; v < surface.seen.size(); ++v) {
    if (surface.seen[v] == 0) continue;
    sum += std::pow(surface.sigma_m(static_cast<Index>(v)), 2);
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

/// A given surface filled. A mesh that cuts off part of the object makes the rest of it too stiff, and no finer mesh of the same
/// outline would tell: a part that is missing or too much asks for twice as many tetrahedra, and again.
reconstruction::BuiltObject build_from_surface(const Recording& recording, reconstruction::BuildOptions options,
                                               const OnProgress& progress) {
  constexpr double little = 0.005;  // of the volume: the lab's bear without 1.5 % of it had a back of 11 % more than its E
  constexpr int most_tries = 3;
  std::optional<reconstruction::BuiltObject> best;
  for (int tries = 0; tries < most_tries; ++tries, options.mesh.tetrahedra *= 2) {
    auto built = reconstruction::build_object(*recording.rest.surface, recording.supports, options, progress);
    const auto off = [](const reconstruction::BuiltObject& object) { return std::abs(object.volume_error.value_or(0)); };
    if (!best || off(built) < off(*best)) best = std::move(built);
    if (off(*best) < little) break;
  }
  return std::move(*best);
}

/// What a given surface, its supports and its tools ask of the mesh.
reconstruction::BuildOptions fill_options(const Recording& recording) {
  reconstruction::BuildOptions options;
  options.mesh.tetrahedra = default_tetrahedra;
  for (const Tool& tool : recording.tools)
    if (tool.shape == ToolShape::platen) options.pressed_faces.push_back(tool.plane);
  if (recording.model.refine != "auto") return options;
  options.mesh.finer = finer_under_tools(recording);
  options.finer_feet = true;
  if (!recording.rest.surface) return options;
  for (const auto& near : reconstruction::finer_at_supports(recording.supports, *recording.rest.surface)) options.mesh.finer.push_back(near);
  return options;
}

/// Volume mesh of a recording that gives a surface or views of one.
void fill_with_tetrahedra(Recording& recording, reconstruction::Completion completion, std::vector<char>* seen,
                          ShapeOfViews* views, const OnProgress& progress) {
  if (!recording.rest.surface && recording.rest.views.empty()) {
    throw Error("give the object's shape as rest.volume_mesh, rest.surface_mesh or rest.views", "rest");
  }
  reconstruction::BuildOptions options = fill_options(recording);
  options.fine_surface = true;
  auto built = recording.rest.surface
                   ? build_from_surface(recording, options, progress)
                   : build_from_views(recording, options, completion, progress);
  // Sensors see what was fused, and not the flat faces of the tetrahedra that fill it: of a bear they were 1.5 mm off. Where
  // the object was seen from all around they are finer, and what they are off by is in slow_error_m.
  const bool fine = !built.around && built.fine_surface.triangles.rows() > 0;
  const reconstruction::SeenVertices& of_surface = fine ? built.of_fine_surface : built.of_surface;
  if (recording.rest.surface_std_m == 0) recording.rest.surface_std_m = std::hypot(seen_std_m(of_surface), built.slow_error_m);
  if (seen != nullptr) *seen = of_surface.seen;
  if (views != nullptr) *views = {built.strip_m, built.symmetries};
  for (const auto& warning : built.model.warnings) recording.warnings.push_back(warning);
  recording.supports = std::move(built.model.supports);
  recording.rest.surface = std::move(fine ? built.fine_surface : built.model.surface);
  recording.rest.volume = std::move(built.model.volume);
  recording.rest.observed_triangles.reset();  // they name vertices of the surface, not nodes of the volume
}

std::map<std::string, std::string> provenance(const Recording& recording, const IdentifyOptions& options) {
  std::map<std::string, std::string> said{{"version", version},
                                          {"recording", recording.name},
                                          {"method", options.method},
                                          {"material", recording.model.material},
                                          {"element", recording.model.element},
                                          {"refine", recording.model.refine},
                                          {"iterations at most", std::to_string(options.fit.max_iterations)},
                                          {"threads", std::to_string(thread_count(options.fit.threads))}};
  std::ostringstream prior;
  if (recording.model.poisson_fixed) {
    prior << "known: " << *recording.model.poisson_fixed;
  } else {
    prior << "uniform from " << recording.model.poisson_lower << " to " << recording.model.poisson_upper;
  }
  said["prior of the Poisson ratio"] = prior.str();
  if (options.fit.young_start_pa) {
    std::ostringstream start;
    start << *options.fit.young_start_pa << " Pa";
    said["start of Young's modulus"] = start.str();
  }
  if (options.all_loads) said["loads"] = "all, also where a patch caves in";
  for (const auto& [file, hash] : recording.input_hashes) said["sha256 " + file] = hash;
  return said;
}

}  // namespace

reconstruction::BuiltObject build_from_views(const Recording& recording, const reconstruction::BuildOptions& options,
                                             reconstruction::Completion completion, const OnProgress& progress) {
  const std::vector<DepthFrame> images = sensing::images_at_rest(recording);
  reconstruction::FuseOptions fuse;
  fuse.support = hiding_plane(recording);
  fuse.free = sensing::FreeSpace(images);
  if (fuse.support) {
    sensing::FreeSpaceOptions to_support;
    to_support.support = fuse.support;
    fuse.free_to_support = sensing::FreeSpace(images, to_support);
  }
  fuse.completion = completion;
  fuse.touched = touched_places(recording);
  const auto build = [&](bool smooth) {
    sensing::ObserveOptions observing;
    observing.back_projection.smooth = smooth;
    observing.back_projection.blind_to_own_noise = false;
    std::vector<PointCloud> clouds;
    for (const DepthFrame& view : images) {
      Points normals;
      const RayCloud rays = sensing::observe(view, recording.environment, observing, &normals);
      clouds.push_back(sensing::to_point_cloud(rays, normals));
      if (smooth) clouds.back().pose_std_m = view.pose_std_m, clouds.back().pose_std_rad = view.pose_std_rad;
    }
    return reconstruction::build_object(clouds, fuse, recording.supports, options, progress);
  };
  std::optional<reconstruction::BuiltObject> built;
  try {
    built = build(true);
  } catch (const Error&) {  // the raw points may still enclose something; if not, they say why
  }
  // Of one side too much is made in any case: rims that noise curls in make the mirrored side smaller (bears that one camera
  // saw share 0.76 of the volume of both then, else 0.74). And closest points of raw depths would draw views into each other.
  return built && built->around ? std::move(*built) : build(false);
}

Recording with_overrides(Recording recording, const IdentifyOptions& options) {
  ModelDefaults& model = recording.model;
  if (options.material) model.material = *options.material;
  if (options.element) model.element = *options.element;
  if (options.refine) model.refine = *options.refine;
  if (options.poisson_range) {
    model.poisson_lower = options.poisson_range->first;
    model.poisson_upper = options.poisson_range->second;
    model.poisson_fixed.reset();
  }
  if (options.poisson_fixed) model.poisson_fixed = options.poisson_fixed;
  if (options.poisson_by_region) model.poisson_by_region = true;
  if (options.regions == "none") recording.regions.clear();
  if (options.regions == "by-site") recording.regions = fem::regions_by_site(recording);
  const auto demand = [](bool fine, const std::string& where, const std::string& cure) {
    if (!fine) throw Error(cure, where);
  };
  demand(model.element == "tet4" || model.element == "tet10" || model.element == "auto", "model.element " + model.element,
         "the elements are tet4, tet10 and auto");
  demand(options.method == "palpate" || options.method == "paper", "method " + options.method, "the methods are palpate and paper");
  demand(options.regions == "recorded" || options.regions == "by-site" || options.regions == "none", "regions " + options.regions,
         "regions are those of the recording (recorded), one around each pushed site (by-site), or none");
  demand(!options.poisson_by_region || recording.regions.size() > 1, "poisson_by_region",
         "the object has one region: let the recording name its regions, or take one around each pushed site (by-site)");
  demand(!options.poisson_by_region || !model.poisson_fixed, "poisson_by_region",
         "the Poisson ratio is taken as known (poisson_fixed), and all regions share it: leave out the one or the other");
  demand(options.mesh_tolerance > 0 && std::isfinite(options.mesh_tolerance), "mesh_tolerance",
         "must be positive: a share of E, such as 0.01");
  demand(model.refine == "none" || model.refine == "auto", "model.refine " + model.refine, "refinement is none or auto");
  demand(model.poisson_lower >= 0 && model.poisson_upper <= 0.4995 && model.poisson_lower < model.poisson_upper,
         "poisson_range", "the range must lie within 0 and 0.4995, the lower end first");
  demand(!model.poisson_fixed || (*model.poisson_fixed > -1 && *model.poisson_fixed <= 0.4995), "poisson_fixed",
         "must lie above -1 and at most at 0.4995");
  return recording;
}

estimation::SimulatedObject build_simulated_object(Recording& recording, const OnProgress& progress,
                                                   reconstruction::Completion completion, std::vector<char>* seen,
                                                   ShapeOfViews* views) {
  if (!recording.rest.volume) fill_with_tetrahedra(recording, completion, seen, views, progress);
  const TetMesh& given = *recording.rest.volume;
  estimation::SimulatedObject object;
  object.material = recording.model.material;
  const bool quadratic = recording.model.element == "tet10" || recording.model.element == "auto";
  if (!quadratic) {
    object.mesh = to_linear(given);
  } else {
    object.mesh = given.tetrahedra.cols() == 10 ? given : fem::to_quadratic(given);
  }
  recording.model.element = quadratic ? "tet10" : "tet4";
  estimation::put_contacts_on_surface(recording, object.mesh);
  estimation::free_contacts_after_slips(recording);
  if (recording.regions.size() > 1) {
    object.region = fem::regions_of(object.mesh, recording.regions, &given);
    for (const Region& region : recording.regions) object.region_names.push_back(region.name);
  }
  if (recording.rest.surface) {
    // Sensors see the given surface, not the mesh that fills it; its facets must follow the dent as well as elements do.
    const TriMesh surface = follows_dents(recording, 0.5 * typical_edge_m(object.mesh));
    object.surface = estimation::SimulatedSurface::embedded(object.mesh, surface, geometry::embed(surface.vertices_m, object.mesh));
  } else {
    object.surface = estimation::SimulatedSurface::boundary_of(
        object.mesh, recording.rest.observed_triangles ? &*recording.rest.observed_triangles : nullptr);
  }
  return object;
}

double drop_unseen_side(const Recording& built, const std::vector<char>& seen, estimation::Inputs& observed) {
  if (seen.empty()) return 0;
  const double unseen = estimation::unseen_share(*built.rest.surface, seen, hiding_plane(built));
  if (unseen <= most_unseen) return 0;
  estimation::drop_unseen(*built.rest.surface, seen, hiding_plane(built), observed);
  return unseen;
}

estimation::FillAnew fill_anew(const Recording& given, const Recording& built) {
  constexpr double same_outline = 3e-4;  // of the object's size, rms: a ball of 3000 tetrahedra has 1e-3, boxes up to 2e-4
  if (given.rest.volume || !given.rest.surface || !built.rest.volume) return {};
  const TriMesh surface = geometry::without_shared_faces(*given.rest.surface);
  const geometry::TriangleTree outline(geometry::boundary_surface(*built.rest.volume).surface);
  double sum_m4 = 0, area_m2 = 0;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(t, k))); };
    const double area = 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    sum_m4 += area * outline.closest((corner(0) + corner(1) + corner(2)) / 3).squared_distance_m2;
    area_m2 += area;
  }
  const double size_m = (surface.vertices_m.colwise().maxCoeff() - surface.vertices_m.colwise().minCoeff()).norm();
  if (sum_m4 < area_m2 * std::pow(same_outline * size_m, 2)) return {};
  return [given](const Recording& recording, double edge_share) {
    reconstruction::BuildOptions options = fill_options(given);
    options.mesh.tetrahedra = static_cast<Index>(static_cast<double>(recording.rest.volume->tetrahedra.rows()) / std::pow(edge_share, 3));
    for (auto& near : options.mesh.finer) near.edge_m *= edge_share;
    auto filled = reconstruction::build_object(*given.rest.surface, given.supports, options);
    return estimation::Filled{std::move(filled.model.volume), std::move(filled.model.supports)};
  };
}

std::optional<estimation::UnseenSide> unseen_side(const Recording& given, const Recording& built, const std::vector<char>& seen) {
  const TriMesh& surface = *built.rest.surface;
  estimation::UnseenSide side;
  side.seen.vertices_m = surface.vertices_m;
  std::vector<Index> kept;
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const auto shown = [&](int k) { return seen[static_cast<std::size_t>(surface.triangles(t, k))] != 0; };
    if (shown(0) || shown(1) || shown(2)) kept.push_back(t);
  }
  side.seen.triangles = surface.triangles(kept, Eigen::all);
  if (const auto plane = hiding_plane(built)) side.up = plane->normal;
  const Vec3 middle = surface.vertices_m.colwise().mean().transpose();
  Vec3 toward = Vec3::Zero();
  for (const DepthFrame& view : sensing::images_at_rest(given)) toward += (view.T_base_camera.translation() - middle).normalized();
  toward -= toward.dot(side.up) * side.up;
  constexpr double no_side = 0.2;  // of the way to the sensors
  side.from_above = toward.norm() < no_side * static_cast<double>(std::max<std::size_t>(1, sensing::images_at_rest(given).size()));
  side.toward = side.from_above ? Vec3(side.up.unitOrthogonal()) : Vec3(toward.normalized());
  for (const auto& touch : touched_places(given)) side.touched_m.push_back(touch.point_m);
  if (kept.empty()) return std::nullopt;
  return side;
}

estimation::ShapeDoubt other_shapes(const Recording& given, double unseen_share, int symmetries) {
  estimation::ShapeDoubt doubt;
  doubt.unseen_share = unseen_share;
  const bool flat_is_likely = symmetries < 2;
  const std::pair<reconstruction::Completion, double> others[] = {
      {reconstruction::Completion::planar, flat_is_likely ? 1 : 0.3}, {reconstruction::Completion::tapered, 0.3}, {reconstruction::Completion::hidden, 0.1}};
  for (const auto& [completion, likelihood] : others) {
    Recording recording = given;
    try {
      std::vector<char> seen;
      auto object = build_simulated_object(recording, {}, completion, &seen);
      auto side = unseen_side(given, recording, seen);
      // Seen from above there is no mirror: the planar one is the fitted one, and as many things narrow towards their foot.
      if (side && side->from_above && completion == reconstruction::Completion::planar) continue;
      const double likely = side && side->from_above && completion == reconstruction::Completion::tapered ? 1 : likelihood;
      const bool known = std::any_of(doubt.shapes.begin(), doubt.shapes.end(), [&](const auto& other) {
        return other.recording.rest.surface->vertices_m.rows() == recording.rest.surface->vertices_m.rows() &&
               other.recording.rest.surface->vertices_m == recording.rest.surface->vertices_m;
      });
      if (known) continue;
      const auto plane = hiding_plane(recording);  // before it is moved away
      doubt.shapes.push_back({std::move(recording), std::move(object), flat_is_likely && completion == reconstruction::Completion::planar, likely, std::move(side), std::move(seen), plane});
    } catch (const Error&) {  // such a shape falls apart or encloses nothing: it is none that may stand there
    }
  }
  return doubt;
}

std::optional<estimation::FootDoubt> foot_doubt(const Recording& built, double strip_m) {
  if (!(strip_m > 0)) return std::nullopt;
  for (const Support& support : built.supports)
    if (support.kind == SupportKind::table || support.kind == SupportKind::plane) return estimation::FootDoubt{support.plane, strip_m, {}};
  return std::nullopt;
}

Identified identify(const Recording& given, const IdentifyOptions& options, const OnProgress& progress) {
  demand_right_values(wrong_values(given));
  Recording as_given = with_overrides(given, options);
  demand_loads(as_given);
  if (options.method == "paper") as_given.regions.clear();  // the paper fits one stiffness, and forces on patches
  else as_given = estimation::with_balls_moved(std::move(as_given));
  std::vector<Points> masked_m;
  const estimation::Inputs all_observed = observe(as_given, &masked_m);  // sec. IV-B: point clouds, robot masked
  Identified out;
  Recording recording;
  estimation::SimulatedObject object;
  std::optional<estimation::ShapeDoubt> doubt;
  estimation::StepCounts fitted = estimation::all_steps(as_given);
  const auto fit = [&](reconstruction::Completion completion) {
    recording = as_given;
    estimation::Inputs observed = all_observed;
    std::vector<char> seen;
    ShapeOfViews views;
    object = build_simulated_object(recording, progress, completion, &seen, &views);  // sec. IV-C: tetrahedral model
    if (progress && !progress("quality", 1)) {  // a mesh that was stopped at is valid and poor: nothing is made of it
      out.answer = {};
      out.answer.termination = Termination::cancelled;
      out.answer.message = "the fit was stopped before it began";
      return;
    }
    const double unseen = drop_unseen_side(recording, seen, observed);
    if (unseen > 0 && options.method != "paper" && !doubt) doubt = other_shapes(as_given, unseen, views.symmetries);
    if (unseen > 0 && doubt) doubt->side = unseen_side(as_given, recording, seen);
    const auto foot = foot_doubt(recording, views.strip_m);
    if (foot && options.method != "paper" && !doubt) doubt.emplace().foot = foot;
    if (options.method == "paper") {
      out.answer = estimation::fit_as_in_paper(recording, object, observed, options.fit, progress);  // sec. VI: error function and its minimum
      return;
    }
    Recording whole = recording;
    const estimation::SimulatedObject filled = object;
    const std::optional<estimation::ShapeDoubt> unjudged = doubt;
    estimation::FitOptions fit_options = options.fit;
    const auto fit_steps = [&](const estimation::StepCounts& steps) {
      recording = whole;
      object = filled;
      doubt = unjudged;
      estimation::keep_first_steps(recording, steps);
      if (doubt)
        for (estimation::AlternativeShape& shape : doubt->shapes) {
          estimation::take_slips(whole, shape.recording);
          estimation::keep_first_steps(shape.recording, steps);
        }
      return estimation::fit_on_fine_mesh(recording, object, estimation::first_steps(observed, whole, steps), fit_options,
                                          options.mesh_tolerance, doubt ? &*doubt : nullptr, progress, fill_anew(as_given, recording));
    };
    const auto fit_loads = [&](const Identification* before) {
      if (before == nullptr) fitted = estimation::all_steps(whole);  // else of no higher loads: E was wrong that would take them
      else fit_options.young_start_pa = before->parameters[0].value, fit_options.poisson_start = before->parameters[1].value;
      if (options.all_loads) return fit_steps(fitted);
      return estimation::fit_within_pressure(whole, filled, observed, fit_options, fit_steps, &fitted, progress);
    };
    out.answer = options.slips ? estimation::fit_with_slips(whole, fit_loads) : fit_loads(nullptr);
  };
  fit(reconstruction::Completion::mirrored);
  if (doubt && doubt->effect && doubt->effect->better) {
    doubt->effect->better.reset();
    fit(reconstruction::Completion::planar);  // the only alternative that is as likely
  }
  for (Verdict& verdict : estimation::contacts_off_surface(as_given, recording)) out.answer.verdicts.push_back(std::move(verdict));
  masked_m = estimation::first_steps(masked_m, as_given, fitted);
  for (std::size_t s = 0; s < out.answer.steps.size() && s < masked_m.size(); ++s) {
    out.answer.steps[s].masked_m = std::move(masked_m[s]);
  }
  out.answer.method = options.method;
  out.answer.provenance.merge(provenance(recording, options));
  out.volume = object.mesh;
  out.region = object.region;
  out.object = std::move(recording);
  out.object.rest = {};
  out.object.rest.state = given.rest.state;
  out.object.rest.volume = object.mesh;
  if (out.object.regions.size() > 1) {  // as they were simulated, whatever they were chosen by
    for (std::size_t r = 0; r < out.object.regions.size(); ++r) {
      Region region;
      region.name = out.object.regions[r].name;
      region.select = RegionSelection::elements;
      for (std::size_t e = 0; e < out.region.size(); ++e)
        if (out.region[e] == static_cast<int>(r)) region.elements.push_back(static_cast<Index>(e));
      out.object.regions[r] = std::move(region);
    }
  }
  out.object.pushes.clear();
  out.object.robot.reset();
  out.object.joint_names.clear();
  return out;
}

}  // namespace palpate
