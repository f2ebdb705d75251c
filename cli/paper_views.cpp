// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_views.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "cli/paper_expected.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/io/base64.hpp"
#include "palpate/registration/icp.hpp"
#include "palpate/report/canvas.hpp"
#include "palpate/report/mesh_picture.hpp"
#include "palpate/report/object_picture.hpp"
#include "palpate/sensing/camera.hpp"
#include "palpate/sensing/observe.hpp"

namespace palpate::cli {
namespace {

using Depths = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;  // along the optical axis, NaN = nothing there

constexpr double no_depth = std::numeric_limits<double>::quiet_NaN();
constexpr double largest_difference_m = 0.01;  // that colours tell apart

/// Part of an image: columns and rows.
struct Window {
  int left = 0, top = 0, width = 0, height = 0;
};

/// The object with a margin, in its own shape.
Window around(const Depths& object_m) {
  int left = static_cast<int>(object_m.cols()), right = -1, top = static_cast<int>(object_m.rows()), foot = -1;
  for (int v = 0; v < object_m.rows(); ++v)
    for (int u = 0; u < object_m.cols(); ++u)
      if (std::isfinite(object_m(v, u))) {
        left = std::min(left, u), right = std::max(right, u);
        top = std::min(top, v), foot = std::max(foot, v);
      }
  if (right < 0) return {};
  const int margin = std::max(4, (right - left + foot - top) / 8);
  left = std::max(0, left - margin), top = std::max(0, top - margin);
  right = std::min(static_cast<int>(object_m.cols()) - 1, right + margin), foot = std::min(static_cast<int>(object_m.rows()) - 1, foot + margin);
  return {left, top, right - left + 1, foot - top + 1};
}

report::Colour difference_colour(double difference_m) {
  const double share = std::clamp(difference_m / largest_difference_m, -1.0, 1.0), strong = std::abs(share);
  const auto towards = [&](double to) { return static_cast<std::uint8_t>(std::lround(240 + (to - 240) * strong)); };
  return share < 0 ? report::Colour{towards(178), towards(60), towards(40)} : report::Colour{towards(30), towards(90), towards(160)};
}

template <class Paint>
PaperView picture_of(const Depths& values_m, const Window& window, std::string what, Paint paint) {
  report::Picture picture{window.width, window.height, {}};
  picture.rgba.assign(4 * static_cast<std::size_t>(window.width) * static_cast<std::size_t>(window.height), 0);
  for (int v = 0; v < window.height; ++v)
    for (int u = 0; u < window.width; ++u) {
      const double value_m = values_m(window.top + v, window.left + u);
      if (!std::isfinite(value_m)) continue;
      const report::Colour colour = paint(value_m);
      std::uint8_t* to = &picture.rgba[4 * (static_cast<std::size_t>(v) * static_cast<std::size_t>(window.width) + static_cast<std::size_t>(u))];
      to[0] = colour.r, to[1] = colour.g, to[2] = colour.b, to[3] = 255;
    }
  return {std::move(what), window.width, window.height, io::base64_encoded(report::encode_png(picture))};
}

/// The loaded step whose image shows the largest force.
struct Hardest {
  std::size_t push = 0, step = 0, flat = 0;
  const DepthFrame* image = nullptr;
};

std::optional<Hardest> hardest_of(const Recording& recording) {
  Hardest out;
  double most_n = 0;
  std::size_t flat = 0;
  for (std::size_t p = 0; p < recording.pushes.size(); ++p)
    for (std::size_t s = 0; s < recording.pushes[p].steps.size(); ++s, ++flat) {
      const Step& step = recording.pushes[p].steps[s];
      if (!loaded(step) || step.loads[0].force_n->norm() <= most_n) continue;
      for (const Observation& one : step.observations)
        if (const auto* image = std::get_if<DepthFrame>(&one)) {
          out = {p, s, flat, image};
          most_n = step.loads[0].force_n->norm();
        }
    }
  return out.image != nullptr ? std::optional(out) : std::nullopt;
}

Depths as_measured(const DepthFrame& image) {
  Depths out(image.depth_m.rows(), image.depth_m.cols());
  for (Eigen::Index v = 0; v < out.rows(); ++v)
    for (Eigen::Index u = 0; u < out.cols(); ++u) out(v, u) = image.depth_m(v, u) > 0 ? static_cast<double>(image.depth_m(v, u)) : no_depth;
  return out;
}

/// What both methods are given of it, before it is thinned: without the robot, the table and what else is not the object.
Depths of_the_object(const Recording& seen, const Hardest& hardest, const Depths& measured_m, const geometry::TriangleTree& rest) {
  Recording one = seen;
  Push push = seen.pushes[hardest.push];
  push.steps = {push.steps[hardest.step]};
  one.pushes = {std::move(push)};
  Depths out = Depths::Constant(measured_m.rows(), measured_m.cols(), no_depth);
  const double near_m = near_of(seen);
  for (const auto& step : observe(one))
    for (const auto& input : step)
      if (const auto* rays = std::get_if<estimation::RayObservation>(&input))
        for (Index i = 0; i < static_cast<Index>(rays->rays.range_m.size()); ++i) {
          const RayCloud& all = rays->rays;
          const Vec3 point_m = all.origins_m.row(i) + all.range_m(i) * all.directions.row(i);
          if (rest.within(point_m, near_m * near_m)) out(all.pixel(i, 1), all.pixel(i, 0)) = measured_m(all.pixel(i, 1), all.pixel(i, 0));
        }
  return out;
}

/// A value also where its next neighbours are that were left out.
Depths spread(const Depths& few, const Depths& everywhere) {
  const auto finite = [](const Depths& depths) { return static_cast<double>(depths.array().isFinite().count()); };
  const int reach = static_cast<int>(std::lround(std::sqrt(finite(everywhere) / std::max(finite(few), 1.0)))) / 2;
  Depths out = few;
  for (int v = 0; v < few.rows(); ++v)
    for (int u = 0; u < few.cols(); ++u) {
      if (!std::isfinite(few(v, u))) continue;
      for (int y = std::max(0, v - reach); y <= std::min(static_cast<int>(few.rows()) - 1, v + reach); ++y)
        for (int x = std::max(0, u - reach); x <= std::min(static_cast<int>(few.cols()) - 1, u + reach); ++x)
          if (!std::isfinite(few(y, x))) out(y, x) = few(v, u);
    }
  return out;
}

/// A surface as a camera without noise would measure it.
Depths cast_onto(const DepthFrame& image, const geometry::TriangleTree& surface, const Pose& T_surface_base) {
  const Points directions = sensing::pixel_directions(image.camera);
  const Pose T = T_surface_base * image.T_base_camera;
  Depths out = Depths::Constant(image.camera.height_px, image.camera.width_px, no_depth);
  Index hint = -1;
  for (int v = 0; v < out.rows(); ++v)
    for (int u = 0; u < out.cols(); ++u) {
      const Vec3 direction = directions.row(static_cast<Eigen::Index>(v) * image.camera.width_px + u);
      if (!direction.allFinite()) continue;
      if (const auto hit = surface.cast(T.translation(), T.linear() * direction, 1e300, hint)) {
        out(v, u) = hit->range_m;
        hint = hit->triangle;
      }
    }
  return out;
}

}  // namespace

std::vector<PaperView> views_of(const Recording& seen, const Prepared& given, const MethodAnswer& answer, const std::vector<double>& by_region,
                                const estimation::FitOptions& options) {
  const auto hardest = hardest_of(seen);
  if (!hardest || !std::isfinite(answer.young_modulus_pa)) return {};
  estimation::FitMemory memory;
  Expected expected(given.recording, given.object, options, memory);
  const auto simulated = expected(hardest->flat, answer.young_modulus_pa, answer.poisson_ratio, by_region);
  if (!simulated.converged) return {};
  const TriMesh& rest = given.object.surface.rest();
  const geometry::TriangleTree tree(TriMesh{simulated.surface_m, rest.triangles});

  const Depths measured_m = as_measured(*hardest->image), object_m = of_the_object(seen, *hardest, measured_m, geometry::TriangleTree(rest));
  Pose T_surface_base = Pose::Identity();
  if (seen.free) {  // it moved as a whole
    PointCloud cloud;
    for (const auto& input : given.inputs[hardest->flat])
      if (const auto* rays = std::get_if<estimation::RayObservation>(&input))
        cloud.points_m = rays->rays.origins_m + (rays->rays.directions.array().colwise() * rays->rays.range_m.array()).matrix();
    if (cloud.points_m.rows() > 5) T_surface_base = registration::align(cloud, tree, Pose::Identity()).T_surface_cloud;
  }
  const Depths simulated_m = cast_onto(*hardest->image, tree, T_surface_base);
  const Window window = around(simulated_m);
  if (window.width == 0) return {};
  double near_m = std::numeric_limits<double>::infinity(), far_m = 0;
  for (double depth_m : simulated_m.reshaped())
    if (std::isfinite(depth_m)) near_m = std::min(near_m, depth_m), far_m = std::max(far_m, depth_m);
  const auto by_depth = [&](double depth_m) {
    return depth_m > far_m + 0.05 ? report::Colour{250, 250, 250} : report::size_colour((depth_m - near_m) / (far_m - near_m));
  };
  TetMesh corners{given.object.mesh.nodes_m, given.object.mesh.tetrahedra.leftCols(4)};
  const report::Picture mesh = report::draw_mesh(corners, 640, 320);
  return {
      {"The object's model: its surface, and cut in the middle", mesh.width, mesh.height, io::base64_encoded(report::encode_png(mesh))},
      picture_of(measured_m, window, "The camera's depth image of the hardest push, robot and all", by_depth),
      picture_of(spread(object_m, simulated_m), window, "What is left of it without robot and surroundings", by_depth),
      picture_of(simulated_m, window, "The surface that is simulated with palpate's answer, from there", by_depth),
      picture_of(spread(object_m - simulated_m, simulated_m), window, "Measured less simulated: red to blue = -10 to 10 mm",
                 [](double difference_m) { return difference_colour(difference_m); }),
  };
}

std::vector<PaperView> views_of_model(const Recording& seen, const Prepared& given) {
  constexpr int side_px = 320;
  const geometry::TriangleTree surface(given.object.surface.rest());
  const double near_m = near_of(seen);
  std::vector<Points> clouds;
  for (const DepthFrame& view : seen.rest.views) {
    const RayCloud rays = sensing::observe(view, seen.environment);
    Points& cloud = clouds.emplace_back(rays.origins_m + (rays.directions.array().colwise() * rays.range_m.array()).matrix());
    Index kept = 0;
    for (Index i = 0; i < static_cast<Index>(cloud.rows()); ++i)
      if (surface.within(cloud.row(i), near_m * near_m)) cloud.row(kept++) = cloud.row(i).eval();
    cloud.conservativeResize(kept, 3);
  }
  const Points& around = given.object.surface.rest().vertices_m;
  const TetMesh corners{given.object.mesh.nodes_m, given.object.mesh.tetrahedra.leftCols(4)};
  const auto view = [](std::string what, const report::Picture& picture) {
    return PaperView{std::move(what), picture.width, picture.height, io::base64_encoded(report::encode_png(picture))};
  };
  return {view("The points of one view", report::draw_clouds(std::span(clouds).first(std::min<std::size_t>(1, clouds.size())), around, side_px, side_px)),
          view(fmt::format("Those of {} views, where their cameras are said to have been", clouds.size()), report::draw_clouds(clouds, around, side_px, side_px)),
          view("The surface made of them", report::draw_surface(given.object.surface.rest(), side_px, side_px)),
          view(fmt::format("Its {} tetrahedra, cut in the middle", corners.tetrahedra.rows()), report::draw_mesh(corners, 2 * side_px, side_px))};
}

}  // namespace palpate::cli
