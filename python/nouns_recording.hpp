// SPDX-License-Identifier: Apache-2.0
// What a robot recorded, as Python sees it: palpate/core/recording.hpp and mesh.hpp, field by field.
#pragma once

#include "palpate/core/recording.hpp"
#include "palpate/io/recording_names.hpp"
#include "python/convert.hpp"

namespace palpate::python {

// clang-format off
template <> struct Words<RestState> { static constexpr auto& names = io::rest_state_names; };
template <> struct Words<SupportKind> { static constexpr auto& names = io::support_names; };
template <> struct Words<ContactLaw> { static constexpr auto& names = io::contact_names; };
template <> struct Words<PoseVaries> { static constexpr auto& names = io::pose_varies_names; };
template <> struct Words<RegionSelection> { static constexpr auto& names = io::region_names; };
template <> struct Words<Pressure> { static constexpr auto& names = io::pressure_names; };
template <> struct Words<ToolShape> { static constexpr auto& names = io::tool_names; };
template <> struct Words<DistortionModel> { static constexpr auto& names = io::distortion_names; };

inline constexpr io::Names<NodeSelection, 3> node_selection_names = {
    {{"vertices", NodeSelection::vertices}, {"plane", NodeSelection::plane}, {"box", NodeSelection::box}}};
template <> struct Words<NodeSelection> { static constexpr auto& names = node_selection_names; };
inline constexpr io::Names<RobotShape::Kind, 4> shape_names = {
    {{"mesh", RobotShape::Kind::mesh}, {"box", RobotShape::Kind::box}, {"cylinder", RobotShape::Kind::cylinder}, {"sphere", RobotShape::Kind::sphere}}};
template <> struct Words<RobotShape::Kind> { static constexpr auto& names = shape_names; };
inline constexpr io::Names<RobotJoint::Kind, 4> joint_names = {
    {{"revolute", RobotJoint::Kind::revolute}, {"continuous", RobotJoint::Kind::continuous}, {"prismatic", RobotJoint::Kind::prismatic}, {"fixed", RobotJoint::Kind::fixed}}};
template <> struct Words<RobotJoint::Kind> { static constexpr auto& names = joint_names; };
// clang-format on

template <>
struct Noun<TriMesh> {
  static constexpr const char *name = "TriMesh", *about = "A surface.";
  static void fields(auto&& field) {
    field("vertices_m", &TriMesh::vertices_m, "");
    field("triangles", &TriMesh::triangles, "counter-clockwise seen from outside");
  }
};

template <>
struct Noun<TetMesh> {
  static constexpr const char *name = "TetMesh", *about = "A volume.";
  static void fields(auto&& field) {
    field("nodes_m", &TetMesh::nodes_m, "");
    field("tetrahedra", &TetMesh::tetrahedra, "4 columns (linear), or 10 (corners 0 to 3, then the midpoints of 01, 12, 02, 03, 13, 23); det(x1 - x0, x2 - x0, x3 - x0) > 0");
  }
};

template <>
struct Noun<Plane> {
  static constexpr const char *name = "Plane", *about = "A table or a wall.";
  static void fields(auto&& field) {
    field("point_m", &Plane::point_m, "");
    field("normal", &Plane::normal, "unit length, away from the solid half space, into the object's side");
  }
};

template <>
struct Noun<Camera> {
  static constexpr const char *name = "Camera", *about = "Pinhole camera, pixel centres at whole numbers, z forward, x right, y down.";
  static void fields(auto&& field) {
    field("width_px", &Camera::width_px, "");
    field("height_px", &Camera::height_px, "");
    field("fx_px", &Camera::fx_px, "");
    field("fy_px", &Camera::fy_px, "");
    field("cx_px", &Camera::cx_px, "");
    field("cy_px", &Camera::cy_px, "");
    field("distortion", &Camera::distortion, "'none', 'plumb_bob', 'rational' or 'fisheye'");
    field("distortion_coefficients", &Camera::distortion_coefficients, "in the order of ROS's CameraInfo.d");
  }
};

template <>
struct Noun<DepthNoise> {
  static constexpr const char *name = "DepthNoise", *about = "Standard deviation of a depth sensor along the optical axis.";
  static void fields(auto&& field) {
    field("model", &DepthNoise::model, "one of palpate.depth_sensors(), or 'constant'");
    field("sigma_m", &DepthNoise::sigma_m, "of 'constant'");
    field("bias_std_m", &DepthNoise::bias_std_m, "prior of one common depth offset a push and camera (0: none)");
    field("shared_std_m", &DepthNoise::shared_std_m, "error that neighbouring pixels share, beside the model's own");
    field("lens_scatter_std", &DepthNoise::lens_scatter_std, "prior on the share of the picture's light that the lens spreads over every pixel (time of flight); nan: the model's");
  }
};

template <>
struct Noun<DepthFrame> {
  static constexpr const char *name = "DepthFrame", *about = "A depth image.";
  static void fields(auto&& field) {
    field("time_s", &DepthFrame::time_s, "");
    field("camera", &DepthFrame::camera, "");
    field("T_base_camera", &DepthFrame::T_base_camera, "maps the camera's coordinates into the base frame");
    field("pose_std_m", &DepthFrame::pose_std_m, "prior on the camera's pose, per frame");
    field("pose_std_rad", &DepthFrame::pose_std_rad, "");
    field("depth_m", &DepthFrame::depth_m, "rows x columns, along the optical axis; 0: no data");
    field("mask", &DepthFrame::mask, "empty, or 1 where a pixel is not to be used (robot, table, ...)");
    field("robot_is_masked", &DepthFrame::robot_is_masked, "the mask holds what there is of the robot; else its model and joints say it");
    field("noise", &DepthFrame::noise, "");
  }
};

template <>
struct Noun<PointCloud> {
  static constexpr const char *name = "PointCloud", *about = "Points on the surface, base frame.";
  static void fields(auto&& field) {
    field("points_m", &PointCloud::points_m, "");
    field("normals", &PointCloud::normals, "0 x 3: unknown");
    field("sigma_m", &PointCloud::sigma_m, "of one number for all, or one a point: standard deviation per axis");
    field("pose_std_m", &PointCloud::pose_std_m, "prior on the cloud's pose, per frame");
    field("pose_std_rad", &PointCloud::pose_std_rad, "");
    field("camera", &PointCloud::camera, "whose pose error it shares with other clouds; none: the clouds of the same number in their steps");
  }
};

template <>
struct Noun<Markers> {
  static constexpr const char *name = "Markers", *about = "Markers fixed to the nearest patch of the surface; they may stand off it.";
  static void fields(auto&& field) {
    field("names", &Markers::names, "");
    field("rest_m", &Markers::rest_m, "on the object at rest; nan rows: unknown");
    field("observed_m", &Markers::observed_m, "base frame; nan rows: hidden");
    field("sigma_m", &Markers::sigma_m, "of one observation, per axis");
    field("rest_std_m", &Markers::rest_std_m, "prior on each rest position, per axis, shared by all steps");
  }
};

template <>
struct Noun<ToolTravel> {
  static constexpr const char *name = "ToolTravel", *about = "How far the tool went, by the arm's encoders.";
  static void fields(auto&& field) {
    field("tool", &ToolTravel::tool, "a name of Recording.tools; '': the step's only one");
    field("travel_m", &ToolTravel::travel_m, "along the push, into the object positive, from first contact");
    field("sigma_m", &ToolTravel::sigma_m, "");
  }
};

template <>
struct Noun<Wrench> {
  static constexpr const char *name = "Wrench", *about = "Of the tool on the object, base frame, at the tip.";
  static void fields(auto&& field) {
    field("time_s", &Wrench::time_s, "");
    field("force_n", &Wrench::force_n, "");
    field("torque_nm", &Wrench::torque_nm, "");
    field("force_sigma_n", &Wrench::force_sigma_n, "");
    field("torque_sigma_nm", &Wrench::torque_sigma_nm, "");
    field("has_torque", &Wrench::has_torque, "");
    field("tool", &Wrench::tool, "a name of Recording.tools; '': the step's only one");
    field("along", &Wrench::along, "single-axis cell: only what lies along this unit vector was measured; zero: all three");
  }
};

template <>
struct Noun<Tool> {
  static constexpr const char *name = "Tool", *about = "What presses on the object.";
  static void fields(auto&& field) {
    field("name", &Tool::name, "");
    field("shape", &Tool::shape, "'sphere', 'disc', 'capsule', 'edge', 'mesh', 'platen' or 'vertices'");
    field("radius_m", &Tool::radius_m, "sphere, disc, capsule; edge: half width of its strip");
    field("radius_std_m", &Tool::radius_std_m, "sphere, disc: prior on the radius of the patch that its force acts on; 0: exactly known");
    field("pressure", &Tool::pressure, "disc: 'uniform' (a soft pad) or 'punch' (a stiff flat face)");
    field("length_m", &Tool::length_m, "capsule, edge");
    field("mesh", &Tool::mesh, "");
    field("vertices", &Tool::vertices, "of 'vertices': 0-based nodes that the force is spread over equally");
    field("plane", &Tool::plane, "of a platen: its face at rest, normal into the object");
    field("axis", &Tool::axis, "capsule, edge: unit direction of its length, base frame");
    field("contact", &Tool::contact, "'bonded', 'frictionless' or 'friction'");
    field("friction_coefficient", &Tool::friction_coefficient, "");
    field("compliance_m_per_n", &Tool::compliance_m_per_n, "of stick and arm between encoder and tip");
    field("compliance_std_m_per_n", &Tool::compliance_std_m_per_n, "0: exactly known");
  }
};

template <>
struct Noun<Support> {
  static constexpr const char *name = "Support", *about = "How the object is held.";
  static void fields(auto&& field) {
    field("kind", &Support::kind, "'table', 'wall', 'clamp', 'plane', 'box' or 'vertices'");
    field("select", &Support::select, "clamp: where it touches, 'plane', 'box' or 'vertices'");
    field("vertices", &Support::vertices, "0-based nodes of the mesh at rest");
    field("plane", &Support::plane, "");
    field("box_min_m", &Support::box_min_m, "");
    field("box_max_m", &Support::box_max_m, "");
    field("tolerance_m", &Support::tolerance_m, "");
    field("contact", &Support::contact, "'bonded', 'frictionless' or 'friction'");
    field("friction_coefficient", &Support::friction_coefficient, "");
    field("pose_std_m", &Support::pose_std_m, "clamp: prior on its translation; 0: exactly known");
    field("pose_std_rad", &Support::pose_std_rad, "");
    field("spread_std_m", &Support::spread_std_m, "flat and bonded: prior on how far its rim slides outwards at the highest load");
    field("compliance_m_per_n", &Support::compliance_m_per_n, "how far it gives way as a whole, per newton of the loads");
    field("compliance_std_m_per_n", &Support::compliance_std_m_per_n, "0: exactly known");
    field("pose_varies", &Support::pose_varies, "clamp: 'never', 'push' or 'step'");
    field("name", &Support::name, "");
    field("source", &Support::source, "for messages");
  }
};

template <>
struct Noun<Load> {
  static constexpr const char *name = "Load", *about = "What acts on the object in one step: a force or a motion.";
  static void fields(auto&& field) {
    field("tool", &Load::tool, "a name of Recording.tools");
    field("force_n", &Load::force_n, "resultant on the object, base frame");
    field("force_std_n", &Load::force_std_n, "absolute part of its prior standard deviation, per axis");
    field("force_relative_std", &Load::force_relative_std, "relative part, independent from step to step (0.02: 2 %)");
    field("force_rate_n_s", &Load::force_rate_n_s, "how fast force_n was changing when the step was seen; zero once it has settled");
    field("travel_m", &Load::travel_m, "motion imposed along the direction");
    field("contact_m", &Load::contact_m, "on the surface at rest (tools that are not 'vertices' or 'platen')");
    field("direction", &Load::direction, "unit vector of the push, into the object; not given: that of force_n as it was when this was made, down where there is none");
    field("contact_std_m", &Load::contact_std_m, "prior on the contact point, tangential");
    field("contact_found_m", &Load::contact_found_m, "from contact_m, across the push: a fit's own");
  }
};

template <>
struct Noun<Step> {
  static constexpr const char *name = "Step", *about = "One state of the object: what acts, and what the sensors saw.";
  static void fields(auto&& field) {
    field("time_s", &Step::time_s, "");
    field("loads", &Step::loads, "empty: nothing acts, a step like any other");
    field("T_base_tip", &Step::T_base_tip, "");
    field("joints_rad", &Step::joints_rad, "in the order of Recording.joint_names");
    field("observations", &Step::observations, "");
    field("unloading", &Step::unloading, "recorded while the tool was going back");
    field("slipped", &Step::slipped, "since the step before, the tool slid over the object");
    field("source", &Step::source, "for messages");
  }
};

template <>
struct Noun<Push> {
  static constexpr const char *name = "Push", *about = "Steps of one push, in order.";
  static void fields(auto&& field) {
    field("name", &Push::name, "");
    field("site", &Push::site, "e.g. 'head'; '': by where it presses");
    field("force_tare_std_n", &Push::force_tare_std_n, "prior of a constant force error in this push, per axis (0: none)");
    field("travel_offset_std_m", &Push::travel_offset_std_m, "prior of the travel's zero: where contact really began (0: exactly known)");
    field("torque_tare_std_nm", &Push::torque_tare_std_nm, "prior of a constant torque error in this push, per axis (0: none)");
    field("tip_std_m", &Push::tip_std_m, "prior of where the tip is against the object, across the push (0: exactly known)");
    field("steps", &Push::steps, "");
  }
};

template <>
struct Noun<Environment> {
  static constexpr const char *name = "Environment", *about = "What surrounds the object.";
  static void fields(auto&& field) {
    field("gravity_m_s2", &Environment::gravity_m_s2, "");
    field("planes", &Environment::planes, "table and walls");
  }
};

template <>
struct Noun<ModelDefaults> {
  static constexpr const char *name = "ModelDefaults", *about = "How the object is to be simulated.";
  static void fields(auto&& field) {
    field("mesh", &ModelDefaults::mesh, "'as_given', 'remeshed' or 'auto'");
    field("element", &ModelDefaults::element, "'tet4', 'tet10' or 'auto'");
    field("refine", &ModelDefaults::refine, "'none' or 'auto'");
    field("material", &ModelDefaults::material, "one of palpate.materials()");
    field("poisson_lower", &ModelDefaults::poisson_lower, "of the uniform prior on nu");
    field("poisson_upper", &ModelDefaults::poisson_upper, "");
    field("poisson_fixed", &ModelDefaults::poisson_fixed, "nu where it is known");
    field("poisson_by_region", &ModelDefaults::poisson_by_region, "every region has its own nu; else they share one");
  }
};

template <>
struct Noun<Rest> {
  static constexpr const char *name = "Rest", *about = "The object before it was touched: exactly one of volume, surface and views.";
  static void fields(auto&& field) {
    field("volume", &Rest::volume, "");
    field("surface", &Rest::surface, "closed; it is filled with tetrahedra");
    field("views", &Rest::views, "depth images of it; it is reconstructed");
    field("state", &Rest::state, "'stress_free', 'under_gravity' or 'under_pressure'");
    field("surface_std_m", &Rest::surface_std_m, "slow error of the surface (correlated)");
    field("surface_correlation_m", &Rest::surface_correlation_m, "");
    field("observed_triangles", &Rest::observed_triangles, "the part of the boundary that sensors saw, by node index");
    field("source", &Rest::source, "for messages");
  }
};

template <>
struct Noun<RobotShape> {
  static constexpr const char *name = "RobotShape", *about = "A shape of a link.";
  static void fields(auto&& field) {
    field("kind", &RobotShape::kind, "'mesh', 'box', 'cylinder' or 'sphere'");
    field("T_link_shape", &RobotShape::T_link_shape, "");
    field("mesh", &RobotShape::mesh, "");
    field("size_m", &RobotShape::size_m, "box: edges; cylinder: radius, length; sphere: radius");
  }
};

template <>
struct Noun<RobotLink> {
  static constexpr const char *name = "RobotLink", *about = "A link of a robot.";
  static void fields(auto&& field) {
    field("name", &RobotLink::name, "");
    field("visual", &RobotLink::visual, "");
    field("collision", &RobotLink::collision, "");
  }
};

template <>
struct Noun<RobotJoint> {
  static constexpr const char *name = "RobotJoint", *about = "A joint of a robot.";
  static void fields(auto&& field) {
    field("kind", &RobotJoint::kind, "'revolute', 'continuous', 'prismatic' or 'fixed'");
    field("name", &RobotJoint::name, "");
    field("parent", &RobotJoint::parent, "");
    field("child", &RobotJoint::child, "");
    field("T_parent_joint", &RobotJoint::T_parent_joint, "");
    field("axis", &RobotJoint::axis, "");
    field("lower", &RobotJoint::lower, "rad or m");
    field("upper", &RobotJoint::upper, "");
    field("velocity", &RobotJoint::velocity, "rad/s or m/s");
    field("mimic", &RobotJoint::mimic, "a joint's name; '': none");
    field("mimic_multiplier", &RobotJoint::mimic_multiplier, "");
    field("mimic_offset", &RobotJoint::mimic_offset, "");
  }
};

template <>
struct Noun<RobotModel> {
  static constexpr const char *name = "RobotModel", *about = "What a URDF says of a robot; palpate.read_robot(path) reads one.";
  static void fields(auto&& field) {
    field("name", &RobotModel::name, "");
    field("links", &RobotModel::links, "");
    field("joints", &RobotModel::joints, "");
  }
};

template <>
struct Noun<Region> {
  static constexpr const char *name = "Region", *about = "A part of the object with a stiffness of its own.";
  static void fields(auto&& field) {
    field("name", &Region::name, "");
    field("select", &Region::select, "'box', 'points', 'elements' or 'rest' (what no other takes)");
    field("box_min_m", &Region::box_min_m, "in the frame of the mesh at rest");
    field("box_max_m", &Region::box_max_m, "");
    field("points_m", &Region::points_m, "sites that the region lies around");
    field("elements", &Region::elements, "rows of Rest.volume.tetrahedra");
    field("source", &Region::source, "for messages");
  }
};

template <>
struct Noun<Recording> {
  static constexpr const char *name = "Recording", *about = "An object, what held and pushed it, and what the sensors saw. SI units, base frame.";
  static void fields(auto&& field) {
    field("name", &Recording::name, "");
    field("description", &Recording::description, "source, licence, how to cite");
    field("robot", &Recording::robot, "");
    field("joint_names", &Recording::joint_names, "order of Step.joints_rad");
    field("tools", &Recording::tools, "");
    field("environment", &Recording::environment, "");
    field("rest", &Recording::rest, "");
    field("accept_size", &Recording::accept_size, "lets an object smaller than 1 mm or larger than 10 m pass");
    field("supports", &Recording::supports, "");
    field("free", &Recording::free, "nothing holds the object");
    field("regions", &Recording::regions, "empty: one stiffness everywhere");
    field("density_kg_m3", &Recording::density_kg_m3, "0: unknown and not needed");
    field("density_std_kg_m3", &Recording::density_std_kg_m3, "");
    field("force_scale_std", &Recording::force_scale_std, "prior of the force sensor's common scale error (0.01: 1 %)");
    field("force_cross_talk_std", &Recording::force_cross_talk_std, "of what it reads across a push, over the force along it");
    field("time_offset_std_s", &Recording::time_offset_std_s, "prior of what is left between the clocks of force and camera");
    field("model", &Recording::model, "");
    field("pushes", &Recording::pushes, "");
    field("source", &Recording::source, "path it was read from");
    field("input_hashes", &Recording::input_hashes, "file: SHA-256");
    field("warnings", &Recording::warnings, "");
  }
};

}  // namespace palpate::python
