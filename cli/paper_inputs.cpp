// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_inputs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/geometry/ray_subset.hpp"
#include "palpate/identify.hpp"
#include "palpate/reconstruction/build_object.hpp"

namespace palpate::cli {
namespace {

constexpr double coarse_edge = 0.6;  // of a look, under the pad: of its radius

/// Squared distances have no defence against what is not the object (flying pixels, the table's edge), and the paper's
/// points were cut to the object: so are those of both methods here.
/// What a deeper push dents lies as far from where it was.
constexpr double near_object_m = 0.025;

/// A volume of the wished size, of the given surface or of one that is completed from views.
void fill(Recording& recording, const ModelChoice& choice, reconstruction::Completion completion, std::vector<char>& seen,
          const OnProgress& progress) {
  if (!recording.rest.surface) {
    Recording completed = recording;
    build_simulated_object(completed, progress, completion, &seen);
    recording.rest.surface = completed.rest.surface;
    recording.rest.surface_std_m = completed.rest.surface_std_m;
    recording.supports = completed.supports;
  }
  reconstruction::BuildOptions options;
  options.mesh.tetrahedra = choice.tetrahedra;
  const double edge_m = choice.coarse && choice.edge_m == 0 ? coarse_edge * recording.tools.front().radius_m : choice.edge_m;
  if (edge_m > 0)
    for (const Push& push : recording.pushes)
      for (const Step& step : push.steps)
        if (loaded(step) && (options.mesh.finer.empty() || options.mesh.finer.back().point_m != step.loads[0].contact_m))
          options.mesh.finer.push_back({step.loads[0].contact_m, 1.5 * recording.tools.front().radius_m, edge_m});
  auto built = reconstruction::build_object(*recording.rest.surface, recording.supports, options, progress);
  recording.supports = std::move(built.model.supports);
  recording.rest.volume = std::move(built.model.volume);
}

/// Point loads: every tool presses the node that is nearest to where it touches first.
void press_at_nodes(Recording& recording, const TetMesh& mesh) {
  for (Tool& tool : recording.tools) {
    for (const Push& push : recording.pushes)
      for (const Step& step : push.steps)
        for (const Load& load : step.loads) {
          if (load.tool != tool.name || tool.shape == ToolShape::vertices) continue;
          Eigen::Index nearest = 0;
          (mesh.nodes_m.rowwise() - load.contact_m.transpose()).rowwise().squaredNorm().minCoeff(&nearest);
          tool.shape = ToolShape::vertices;
          tool.vertices = {static_cast<Index>(nearest)};
        }
  }
}

}  // namespace

double near_of(const Recording& recording) {
  double near_m = near_object_m;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps) {
      const double travel_m = travel_of(step);
      if (std::isfinite(travel_m)) near_m = std::max(near_m, 1.1 * travel_m);
    }
  return near_m;
}

RayCloud thinned(const RayCloud& all, const geometry::TriangleTree& rest, double near_m, Index most) {
  std::vector<Index> near;
  for (Index i = 0; i < static_cast<Index>(all.range_m.size()); ++i) {
    const Vec3 point_m = Vec3(all.origins_m.row(i)) + all.range_m(i) * Vec3(all.directions.row(i));
    if (rest.closest(point_m).squared_distance_m2 < near_m * near_m) near.push_back(i);
  }
  const std::size_t stride = std::max<std::size_t>(1, (near.size() + static_cast<std::size_t>(most) - 1) / static_cast<std::size_t>(most));
  std::vector<Index> rows;
  for (std::size_t i = 0; i < near.size(); i += stride) rows.push_back(near[i]);
  return geometry::rays_at(all, rows);
}

ModelChoice choice_of(const lab::PaperScene& scene, bool coarse) {
  ModelChoice choice;
  choice.coarse = coarse;
  choice.tetrahedra = scene.tetrahedra;
  choice.edge_m = scene.edge_m;
  if (coarse && choice.tetrahedra == 0) choice.tetrahedra = coarse_tetrahedra;
  choice.planar_back = scene.shape == lab::PaperShape::planar_back;
  return choice;
}

lab::PaperScene for_a_look(lab::PaperScene scene) {
  constexpr int few = 4;
  scene.coarse_truth = true;
  if (scene.travel_m == 0) scene.samples = std::min(scene.samples, few);
  return scene;
}

Observed observed(Recording recording) {
  estimation::Inputs inputs = observe(recording);
  return {std::move(recording), std::move(inputs)};
}

Prepared prepare(Observed given, const ModelChoice& choice, SharedModel* shared, const OnProgress& progress,
                 std::shared_ptr<estimation::ShapeDoubt> doubt) {
  Prepared out;
  Recording& recording = given.recording;
  out.inputs = std::move(given.inputs);
  const bool keep = shared != nullptr && recording.rest.views.empty();
  if (keep && shared->built) {
    recording.rest = shared->built->recording.rest;
    recording.supports = shared->built->recording.supports;
    recording.tools = shared->built->recording.tools;
    recording.model.element = shared->built->recording.model.element;
    out.object = shared->built->object;
    if (shared->built->finer) out.finer = std::make_shared<estimation::FinerModel>(*shared->built->finer);
  } else {
    std::vector<char> seen;
    ShapeOfViews views;
    if (choice.coarse) recording.model.refine = "none";
    const Recording as_given = recording;
    if (choice.linear) recording.model.element = "tet4";
    if (choice.linear) recording.model.refine = "none";
    const bool planar = choice.planar_back || choice.planar_agrees;
    const auto completion = planar ? reconstruction::Completion::planar : reconstruction::Completion::mirrored;
    if (choice.tetrahedra > 0) fill(recording, choice, completion, seen, progress);
    out.object = build_simulated_object(recording, progress, completion, choice.tetrahedra > 0 ? nullptr : &seen, &views);
    if (choice.point_load) press_at_nodes(recording, out.object.mesh);
    const double unseen = drop_unseen_side(recording, seen, out.inputs);
    const bool doubted = !choice.coarse && !choice.planar_back;
    if (doubted && unseen > 0) {
      out.doubt = doubt ? std::move(doubt) : std::make_shared<estimation::ShapeDoubt>(other_shapes(as_given, unseen, views.symmetries));
      out.doubt->side = unseen_side(as_given, recording, seen);
    } else if (const auto foot = foot_doubt(recording, views.strip_m); foot && doubted) {
      out.doubt = std::make_shared<estimation::ShapeDoubt>();
      out.doubt->foot = foot;
    }
    if (auto finer = choice.coarse ? std::nullopt : estimation::finer_model(recording, out.object, fill_anew(as_given, recording)))
      out.finer = std::make_shared<estimation::FinerModel>(std::move(*finer));
    if (keep) shared->built = Prepared{recording, out.object, {}, out.finer, nullptr};
  }
  if (out.finer) out.finer->recording.pushes = recording.pushes;
  const geometry::TriangleTree rest(out.object.surface.rest());
  const double near_m = near_of(recording);
  for (auto& step : out.inputs)
    for (auto& input : step)
      if (auto* seen = std::get_if<estimation::RayObservation>(&input)) seen->rays = thinned(seen->rays, rest, near_m, choice.coarse ? coarse_points : usual_points);
  out.recording = std::move(recording);
  return out;
}

Prepared part_of(const Prepared& all, const std::function<bool(std::size_t push, std::size_t step)>& keep) {
  Prepared out{all.recording, all.object, {}, nullptr, nullptr};
  out.recording.pushes.clear();
  std::size_t flat = 0;
  for (std::size_t p = 0; p < all.recording.pushes.size(); ++p) {
    Push push = all.recording.pushes[p];
    push.steps.clear();
    for (std::size_t s = 0; s < all.recording.pushes[p].steps.size(); ++s, ++flat) {
      if (!keep(p, s)) continue;
      push.steps.push_back(all.recording.pushes[p].steps[s]);
      out.inputs.push_back(all.inputs[flat]);
    }
    if (!push.steps.empty()) out.recording.pushes.push_back(std::move(push));
  }
  return out;
}

Prepared first_samples(Prepared given, const estimation::StepCounts& counts) {
  if (counts == estimation::all_steps(given.recording)) return given;
  given.inputs = estimation::first_steps(given.inputs, given.recording, counts);
  estimation::keep_first_steps(given.recording, counts);
  if (given.finer) {
    given.finer = std::make_shared<estimation::FinerModel>(*given.finer);
    estimation::keep_first_steps(given.finer->recording, counts);
  }
  if (given.doubt) {
    given.doubt = std::make_shared<estimation::ShapeDoubt>(*given.doubt);
    for (estimation::AlternativeShape& shape : given.doubt->shapes) estimation::keep_first_steps(shape.recording, counts);
  }
  return given;
}

Prepared with_law(Prepared given, std::string_view law) {
  if (given.finer) given.finer = std::make_shared<estimation::FinerModel>(*given.finer);
  given.recording.model.material = given.object.material = std::string(law);
  if (given.finer) given.finer->recording.model.material = given.finer->object.material = std::string(law);
  return given;
}

double travel_of(const Step& step) {
  for (const auto& observation : step.observations)
    if (const auto* travel = std::get_if<ToolTravel>(&observation)) return travel->travel_m;
  return std::numeric_limits<double>::quiet_NaN();
}

bool loaded(const Step& step) { return !step.loads.empty() && step.loads[0].force_n && step.loads[0].force_n->norm() > 0; }

Prepared as_one(Prepared given) {
  given.recording.regions.clear();
  given.object.region.clear();
  given.object.region_names.clear();
  given.finer.reset();
  return given;
}

}  // namespace palpate::cli
