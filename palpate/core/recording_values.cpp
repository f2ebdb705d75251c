// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/recording_values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/core/physical_range.hpp"

namespace palpate {
namespace {

class ValueChecker {
 public:
  void check(const Recording& recording) {
    tools_ = &recording.tools;
    any_size_ = recording.accept_size;
    spread("force_scale_std", recording.force_scale_std, ranges::share_std);
    spread("force_cross_talk_std", recording.force_cross_talk_std, ranges::share_std);
    spread("time_offset_std_s", recording.time_offset_std_s, ranges::clock_std);
    spread("density_kg_m3", recording.density_kg_m3);
    const double density = recording.density_kg_m3;
    if (std::isfinite(density) && (density > 30000 || (density > 0 && density < 5)))
      add("density_kg_m3", "is outside 5 to 30000 kg/m3; is it in g/cm3? Multiply by 1000");
    if (spread("density_std_kg_m3", recording.density_std_kg_m3) && density > 0 && recording.density_std_kg_m3 > density)
      add("density_std_kg_m3", "is larger than the density itself; it is a standard deviation in kg/m3");
    check(recording.environment, density);
    rest_ = &recording.rest;
    check(recording.rest);
    differ("tools", recording.tools);
    differ("pushes", recording.pushes);
    differ("regions", recording.regions);
    check(recording.regions);
    for (std::size_t i = 0; i < recording.supports.size(); ++i) check(recording.supports[i], "supports[" + std::to_string(i) + "].");
    for (std::size_t i = 0; i < recording.tools.size(); ++i) check(recording.tools[i], "tools[" + std::to_string(i) + "].");
    for (std::size_t p = 0; p < recording.pushes.size(); ++p) {
      const Push& push = recording.pushes[p];
      const std::string at = "pushes[" + std::to_string(p) + "].";
      spread(at + "force_tare_std_n", push.force_tare_std_n, ranges::force_std);
      spread(at + "travel_offset_std_m", push.travel_offset_std_m, ranges::length_std);
      spread(at + "torque_tare_std_nm", push.torque_tare_std_nm, ranges::torque_std);
      spread(at + "tip_std_m", push.tip_std_m, ranges::length_std);
      for (std::size_t s = 0; s < push.steps.size(); ++s) {
        const std::string step = at + "steps[" + std::to_string(s) + "].";
        check(push.steps[s], recording.tools, step);
        one_place(push, push.steps[s], recording.tools, step);
        if (s > 0 && push.steps[s].time_s != 0 && push.steps[s].time_s == push.steps[s - 1].time_s)
          add(step + "time_s", "is that of the step before; a step counts once");
        if (s > 0 && push.steps[s].time_s < push.steps[s - 1].time_s) add(step + "time_s", "goes back, from that of the step before; order steps by time");
      }
    }
  }

  void check(const Step& step, const std::vector<Tool>& tools, const std::string& at) {
    tools_ = &tools;
    if (finite(at + "time_s", step.time_s)) within(at + "time_s", step.time_s, ranges::time);
    if (step.T_base_tip) rigid(at + "T_base_tip", *step.T_base_tip);
    for (const double angle : step.joints_rad)
      if (!finite(at + "joints_rad", angle)) break;
    for (std::size_t l = 0; l < step.loads.size(); ++l) check(step.loads[l], at + "loads[" + std::to_string(l) + "].");
    for (std::size_t o = 0; o < step.observations.size(); ++o)
      std::visit([&](const auto& one) { check(one, at + "observations[" + std::to_string(o) + "]."); }, step.observations[o]);
  }

  std::vector<WrongValue> found() && { return std::move(found_); }

 private:
  void add(std::string where, std::string what) { found_.push_back({std::move(where), std::move(what)}); }

  bool finite(const std::string& where, double value) {
    if (!std::isfinite(value)) add(where, "is not a finite number");
    return std::isfinite(value);
  }
  template <typename Derived>
  bool finite(const std::string& where, const Eigen::MatrixBase<Derived>& values) {
    const bool fine = values.allFinite();
    if (!fine) add(where, "holds NaN or infinity");
    return fine;
  }
  bool spread(const std::string& where, double value) {
    const bool fine = finite(where, value) && value >= 0;
    if (value < 0) add(where, fmt::format("is negative, {}; it must be 0 or more", value));
    return fine;
  }
  void spread(const std::string& where, double value, const PhysicalRange& range) {
    if (spread(where, value)) within(where, value, range);
  }
  void size(const std::string& where, double value, const PhysicalRange& of_tools) {
    if (spread(where, value) && !any_size_) within(where, value, {0, of_tools.most, of_tools.unit, of_tools.slip});
  }
  bool above_zero(const std::string& where, double value, const PhysicalRange& range, const std::string& meaning) {
    if (value > 0 && std::isfinite(value)) return within(where, value, range);
    add(where, "must be a number above 0: " + meaning);
    return false;
  }
  bool sigma(const std::string& where, double value, const PhysicalRange& range) {
    return above_zero(where, value, range, "the standard deviation of what was measured");
  }
  bool within(const std::string& where, double value, const PhysicalRange& range) {
    const bool fine = value >= range.least && value <= range.most;
    const std::string unit = *range.unit == '\0' ? "" : std::string(" ") + range.unit;
    if (!fine)
      add(where, fmt::format("is {:g}{}, which cannot be: {:g} to {:g}{} is possible; {}", value, unit, range.least, range.most, unit, range.slip));
    return fine;
  }
  /// Readers of files make what is nearly so exactly so. What is further off is no rounding: heights above a plane come out longer.
  void unit(const std::string& where, const Vec3& value) {
    constexpr double few_digits = 0.01;
    if (finite(where, value) && std::abs(value.norm() - 1) > few_digits)
      add(where, fmt::format("is a direction: its length must be 1, is {:.4g}; normalise it", value.norm()));
  }
  void rigid(const std::string& where, const Pose& pose) {
    constexpr double few_digits = 0.01;
    if (!finite(where, pose.matrix())) return;
    const Mat3 turn = pose.linear();
    if ((turn.transpose() * turn - Mat3::Identity()).norm() > few_digits || turn.col(0).cross(turn.col(1)).dot(turn.col(2)) < 0)
      add(where, "is no rigid transform; its upper left 3 x 3 part must be a rotation (orthonormal, determinant +1)");
  }
  void friction(const std::string& at, ContactLaw law, double coefficient) {
    if (law == ContactLaw::friction)
      above_zero(at + "friction_coefficient", coefficient, ranges::friction, "Coulomb's, of a contact with friction; choose frictionless where there is none");
    else
      spread(at + "friction_coefficient", coefficient, {0, ranges::friction.most, "", ranges::friction.slip});
  }
  template <typename Boxed>
  void box(const std::string& at, const Boxed& of) {
    const bool low = finite(at + "box_min_m", of.box_min_m), high = finite(at + "box_max_m", of.box_max_m);
    if (low && high && !((of.box_max_m - of.box_min_m).minCoeff() > 0)) add(at + "box_max_m", "must be larger than box_min_m in every axis");
  }
  void check(const Plane& plane, const std::string& at) {
    finite(at + "point_m", plane.point_m);
    unit(at + "normal", plane.normal);
  }

  /// Unknowns and messages go by these names.
  template <typename Named>
  void differ(const std::string& list, const std::vector<Named>& all) {
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (!all[i].name.empty() && all[i].name == all[j].name) return add(fmt::format("{}[{}].name", list, i), fmt::format("'{}' is that of {}[{}] too; names must differ", all[i].name, list, j));
  }

  template <typename Indices>
  void indices(const std::string& where, const Indices& of, Eigen::Index count) {
    if (of.size() > 0 && (of.minCoeff() < 0 || of.maxCoeff() >= count))
      add(where, "names vertices from " + std::to_string(of.minCoeff()) + " to " + std::to_string(of.maxCoeff()) + ", there are " + std::to_string(count));
  }
  template <typename Indices>
  void rest_nodes(const std::string& where, const Indices& of) {
    if (rest_->volume)
      indices(where, of, rest_->volume->nodes_m.rows());
    else if (rest_->surface)
      indices(where, of, rest_->surface->vertices_m.rows());
    else if (of.size() > 0 && !rest_->views.empty())
      add(where, "needs a mesh at rest; with views choose nodes by a plane or a box");
  }
  static Eigen::Map<const Eigen::Matrix<Index, Eigen::Dynamic, 1>> as_array(const std::vector<Index>& list) {
    return {list.data(), static_cast<Eigen::Index>(list.size())};
  }
  void check_surface(const std::string& at, const TriMesh& mesh, const std::string& cure) {
    if (mesh.triangles.rows() == 0) add(at + "triangles", "is empty; " + cure);
    finite(at + "vertices_m", mesh.vertices_m);
    indices(at + "triangles", mesh.triangles, mesh.vertices_m.rows());
  }

  void check(const Environment& environment, double density_kg_m3) {
    const std::string at = "environment.gravity_m_s2";
    if (finite(at, environment.gravity_m_s2)) {
      const double length = environment.gravity_m_s2.norm();
      if (length > 100) add(at, "is more than 100 m/s2; it is in m/s2, [0, 0, -9.81] on earth");
      if (length > 0 && density_kg_m3 == 0) add(at, "acts, but density_kg_m3 is not given; add the object's density, or leave gravity out");
    }
    for (std::size_t i = 0; i < environment.planes.size(); ++i) check(environment.planes[i], "environment.planes[" + std::to_string(i) + "].");
  }

  void check(const Rest& rest) {
    if (!rest.volume && !rest.surface && rest.views.empty()) add("rest", "has no shape; give a surface, a volume, or views of the object");
    if (rest.volume) {
      const Tetrahedra& tetrahedra = rest.volume->tetrahedra;
      finite("rest.volume.nodes_m", rest.volume->nodes_m);
      if (tetrahedra.rows() == 0)
        add("rest.volume.tetrahedra", "is empty; give the shape of the object, or views of it");
      else if (tetrahedra.cols() != 4 && tetrahedra.cols() != 10)
        add("rest.volume.tetrahedra", fmt::format("has {} columns; a tetrahedron has 4 nodes, or 10 with the midpoints of its edges", tetrahedra.cols()));
      else
        indices("rest.volume.tetrahedra", tetrahedra, rest.volume->nodes_m.rows());
    }
    if (rest.surface) check_surface("rest.surface.", *rest.surface, "give the shape of the object, or views of it");
    for (std::size_t v = 0; v < rest.views.size(); ++v) check(rest.views[v], "rest.views[" + std::to_string(v) + "].");
    spread("rest.surface_std_m", rest.surface_std_m, ranges::length_std);
    above_zero("rest.surface_correlation_m", rest.surface_correlation_m, ranges::length_scale, "how far the surface's error goes on alike, in metres");
    if (rest.observed_triangles) rest_nodes("rest.observed_triangles", *rest.observed_triangles);
  }

  void check(const Support& support, const std::string& at) {
    spread(at + "pose_std_m", support.pose_std_m, ranges::length_std);
    spread(at + "pose_std_rad", support.pose_std_rad, ranges::angle_std);
    spread(at + "spread_std_m", support.spread_std_m, ranges::length_std);
    if (support.contact != ContactLaw::bonded && support.spread_std_m > 0)
      add(at + "spread_std_m", "is for a support that is bonded; one that is not slides by itself");
    spread(at + "compliance_m_per_n", support.compliance_m_per_n, ranges::compliance);
    spread(at + "compliance_std_m_per_n", support.compliance_std_m_per_n, ranges::compliance);
    friction(at, support.contact, support.friction_coefficient);
    rest_nodes(at + "vertices", as_array(support.vertices));
    const NodeSelection by = selection_of(support);
    if (by == NodeSelection::box) box(at, support);
    if (by == NodeSelection::box) spread(at + "tolerance_m", support.tolerance_m, ranges::length_std);
    if (by == NodeSelection::plane) check(support.plane, at + "plane.");
    if (by == NodeSelection::plane) above_zero(at + "tolerance_m", support.tolerance_m, ranges::length_sigma, "how far from the plane a node may lie, in metres");
  }

  /// One alone is the whole object, whatever it says.
  void check(const std::vector<Region>& regions) {
    std::set<Index> taken;
    bool points = false, rest = false;
    for (std::size_t i = 0; i < regions.size(); ++i) {
      const Region& region = regions[i];
      const std::string at = "regions[" + std::to_string(i) + "].";
      if (region.name.empty() && regions.size() > 1) add(at + "name", "must not be empty; results name the region by it");
      if (region.select == RegionSelection::box) box(at, region);
      if (region.select == RegionSelection::points) {
        points = true;
        if (region.points_m.rows() == 0) add(at + "points_m", "holds no point; give sites that the region lies around");
        finite(at + "points_m", region.points_m);
      }
      if (region.select == RegionSelection::elements) check_elements(at + "elements", region.elements, taken);
      if (region.select == RegionSelection::rest && std::exchange(rest, true)) add(at + "select", "is 'rest', and another region takes the rest already");
    }
    if (points && rest) add("regions", "around points leave no rest: every element lies nearest to one of the points");
  }

  void check_elements(const std::string& where, const std::vector<Index>& elements, std::set<Index>& taken) {
    if (!rest_->volume) return add(where, "needs a volume at rest; choose the region by a box or by points");
    if (elements.empty()) return add(where, "holds no index; name elements of the volume, or leave the region out");
    const Eigen::Index count = rest_->volume->tetrahedra.rows();
    for (const Index e : elements) {
      if (e < 0 || e >= count) return add(where, fmt::format("names element {}, the volume has {} (indices are 0-based)", e, count));
      if (!taken.insert(e).second) return add(where, fmt::format("names element {}, which was named before; an element has one region", e));
    }
  }

  void check(const Tool& tool, const std::string& at) {
    size(at + "radius_m", tool.radius_m, ranges::tool_radius);
    spread(at + "radius_std_m", tool.radius_std_m, ranges::length_std);
    size(at + "length_m", tool.length_m, ranges::tool_length);
    friction(at, tool.contact, tool.friction_coefficient);
    spread(at + "compliance_m_per_n", tool.compliance_m_per_n, ranges::compliance);
    spread(at + "compliance_std_m_per_n", tool.compliance_std_m_per_n, ranges::compliance);
    const bool round = tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc;
    if (round && tool.radius_m > 0 && tool.radius_std_m > tool.radius_m)
      add(at + "radius_std_m", "is larger than the radius itself; it is a standard deviation in metres");
    if (tool.pressure == Pressure::punch && tool.shape != ToolShape::disc)
      add(at + "pressure", "is that under a disc, whose face is stiff and flat ('punch'); make the tool a disc, or its pressure 'uniform'");
    if (tool.shape == ToolShape::vertices) rest_nodes(at + "vertices", as_array(tool.vertices));
    if (tool.shape == ToolShape::capsule || tool.shape == ToolShape::edge) unit(at + "axis", tool.axis);
    if (tool.shape == ToolShape::platen) check(tool.plane, at + "plane.");
    if (tool.shape != ToolShape::mesh) return;
    if (!tool.mesh) return add(at + "mesh", "is not given; a tool of this shape is made of triangles");
    check_surface(at + "mesh.", *tool.mesh, "give the tool's triangles, or another shape");
  }

  void check(const Load& load, const std::string& at) {
    known(at + "tool", load.tool);
    if (!load.force_n && !load.travel_m) add(at + "force_n", "is not given, and travel_m neither; one of the two acts on the object");
    if (load.force_n && load.travel_m)
      add(at + "travel_m", "and force_n are both given; one is imposed, and what the other was is an observation (a ToolTravel or a Wrench)");
    if (load.force_n && finite(at + "force_n", *load.force_n) && load.force_n->norm() > 0) can_press(at + "force_n", load);
    if (load.travel_m) finite(at + "travel_m", *load.travel_m);
    spread(at + "force_std_n", load.force_std_n, ranges::force_std);
    spread(at + "force_relative_std", load.force_relative_std, ranges::share_std);
    spread(at + "contact_std_m", load.contact_std_m, ranges::length_std);
    if (finite(at + "force_rate_n_s", load.force_rate_n_s) && !load.force_n && !load.force_rate_n_s.isZero(0))
      add(at + "force_rate_n_s", "belongs to a force that is given, and force_n is not; leave the rate out");
    finite(at + "contact_m", load.contact_m);
    if (finite(at + "direction", load.direction) && !(load.direction.norm() > 1e-9)) add(at + "direction", "has no length; it is the unit vector of the push");
  }

  /// A body that is moved starts from one place, along one line.
  void one_place(const Push& push, const Step& step, const std::vector<Tool>& tools, const std::string& at) {
    constexpr double same_m = 1e-4, of_radius = 0.05, same_rad = 0.02;
    for (std::size_t l = 0; l < step.loads.size(); ++l) {
      const Load& load = step.loads[l];
      const auto tool = std::find_if(tools.begin(), tools.end(), [&](const Tool& one) { return one.name == load.tool; });
      if (!load.travel_m || tool == tools.end() || tool->shape == ToolShape::vertices || tool->shape == ToolShape::platen) continue;
      const Load* first = nullptr;
      for (const Step& before : push.steps)
        for (const Load& one : before.loads)
          if (first == nullptr && one.travel_m && one.tool == load.tool) first = &one;
      const std::string place = at + "loads[" + std::to_string(l) + "].";
      const std::string cure = "than where push '" + push.name + "' moved '" + load.tool + "' first; a tool that is moved goes along one line a push: make another push of it";
      if ((load.contact_m - first->contact_m).norm() > std::max(same_m, of_radius * tool->radius_m)) add(place + "contact_m", "is elsewhere " + cure);
      if ((load.direction.normalized() - first->direction.normalized()).norm() > same_rad) add(place + "direction", "is another one " + cure);
    }
  }

  /// A force needs a patch that it is spread over; said here, and not once a mesh was made.
  void can_press(const std::string& where, const Load& load) {
    for (const Tool& tool : *tools_) {
      if (tool.name == load.tool && (tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc) && tool.radius_m == 0)
        add(where, "acts on '" + tool.name + "', whose radius_m is " + fmt::format("{:g}", tool.radius_m) + "; give the radius of what it presses, in metres");
      if (tool.name != load.tool || (tool.shape != ToolShape::platen && tool.shape != ToolShape::mesh)) continue;
      add(where, "acts on '" + tool.name + "', which has no patch that a force is spread over: give its motion (travel_m), and the force as what was observed (a wrench)" +
                     (tool.shape == ToolShape::mesh ? "; or describe the patch that it presses by a disc" : ""));
    }
  }

  void check(const DepthFrame& frame, const std::string& at) {
    finite(at + "time_s", frame.time_s);
    rigid(at + "T_base_camera", frame.T_base_camera);
    spread(at + "pose_std_m", frame.pose_std_m, ranges::length_std);
    spread(at + "pose_std_rad", frame.pose_std_rad, ranges::angle_std);
    const Camera& camera = frame.camera;
    check(camera, at + "camera");
    if (frame.noise.model == "constant" && !std::isnan(frame.noise.sigma_m)) sigma(at + "noise.sigma_m", frame.noise.sigma_m, ranges::length_sigma);
    spread(at + "noise.bias_std_m", frame.noise.bias_std_m, ranges::length_std);
    spread(at + "noise.shared_std_m", frame.noise.shared_std_m, ranges::length_std);
    if (!std::isnan(frame.noise.lens_scatter_std)) spread(at + "noise.lens_scatter_std", frame.noise.lens_scatter_std, ranges::share_std);
    const auto size_of = [](const auto& image) { return std::to_string(image.cols()) + " x " + std::to_string(image.rows()); };
    if (frame.depth_m.cols() != camera.width_px || frame.depth_m.rows() != camera.height_px)
      add(at + "depth_m", "is " + size_of(frame.depth_m) + " pixels, its camera has " + std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px));
    else if (frame.mask.size() > 0 && (frame.mask.cols() != frame.depth_m.cols() || frame.mask.rows() != frame.depth_m.rows()))
      add(at + "mask", "is " + size_of(frame.mask) + " pixels, the image " + size_of(frame.depth_m));
  }
  void check(const Camera& camera, const std::string& at) {
    const bool pinhole = camera.fx_px > 0 && camera.fy_px > 0 && std::isfinite(camera.fx_px + camera.fy_px + camera.cx_px + camera.cy_px);
    if (!pinhole) add(at, "fx_px and fy_px must be above 0, cx_px and cy_px finite");
    const auto of_size = [&](const char* field, double value, int size_px, double middle_px, const PhysicalRange& share) {
      within(at + "." + field, value, {middle_px + share.least * size_px, middle_px + share.most * size_px, "px", share.slip});
    };
    if (pinhole && camera.width_px > 0 && camera.height_px > 0) {
      of_size("fx_px", camera.fx_px, camera.width_px, 0, ranges::focal_over_width);
      of_size("fy_px", camera.fy_px, camera.height_px, 0, ranges::focal_over_width);
      of_size("cx_px", camera.cx_px, camera.width_px, 0.5 * camera.width_px, ranges::centre_over_width);
      of_size("cy_px", camera.cy_px, camera.height_px, 0.5 * camera.height_px, ranges::centre_over_width);
    }
    const std::size_t given = camera.distortion_coefficients.size();
    const bool fits = camera.distortion == DistortionModel::none        ? given == 0
                      : camera.distortion == DistortionModel::plumb_bob ? given == 4 || given == 5
                      : camera.distortion == DistortionModel::rational  ? given == 8
                                                                        : given == 4;
    if (!fits) add(at + ".distortion_coefficients", fmt::format("has {} numbers; plumb_bob has 4 or 5, rational 8, fisheye 4, none 0", given));
    for (const double one : camera.distortion_coefficients)
      if (!finite(at + ".distortion_coefficients", one)) break;
  }
  void check(const PointCloud& cloud, const std::string& at) {
    const Eigen::Index points = cloud.points_m.rows();
    if (points == 0) add(at + "points_m", "is empty; leave out a cloud that shows nothing");
    if (cloud.normals.rows() != 0 && cloud.normals.rows() != points)
      add(at + "normals", "has " + std::to_string(cloud.normals.rows()) + " rows for " + std::to_string(points) + " points");
    if (points > 0 && cloud.sigma_m.size() != 1 && cloud.sigma_m.size() != points)
      add(at + "sigma_m", "has " + std::to_string(cloud.sigma_m.size()) + " values; give one, or one a point (" + std::to_string(points) + ")");
    finite(at + "points_m", cloud.points_m);
    spread(at + "pose_std_m", cloud.pose_std_m, ranges::length_std);
    spread(at + "pose_std_rad", cloud.pose_std_rad, ranges::angle_std);
    for (const double one : cloud.sigma_m)
      if (!sigma(at + "sigma_m", one, ranges::length_sigma)) break;
  }
  void check(const Markers& markers, const std::string& at) {
    sigma(at + "sigma_m", markers.sigma_m, ranges::length_sigma);
    spread(at + "rest_std_m", markers.rest_std_m, ranges::length_std);
    if (markers.rest_m.array().isInf().any()) add(at + "rest_m", "holds infinity; what is not known is NaN");
    if (markers.observed_m.array().isInf().any()) add(at + "observed_m", "holds infinity; what is hidden is NaN");
    std::set<std::string> known;
    for (const std::string& name : markers.names)
      if (!known.insert(name).second) {
        add(at + "names", fmt::format("'{}' is there twice; names must differ", name));
        break;
      }
    const auto names = static_cast<Eigen::Index>(markers.names.size()), rows = static_cast<Eigen::Index>(markers.observed_m.rows());
    if (markers.rest_m.rows() != rows || (names != 0 && names != rows))
      add(at + "observed_m", "has " + std::to_string(rows) + " rows, rest_m " + std::to_string(markers.rest_m.rows()) + " and names " + std::to_string(names) +
                                 "; each marker has one in each (names may be left out)");
  }
  void check(const ToolTravel& travel, const std::string& at) {
    if (!travel.tool.empty()) known(at + "tool", travel.tool);
    finite(at + "travel_m", travel.travel_m);
    sigma(at + "sigma_m", travel.sigma_m, ranges::length_sigma);
  }
  void check(const Wrench& wrench, const std::string& at) {
    if (!wrench.tool.empty()) known(at + "tool", wrench.tool);
    finite(at + "time_s", wrench.time_s);
    finite(at + "force_n", wrench.force_n);
    if (!wrench.along.isZero(0)) unit(at + "along", wrench.along);
    sigma(at + "force_sigma_n", wrench.force_sigma_n, ranges::force_sigma);
    if (!wrench.has_torque) return;
    finite(at + "torque_nm", wrench.torque_nm);
    sigma(at + "torque_sigma_nm", wrench.torque_sigma_nm, ranges::torque_sigma);
  }

  static std::string names_of(const std::vector<Tool>& tools) {
    std::string names;
    for (const Tool& tool : tools) names += (names.empty() ? "" : ", ") + tool.name;
    return names;
  }
  void known(const std::string& where, const std::string& name) {
    const auto is_it = [&](const Tool& tool) { return tool.name == name; };
    if (std::none_of(tools_->begin(), tools_->end(), is_it))
      add(where, fmt::format("'{}' is no tool of this recording; {}", name, tools_->empty() ? "it has none" : "they are " + names_of(*tools_)));
  }

  const std::vector<Tool>* tools_ = nullptr;
  const Rest* rest_ = nullptr;
  bool any_size_ = false;
  std::vector<WrongValue> found_;
};

}  // namespace

NodeSelection selection_of(const Support& support) {
  switch (support.kind) {
    case SupportKind::vertices: return NodeSelection::vertices;
    case SupportKind::box: return NodeSelection::box;
    case SupportKind::plane:
    case SupportKind::table:
    case SupportKind::wall: return NodeSelection::plane;
    case SupportKind::clamp: break;
  }
  if (support.select != NodeSelection::vertices || !support.vertices.empty()) return support.select;
  const Vec3 size_m = support.box_max_m - support.box_min_m;
  return size_m.minCoeff() >= 0 && size_m.norm() > 0 ? NodeSelection::box : NodeSelection::plane;
}

Vec3 unit_direction(const Vec3& direction) {
  constexpr double rounding = 1e-12;
  return std::abs(direction.norm() - 1) > rounding ? Vec3(direction.normalized()) : direction;
}

std::vector<WrongValue> wrong_values(const Recording& recording) {
  ValueChecker checker;
  checker.check(recording);
  return std::move(checker).found();
}

std::vector<WrongValue> wrong_values(const Step& step, const std::vector<Tool>& tools, const std::string& place) {
  ValueChecker checker;
  checker.check(step, tools, place);
  return std::move(checker).found();
}

void demand_depth_sigma(const DepthNoise& noise, const std::string& place) {
  if (noise.model == "constant" && std::isnan(noise.sigma_m))
    throw Error("is not given; state the standard deviation of the depth in metres, or name a sensor as noise.model", place + ": noise.sigma_m");
}

void demand_right_values(const std::vector<WrongValue>& wrong) {
  if (wrong.empty()) return;
  const std::string more = wrong.size() > 1 ? " (" + std::to_string(wrong.size() - 1) + " more are wrong)" : "";
  throw Error(wrong.front().what + more, wrong.front().where);
}

void demand_loads(const Recording& recording) {
  if (recording.rest.state == RestState::stress_free && recording.environment.gravity_m_s2.norm() > 0) return;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      for (const Load& load : step.loads)
        if ((load.force_n && load.force_n->norm() > 0) || load.travel_m.value_or(0) != 0) return;
  throw Error("no step has a force_n or travel_m other than zero, so nothing deforms the object: give what the robot pressed "
              "with, or the weight that acts on a stress-free shape (gravity_m_s2, density_kg_m3)", "pushes.steps.loads");
}

}  // namespace palpate
