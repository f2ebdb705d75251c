// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_inputs.hpp"

#include "palpate/geometry/ray_subset.hpp"
#include "palpate/identify.hpp"

namespace palpate::cli {
namespace {

/// Both methods are given every n-th pixel: about as many points a sample as the paper's time-of-flight camera has (3200).
constexpr Index most_points = 2000;
/// Squared distances have no defence against what is not the object (flying pixels, the table's edge), and the paper's
/// points were cut to the object: so are those of both methods here.
constexpr double near_object_m = 0.025;

}  // namespace

RayCloud thinned(const RayCloud& all, const geometry::TriangleTree& rest) {
  std::vector<Index> near;
  for (Index i = 0; i < static_cast<Index>(all.range_m.size()); ++i) {
    const Vec3 point_m = Vec3(all.origins_m.row(i)) + all.range_m(i) * Vec3(all.directions.row(i));
    if (rest.closest(point_m).squared_distance_m2 < near_object_m * near_object_m) near.push_back(i);
  }
  const std::size_t stride = std::max<std::size_t>(1, (near.size() + most_points - 1) / most_points);
  std::vector<Index> rows;
  for (std::size_t i = 0; i < near.size(); i += stride) rows.push_back(near[i]);
  return geometry::rays_at(all, rows);
}

Prepared prepare(Recording recording, const OnProgress& progress) {
  Prepared out;
  out.inputs = observe(recording);
  out.object = build_simulated_object(recording, progress);
  const geometry::TriangleTree rest(out.object.surface.rest());
  for (auto& step : out.inputs)
    for (auto& input : step)
      if (auto* seen = std::get_if<estimation::RayObservation>(&input)) seen->rays = thinned(seen->rays, rest);
  out.recording = std::move(recording);
  return out;
}

Prepared part_of(const Prepared& all, const std::function<bool(std::size_t push, std::size_t step)>& keep) {
  Prepared out{all.recording, all.object, {}};
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

bool loaded(const Step& step) { return !step.loads.empty() && step.loads[0].force_n && step.loads[0].force_n->norm() > 0; }

Prepared as_one(Prepared given) {
  given.recording.regions.clear();
  given.object.region.clear();
  given.object.region_names.clear();
  return given;
}

}  // namespace palpate::cli
