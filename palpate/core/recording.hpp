// SPDX-License-Identifier: Apache-2.0
// What a robot recorded, whatever file it came from. docs/recording-format.md says how it looks on disk; docs/conventions.md
// defines every frame and sign. Forces are those of the tool on the object, in the base frame, at the tip.
#pragma once

#include <limits>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate {

enum class DistortionModel { none, plumb_bob, rational, fisheye };

/// Pinhole camera, pixel centres at whole numbers, z forward, x right, y down.
struct Camera {
  int width_px = 0, height_px = 0;
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
  DistortionModel distortion = DistortionModel::none;
  std::vector<double> distortion_coefficients;
  bool operator==(const Camera&) const = default;
};

/// Standard deviation of a depth sensor along the optical axis: a row of the table in `sensing` (by name) or `constant`.
struct DepthNoise {
  std::string model = "constant";
  double sigma_m = std::numeric_limits<double>::quiet_NaN();  ///< of `constant`; NaN = not given
  double bias_std_m = 0.0;                                    ///< prior of one common depth offset a push and camera (0 = none)
  double shared_std_m = 0.0;                                  ///< error that neighbouring pixels share, beside the model's own
  /// Prior on the share of the picture's light that the lens spreads over every pixel (time of flight); NaN = the model's
  double lens_scatter_std = std::numeric_limits<double>::quiet_NaN();

  bool operator==(const DepthNoise& other) const {
    const auto same = [](double a, double b) { return a == b || (a != a && b != b); };
    return model == other.model && same(sigma_m, other.sigma_m) && bias_std_m == other.bias_std_m &&
           shared_std_m == other.shared_std_m && same(lens_scatter_std, other.lens_scatter_std);
  }
};

struct DepthFrame {
  double time_s = 0;
  Camera camera;
  Pose T_base_camera = Pose::Identity();
  double pose_std_m = 0, pose_std_rad = 0;  ///< prior on the camera's pose, per frame
  DepthImage depth_m;
  MaskImage mask;  ///< empty, or 1 where a pixel is invalid (robot, table, ...)
  bool robot_is_masked = false;  ///< the mask holds what there is of the robot to be masked; else its model and joints say it
  DepthNoise noise;
};

struct PointCloud {
  Points points_m;
  Points normals;                           ///< 0 x 3 where unknown
  VectorX sigma_m;                          ///< size 1 (common) or N: standard deviation per axis
  double pose_std_m = 0, pose_std_rad = 0;  ///< prior on the cloud's pose, per frame
  std::string camera;                       ///< whose pose error clouds share; empty: that of the same number in their step
};

/// Depth measurements as rays, what the likelihood along the camera ray works on.
struct RayCloud {
  Points origins_m;
  Points directions;  ///< unit length
  VectorX range_m;
  VectorX sigma_m;  ///< along the ray
  Eigen::Matrix<Index, Eigen::Dynamic, 2, Eigen::RowMajor> pixel;
};

/// Markers attached rigidly to the nearest patch of the surface; they may stand off it.
struct Markers {
  std::vector<std::string> names;
  Points rest_m;      ///< position in the object's rest frame; NaN rows where unknown
  Points observed_m;  ///< base frame; NaN rows where hidden
  double sigma_m = std::numeric_limits<double>::quiet_NaN();  ///< of one observation, per axis
  double rest_std_m = 0.0;                                    ///< prior on each rest position, per axis, shared by all steps
};

struct ToolTravel {
  std::string tool;     ///< name in Recording::tools; empty = the step's only one
  double travel_m = 0;  ///< along the tool's direction, into the object positive, from first contact
  double sigma_m = std::numeric_limits<double>::quiet_NaN();
};

/// Of the tool on the object, base frame, at the tip.
struct Wrench {
  double time_s = 0;
  Vec3 force_n = Vec3::Zero();
  Vec3 torque_nm = Vec3::Zero();
  double force_sigma_n = std::numeric_limits<double>::quiet_NaN();
  double torque_sigma_nm = std::numeric_limits<double>::quiet_NaN();
  bool has_torque = false;
  std::string tool;           ///< name in Recording::tools; empty = the step's only one
  Vec3 along = Vec3::Zero();  ///< single-axis cell: only the component along this unit vector was measured; zero = all three
};

using Observation = std::variant<DepthFrame, PointCloud, Markers, ToolTravel, Wrench>;

enum class ToolShape { vertices, sphere, disc, capsule, edge, mesh, platen };

/// How a measured force is spread over the patch of a disc: by a soft pad evenly, by a stiff flat face as under a punch.
enum class Pressure { uniform, punch };

struct Tool {
  std::string name;
  ToolShape shape = ToolShape::sphere;
  double radius_m = 0;  ///< sphere, disc, capsule; edge: half width of its contact strip
  double radius_std_m = 0;  ///< sphere, disc: prior on the radius of the patch that its force acts on; 0 = exactly known
  Pressure pressure = Pressure::uniform;  ///< disc whose force is given
  double length_m = 0;  ///< capsule, edge
  std::optional<TriMesh> mesh;
  std::vector<Index> vertices;  ///< ToolShape::vertices: 0-based nodes that the force is spread over equally
  Plane plane;                  ///< ToolShape::platen: its face at rest, normal = direction into the object
  Vec3 axis = Vec3::UnitX();    ///< capsule, edge: unit direction of its length, base frame
  ContactLaw contact = ContactLaw::bonded;
  double friction_coefficient = 0;
  double compliance_m_per_n = 0;  ///< of stick and arm between encoder and tip
  double compliance_std_m_per_n = 0;  ///< its prior standard deviation; 0 = exactly known
};

/// What acts on the object in one step. Either the force is imposed (measured) or the motion is.
struct Load {
  std::string tool;                 ///< name in Recording::tools
  std::optional<Vec3> force_n;      ///< resultant on the object, base frame
  double force_std_n = 0;           ///< absolute part of its prior standard deviation, per axis
  double force_relative_std = 0;    ///< relative part, independent from step to step (0.02 = 2 %)
  Vec3 force_rate_n_s = Vec3::Zero();  ///< how fast force_n was changing when the step was seen; zero once it has settled
  std::optional<double> travel_m;   ///< motion imposed along the tool's direction (platen: its plane normal)
  Vec3 contact_m = Vec3::Zero();    ///< contact point on the rest surface (tools that are not `vertices` or `platen`)
  Vec3 direction = -Vec3::UnitZ();  ///< unit vector of the push, into the object
  double contact_std_m = 0;         ///< prior on the contact point, tangential
  Vec3 contact_found_m = Vec3::Zero();  ///< from contact_m, across the push: a fit's own, around which it takes a shift as linear
};

struct Step {
  double time_s = 0;
  std::vector<Load> loads;  ///< empty or all zero = an unloaded step, a step like any other
  std::optional<Pose> T_base_tip;
  std::vector<double> joints_rad;
  std::vector<Observation> observations;
  bool unloading = false;  ///< recorded while the tool was going back
  bool slipped = false;    ///< since the step before, the tool slid over the object: it touches elsewhere from here on
  std::string source;      ///< file and line, for messages
};

struct Push {
  std::string name;
  std::string site;  ///< e.g. "head"; empty = one site
  double force_tare_std_n = 0;     ///< prior of a constant force error in this push, per axis (0 = none)
  double travel_offset_std_m = 0;  ///< prior of the travel's zero: where contact really began (0 = exactly known)
  double torque_tare_std_nm = 0;   ///< prior of a constant torque error in this push, per axis (0 = none)
  /// Prior of where the tip is against the object, across the push: torques are about the tip (0 = exactly known)
  double tip_std_m = 0;
  std::vector<Step> steps;
};

struct Environment {
  Vec3 gravity_m_s2 = Vec3::Zero();
  std::vector<Plane> planes;  ///< table and walls
};

/// A table row of the room `fem`, with values where they are known beforehand.
struct Material {
  std::string name = "linear";
  std::map<std::string, double> parameters;  ///< young_modulus [Pa], poisson_ratio [-], alpha [-], density [kg/m3]
};

struct ModelDefaults {
  std::string mesh = "auto";     ///< as_given | remeshed | auto
  std::string element = "auto";  ///< tet4 | tet10 | auto
  std::string refine = "auto";   ///< none | auto
  std::string material = "neo_hookean";
  double poisson_lower = 0.0, poisson_upper = 0.4995;  ///< uniform prior
  std::optional<double> poisson_fixed;
  bool poisson_by_region = false;  ///< every region has its own nu; false: they share one
};

/// Where the object came from: exactly one of the three.
struct Rest {
  std::optional<TetMesh> volume;
  std::optional<TriMesh> surface;
  std::vector<DepthFrame> views;
  RestState state = RestState::stress_free;
  double surface_std_m = 0;  ///< slow error of the rest surface (correlated)
  double surface_correlation_m = 0.04;
  std::optional<Triangles> observed_triangles;  ///< the part of the boundary that sensors saw, by node index
  std::string source;  ///< file and field, for messages
};

/// One link of a URDF with its shapes; the room `sensing` poses it.
struct RobotShape {
  enum class Kind { mesh, box, cylinder, sphere } kind = Kind::mesh;
  Pose T_link_shape = Pose::Identity();
  TriMesh mesh;                ///< Kind::mesh
  Vec3 size_m = Vec3::Zero();  ///< box: edges; cylinder: radius, length; sphere: radius
};
struct RobotLink {
  std::string name;
  std::vector<RobotShape> visual, collision;
};
struct RobotJoint {
  enum class Kind { revolute, continuous, prismatic, fixed } kind = Kind::fixed;
  std::string name, parent, child;
  Pose T_parent_joint = Pose::Identity();
  Vec3 axis = Vec3::UnitX();
  double lower = 0, upper = 0, velocity = 0;
  std::string mimic;  ///< empty = none
  double mimic_multiplier = 1, mimic_offset = 0;
};
struct RobotModel {
  std::string name;
  std::vector<RobotLink> links;
  std::vector<RobotJoint> joints;
};

/// A part of the object with a stiffness of its own. An element belongs where its centre does: to the first region whose box
/// (or list) holds it, else to the region with the nearest of the points, or to the one that takes the rest.
enum class RegionSelection { box, points, elements, rest };
struct Region {
  std::string name;
  RegionSelection select = RegionSelection::rest;
  Vec3 box_min_m = Vec3::Zero(), box_max_m = Vec3::Zero();  ///< box: corners, in the frame of the rest mesh
  Points points_m;                                          ///< points: sites that the region lies around
  std::vector<Index> elements;                              ///< elements: rows of Rest::volume
  std::string source;                                       ///< file and line, for messages
};

struct Recording {
  std::string name;
  std::string description;  ///< free text: source, licence, how to cite
  std::optional<RobotModel> robot;
  std::vector<std::string> joint_names;  ///< order of Step::joints_rad
  std::vector<Tool> tools;
  Environment environment;
  Rest rest;
  bool accept_size = false;  ///< lets an object smaller than 1 mm or larger than 10 m pass
  std::vector<Support> supports;
  bool free = false;         ///< `supports: free`
  std::vector<Region> regions;  ///< empty: one stiffness everywhere
  double density_kg_m3 = 0;  ///< 0 = unknown and not needed
  double density_std_kg_m3 = 0;
  double force_scale_std = 0;  ///< prior of the sensor's common scale error (0.01 = 1 %)
  double force_cross_talk_std = 0;  ///< of what it reads across a push, over the force along it (0.01 = 1 %): each push's, each way across
  double time_offset_std_s = 0;  ///< prior of what is left between the clocks of force and camera
  ModelDefaults model;
  std::vector<Push> pushes;
  std::string source;                               ///< path it was read from
  std::map<std::string, std::string> input_hashes;  ///< file -> SHA-256, for the provenance
  std::vector<std::string> warnings;
};

}  // namespace palpate
