// SPDX-License-Identifier: Apache-2.0
// What can be wrong with a recording whose files could all be read. A wrong unit is noticed by comparing everything with
// the object's size.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "palpate/core/recording_values.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/recording_reader.hpp"

namespace palpate::io {
namespace {

constexpr double smallest_m = 1e-3, largest_m = 10.0;

/// A length in the unit that people would say it in.
std::string length(double value_m) {
  const double size = std::abs(value_m);
  if (size < 1e-3) return fmt::format("{:.3g} um", value_m * 1e6);
  if (size < 1) return fmt::format("{:.3g} mm", value_m * 1e3);
  return fmt::format("{:.3g} m", value_m);
}

struct Box {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());
  explicit Box(const Points& points) {
    if (points.rows() == 0) return;
    min = points.colwise().minCoeff();
    max = points.colwise().maxCoeff();
  }
  Vec3 size() const { return max - min; }
  Vec3 centre() const { return 0.5 * (min + max); }
  double diagonal() const { return size().norm(); }
};

class Checker {
 public:
  explicit Checker(const Recording& recording)
      : recording_(recording),
        nodes_(recording.rest.volume    ? recording.rest.volume->nodes_m
               : recording.rest.surface ? recording.rest.surface->vertices_m
                                        : Points(0, 3)),
        box_(nodes_) {}

  std::vector<Problem> check() {
    has_mesh_ = nodes_.rows() > 0;
    check_size();
    if (recording_.rest.volume) check_tetrahedra(*recording_.rest.volume);
    for (const Support& support : recording_.supports) check_support(support);
    for (const Region& region : recording_.regions) check_region(region);
    if (!recording_.free && recording_.supports.empty()) {
      add(recording_.source, "nothing says how the object is held; list 'supports', or write 'supports: free'");
    }
    bool observed = false, loaded = false;
    for (const Push& push : recording_.pushes) {
      for (const Step& step : push.steps) {
        for (const Load& load : step.loads) loaded |= check_load(load, step);
        for (const Observation& observation : step.observations) {
          observed = true;
          std::visit([&](const auto& one) { check_observation(one, step); }, observation);
        }
      }
    }
    for (const Tool& tool : recording_.tools) check_platen(tool);
    check_numbers(recording_, problems_);
    for (const Push& push : recording_.pushes) check_signs(push);
    check_loads(loaded);
    if (recording_.pushes.empty())
      add(recording_.source, "holds no push; list in 'pushes' what was done to the object");
    else if (!observed)
      add(recording_.source,
          "no step holds an observation; add what the sensors saw (depth, cloud, markers, travel or wrench)");
    return std::move(problems_);
  }

 private:
  void add(const std::string& where, const std::string& what) { problems_.push_back({where, what}); }

  void check_size() {
    if (!has_mesh_) return;
    const double side = box_.size().maxCoeff();
    if (recording_.accept_size || (side >= smallest_m && side <= largest_m)) return;
    const std::string guess = side > largest_m ? "is it in millimetres? Add 'scale_to_m: 0.001' to 'rest'"
                                               : "is its unit right? 'scale_to_m' turns it into metres";
    add(recording_.rest.source,
        fmt::format("the object is {} long, objects of 1 mm to 10 m are expected; {} (or 'accept_size: true' if it is so)",
                    length(side), guess));
  }

  void check_tetrahedra(const TetMesh& mesh) {
    Eigen::Index flipped = 0, flat = 0, first = -1;
    for (Eigen::Index i = 0; i < mesh.tetrahedra.rows(); ++i) {
      const auto corner = [&](Eigen::Index k) { return Vec3(mesh.nodes_m.row(mesh.tetrahedra(i, k))); };
      const Vec3 a = corner(1) - corner(0), b = corner(2) - corner(0), c = corner(3) - corner(0);
      const double volume = a.cross(b).dot(c), size = std::max({a.norm(), b.norm(), c.norm()});
      if (volume > 1e-9 * size * size * size) continue;
      (std::abs(volume) <= 1e-9 * size * size * size ? flat : flipped) += 1;
      if (first < 0) first = i;
    }
    if (flipped + flat > 0) {
      add(recording_.rest.source, fmt::format("{} of {} tetrahedra are turned inside out and {} are flat, the first is "
                                              "number {}; swap two corners of each that is turned "
                                              "(det(x1-x0, x2-x0, x3-x0) must be positive) and remesh where they are flat",
                                              flipped, mesh.tetrahedra.rows(), flat, first));
    }
    if (mesh.tetrahedra.cols() == 10) check_midpoints(mesh);
  }

  /// Quadratic tetrahedra in another node order have midpoints far from their edges.
  void check_midpoints(const TetMesh& mesh) {
    constexpr Eigen::Index edge[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};
    for (Eigen::Index i = 0; i < mesh.tetrahedra.rows(); ++i) {
      for (Eigen::Index k = 0; k < 6; ++k) {
        const Vec3 a = mesh.nodes_m.row(mesh.tetrahedra(i, edge[k][0])),
                   b = mesh.nodes_m.row(mesh.tetrahedra(i, edge[k][1])),
                   middle = mesh.nodes_m.row(mesh.tetrahedra(i, 4 + k));
        if ((middle - 0.5 * (a + b)).norm() <= 0.4 * (b - a).norm()) continue;
        add(recording_.rest.source,
            fmt::format("node {} of tetrahedron {} is far from the middle of its edge; the nodes are not in the order of "
                        "the file format",
                        4 + k, i));
        return;
      }
    }
  }

  void check_support(const Support& support) {
    if (!has_mesh_) return;
    const bool half_space = support.kind == SupportKind::table || support.kind == SupportKind::wall;
    // A program gives the kind, which says by what the nodes are chosen; only a clamp must say it besides.
    const bool is_clamp = support.kind == SupportKind::clamp;
    if (support.kind == SupportKind::plane || (is_clamp && support.select == NodeSelection::plane)) {
      const VectorX distance = ((nodes_.rowwise() - support.plane.point_m.transpose()) * support.plane.normal).cwiseAbs();
      if (distance.minCoeff() > support.tolerance_m) {
        add(support.source,
            fmt::format(
                "no node lies within {} of the plane of '{}', the nearest is {} away; move the plane or raise 'tolerance_m'",
                length(support.tolerance_m), support.name, length(distance.minCoeff())));
      } else if (distance.maxCoeff() <= support.tolerance_m) {
        add(support.source, fmt::format("every node lies within tolerance_m ({}) of the plane of '{}', so nothing is left to move; is it in "
                                        "metres?",
                                        length(support.tolerance_m), support.name));
      }
    } else if (support.kind == SupportKind::box || (is_clamp && support.select == NodeSelection::box)) {
      Eigen::Index inside = 0;
      for (Eigen::Index i = 0; i < nodes_.rows(); ++i) {
        const auto x = nodes_.row(i).transpose().array();
        inside += (x >= support.box_min_m.array()).all() && (x <= support.box_max_m.array()).all() ? 1 : 0;
      }
      if (inside == 0)
        add(support.source, fmt::format("no node lies in the box of '{}'; the object reaches from [{}] to [{}]",
                                        support.name, point(box_.min), point(box_.max)));
      else if (inside == nodes_.rows())
        add(support.source, fmt::format("every node lies in the box of '{}', so nothing is left to move; the object reaches from [{}] to [{}]",
                                        support.name, point(box_.min), point(box_.max)));
    } else if (half_space) {
      const double lowest = ((nodes_.rowwise() - support.plane.point_m.transpose()) * support.plane.normal).minCoeff();
      if (std::abs(lowest) > 0.5 * box_.diagonal()) {
        add(support.source,
            fmt::format("the object is {} from '{}'; is the normal on the object's side, and the point in metres?",
                        length(lowest), support.name));
      }
    }
  }

  /// Whether every element has a region is known once there are elements.
  void check_region(const Region& region) {
    if (!has_mesh_) return;
    if (region.select == RegionSelection::box && ((region.box_min_m.array() > box_.max.array()).any() ||
                                                  (region.box_max_m.array() < box_.min.array()).any())) {
      add(region.source, fmt::format("the box of '{}' passes the object by, which reaches from [{}] to [{}]", region.name,
                                     point(box_.min), point(box_.max)));
    }
    for (Eigen::Index i = 0; region.select == RegionSelection::points && i < region.points_m.rows(); ++i) {
      const Vec3 at = region.points_m.row(i);
      if ((at - at.cwiseMax(box_.min).cwiseMin(box_.max)).norm() <= 0.5 * box_.diagonal()) continue;
      add(region.source, fmt::format("the point [{}] of '{}' is far from the object, which reaches from [{}] to [{}]; is it in metres?",
                                     point(at), region.name, point(box_.min), point(box_.max)));
    }
  }

  void check_platen(const Tool& tool) {
    if (!has_mesh_ || tool.shape != ToolShape::platen) return;
    const VectorX height = (nodes_.rowwise() - tool.plane.point_m.transpose()) * tool.plane.normal.normalized();
    const double nearest = height.cwiseAbs().minCoeff();
    if (nearest > 0.01 * box_.diagonal())
      add("tools." + tool.name, fmt::format("the platen's plane is {} from the object; give a point of the face where it first touches, in metres",
                                            length(nearest)));
    else if (height.mean() < 0)
      add("tools." + tool.name, "the platen's normal points away from the object; it points to where the object is");
  }

  /// Force and travel of a tool over a push: what presses an object moves into it.
  void check_signs(const Push& push) {
    double work = 0, size = 0;
    for (const Step& step : push.steps) {
      for (const Load& load : step.loads) {
        std::optional<double> force, travel = load.travel_m;
        if (load.force_n) force = load.force_n->dot(load.direction);
        for (const Observation& one : step.observations) {
          if (const auto* wrench = std::get_if<Wrench>(&one); wrench && !force && (wrench->tool.empty() || wrench->tool == load.tool))
            force = wrench->force_n.dot(load.direction);
          if (const auto* seen = std::get_if<ToolTravel>(&one); seen && !travel && (seen->tool.empty() || seen->tool == load.tool))
            travel = seen->travel_m;
        }
        if (!force || !travel) continue;
        work += *force * *travel;
        size += std::abs(*force * *travel);
      }
    }
    if (size > 0 && work < -0.5 * size)
      add(push.steps.front().source, "force and travel of push '" + push.name +
                                         "' have opposite signs: both are positive along 'direction' where the tool presses; turn one of them");
  }

  static std::string point(const Vec3& x) { return fmt::format("{:.4g}, {:.4g}, {:.4g}", x.x(), x.y(), x.z()); }

  bool check_load(const Load& load, const Step& step) {
    const bool acts = (load.force_n && load.force_n->norm() > 0) || (load.travel_m && *load.travel_m != 0);
    if (load.force_n && load.force_n->norm() > 1e5) {
      add(step.source, fmt::format("the force of '{}' is {:.3g} N; is it in mN?", load.tool, load.force_n->norm()));
    }
    if (load.travel_m) check_travel(*load.travel_m, step);
    const auto tool = std::find_if(recording_.tools.begin(), recording_.tools.end(),
                                   [&](const Tool& one) { return one.name == load.tool; });
    const bool has_contact =
        tool != recording_.tools.end() && tool->shape != ToolShape::vertices && tool->shape != ToolShape::platen;
    if (acts && has_mesh_ && has_contact) {
      const double distance = (nodes_.rowwise() - load.contact_m.transpose()).rowwise().norm().minCoeff();
      if (distance > box_.diagonal()) {
        add(step.source, fmt::format("contact_m [{}] is {} from the object; it is a point on the rest surface, in metres",
                                     point(load.contact_m), length(distance)));
      } else if (load.force_n && (tool->shape == ToolShape::sphere || tool->shape == ToolShape::disc)) {
        check_contact(load, tool->radius_m, step);
      }
    }
    return acts;
  }

  /// A fit takes the nearest place on the surface, as far away as the patch is wide.
  void check_contact(const Load& load, double radius_m, const Step& step) {
    if (!surface_) surface_.emplace(recording_.rest.volume ? geometry::boundary_surface(*recording_.rest.volume).surface : *recording_.rest.surface);
    const double off_m = std::sqrt(surface_->closest(load.contact_m).squared_distance_m2);
    if (off_m > radius_m)
      add(step.source, fmt::format("contact_m [{}] is {} from the object's surface, further than '{}' is wide ({}); is it in the object's frame, and the "
                                   "tool's length right?",
                                   point(load.contact_m), length(off_m), load.tool, length(radius_m)));
  }

  void check_loads(bool loaded) {
    if (loaded) return;
    const bool weight = recording_.environment.gravity_m_s2.norm() > 0 && recording_.density_kg_m3 > 0;
    if (!weight) {
      add(recording_.source,
          "every load is zero and no gravity acts, so nothing deforms the object; give the measured forces, or gravity_m_s2 "
          "and density_kg_m3");
    } else if (recording_.rest.state == RestState::under_gravity) {
      add(recording_.source,
          "every load is zero and the rest shape already sags under gravity, so nothing deforms it further; add a push, or "
          "give the stress-free shape");
    }
  }

  void check_travel(double travel_m, const Step& step) {
    if (has_mesh_ && std::abs(travel_m) > 2 * box_.diagonal()) {
      add(step.source,
          fmt::format("the travel of {} is larger than the object ({}); is it in millimetres? travel_m is in metres",
                      length(travel_m), length(box_.diagonal())));
    }
  }

  void check_observation(const ToolTravel& travel, const Step& step) { check_travel(travel.travel_m, step); }

  void check_observation(const Wrench& wrench, const Step& step) {
    if (wrench.force_n.norm() > 1e5)
      add(step.source, fmt::format("a force of {:.3g} N was observed; is it in mN?", wrench.force_n.norm()));
  }

  void check_observation(const PointCloud& cloud, const Step& step) {
    if (!has_mesh_ || cloud.points_m.rows() == 0) return;
    const double diagonal = box_.diagonal(), own = Box(cloud.points_m).diagonal();
    // The nearest point decides how far a cloud is: it may show the table around the object as well.
    const double distance = (cloud.points_m.rowwise() - box_.centre().transpose()).rowwise().norm().minCoeff();
    if (cloud.points_m.rows() > 10 && own < 0.01 * diagonal) {
      add(step.source,
          fmt::format("the cloud is {} wide and the object {}; is the cloud's unit metres?", length(own), length(diagonal)));
    } else if (own > 50 * diagonal) {
      add(step.source,
          fmt::format("the cloud is {} wide and the object {}; is the cloud in millimetres? It must be in metres",
                      length(own), length(diagonal)));
    } else if (distance > 3 * diagonal) {
      add(step.source,
          fmt::format(
              "the whole cloud is at least {} from the centre of the object, which is {} wide; is it in metres and in "
              "the base frame?",
              length(distance), length(diagonal)));
    }
  }

  void check_observation(const Markers& markers, const Step& step) {
    if (!has_mesh_) return;
    for (Eigen::Index i = 0; i < std::min(markers.rest_m.rows(), markers.observed_m.rows()); ++i) {
      for (const auto& [place, what] : {std::pair{markers.rest_m.row(i), "rest"}, {markers.observed_m.row(i), "observed"}}) {
        const double distance = (Vec3(place) - box_.centre()).norm();
        if (!(distance > 3 * box_.diagonal())) continue;  // hidden markers are NaN
        add(step.source,
            fmt::format("marker '{}' ({}) is {} from the object's centre; is it in metres and in the base frame?",
                        static_cast<std::size_t>(i) < markers.names.size() ? markers.names[static_cast<std::size_t>(i)] : std::to_string(i), what,
                        length(distance)));
        return;
      }
    }
  }

  void check_observation(const DepthFrame& frame, const Step& step) {
    std::vector<float> depths;
    const bool masked = frame.mask.size() == frame.depth_m.size();
    for (Eigen::Index i = 0; i < frame.depth_m.size(); ++i) {
      if (frame.depth_m.data()[i] > 0 && !(masked && frame.mask.data()[i] != 0)) depths.push_back(frame.depth_m.data()[i]);
    }
    if (depths.empty()) {
      add(step.source, "no pixel outside the mask has a depth; non-zero in the mask means invalid");
      return;
    }
    std::sort(depths.begin(), depths.end());
    const double median = static_cast<double>(depths[depths.size() / 2]);
    if (median < 0.02 || median > 50) {
      add(step.source, fmt::format("the median depth is {}; is the camera's 'depth_unit_m' right (0.001 for millimetres)?",
                                   length(median)));
      return;
    }
    if (!has_mesh_) return;
    const Pose T_camera_base = frame.T_base_camera.inverse();
    const Points in_camera =
        (nodes_ * T_camera_base.linear().transpose()).rowwise() + T_camera_base.translation().transpose();
    const double near = in_camera.col(2).minCoeff(), far = in_camera.col(2).maxCoeff();
    if (far <= 0) {
      add(step.source,
          "the object lies behind the camera; T_base_camera maps the camera's coordinates into the base frame, was its "
          "inverse given?");
    } else if (static_cast<double>(depths.back()) < 0.5 * near || static_cast<double>(depths.front()) > 2 * far) {
      add(step.source, fmt::format("depths of {} to {} were seen, the object is {} to {} from the camera; check "
                                   "'depth_unit_m' and 'T_base_camera'",
                                   length(static_cast<double>(depths.front())), length(static_cast<double>(depths.back())),
                                   length(near), length(far)));
    }
  }

  const Recording& recording_;
  Points nodes_;
  Box box_;
  bool has_mesh_ = false;
  std::optional<geometry::TriangleTree> surface_;  // made when a contact asks for it
  std::vector<Problem> problems_;
};

}  // namespace

std::vector<Problem> check_recording(const Recording& recording) {
  std::vector<Problem> problems;
  for (WrongValue& one : wrong_values(recording)) problems.push_back({std::move(one.where), std::move(one.what)});
  return problems.empty() ? Checker(recording).check() : problems;  // what is compared below takes numbers for granted
}

}  // namespace palpate::io
