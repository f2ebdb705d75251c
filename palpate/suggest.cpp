// SPDX-License-Identifier: Apache-2.0
#include "palpate/suggest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/core/quantity.hpp"
#include "palpate/estimation/grazing.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/sensing/arm_reach.hpp"
#include "palpate/sensing/depth_render.hpp"
#include "palpate/sensing/lens_scatter.hpp"
#include "palpate/sensing/observe.hpp"

namespace palpate {
namespace {

constexpr double in_front_m = 0.02;    // where a push begins
constexpr double rays_of_fit = 6000;   // a frame, as the fit thins them
constexpr double rays_of_plan = 1500;  // fewer with more weight say the same

std::string tool_of(const Recording& recording, const std::string& wanted) {
  std::string round;
  for (const auto& tool : recording.tools) {
    const bool fits = (tool.shape == ToolShape::sphere || tool.shape == ToolShape::disc) && tool.radius_m > 0;
    if (wanted.empty() ? fits : tool.name == wanted) round += (round.empty() ? "" : "\n") + tool.name;
  }
  if (round.empty())
    throw Error(
        wanted.empty() ? "no round tool (sphere or disc with radius_m): pushes are planned for one" : "no tool of this name",
        "tools " + wanted);
  if (round.find('\n') != std::string::npos) throw Error("there are several round tools: say which one is to push", "tools");
  return round;
}

Vec3 up_of(const Recording& recording) {
  return recording.environment.planes.empty() ? Vec3(Vec3::UnitZ()) : recording.environment.planes.front().normal;
}

Pose looking_at(const Vec3& eye_m, const Vec3& target_m, const Vec3& up) {
  Pose pose = Pose::Identity();
  const Vec3 forward = (target_m - eye_m).normalized();
  const Vec3 right = forward.cross(up).normalized();
  pose.linear() << right, forward.cross(right), forward;
  pose.translation() = eye_m;
  return pose;
}

/// Cameras of the recording, each pose once.
std::vector<DepthFrame> views_of(const Recording& recording) {
  std::vector<DepthFrame> cameras;
  const auto add = [&](const DepthFrame& frame) {
    for (const auto& known : cameras) {
      const Pose apart = known.T_base_camera.inverse() * frame.T_base_camera;
      if (apart.translation().norm() < 0.01 && Eigen::AngleAxisd(apart.linear()).angle() < 0.02) return;
    }
    DepthFrame camera = frame;
    camera.depth_m.resize(0, 0);
    camera.mask.resize(0, 0);
    cameras.push_back(std::move(camera));
  };
  for (const auto& push : recording.pushes)
    for (const auto& step : push.steps)
      for (const auto& observation : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&observation)) add(*frame);
  if (cameras.empty())
    for (const auto& view : recording.rest.views) add(view);
  return cameras;
}

const PointCloud* cloud_of(const Recording& recording) {
  const PointCloud* found = nullptr;
  for (const auto& push : recording.pushes)
    for (const auto& step : push.steps)
      for (const auto& observation : step.observations)
        if (const auto* cloud = std::get_if<PointCloud>(&observation))
          if (found == nullptr || cloud->points_m.rows() > found->points_m.rows()) found = cloud;
  return found;
}

/// What a camera sees of the object at rest, with the weight of all the rays that the fit would use.
/// @param name  of the camera where it stands: what its calibration is wrong by is the same in every image of every push
std::optional<estimation::RayObservation> rays_of(const std::string& name, DepthFrame camera, const TriMesh& surface,
                                                  const Environment& environment) {
  for (const Plane& plane : environment.planes)
    if (plane.normal.dot(camera.T_base_camera.translation() - plane.point_m) <= 0) return std::nullopt;
  camera.depth_m = sensing::render_depth({{&surface, Pose::Identity()}}, camera.camera, camera.T_base_camera);
  sensing::ObserveOptions options;
  const double all = static_cast<double>(sensing::observe(camera, environment, options).range_m.size());
  const auto stride = [&](double wanted) { return std::max(1, static_cast<int>(std::floor(std::sqrt(all / wanted)))); };
  options.back_projection.stride_px = stride(rays_of_plan);
  estimation::RayObservation view;
  view.rays = sensing::observe(camera, environment, options);
  if (view.rays.range_m.size() == 0) return std::nullopt;
  const double of_fit = all / std::pow(stride(rays_of_fit), 2);
  view.rays.sigma_m *= std::sqrt(static_cast<double>(view.rays.range_m.size()) / of_fit);
  view.pose_std_m = camera.pose_std_m;
  view.pose_std_rad = camera.pose_std_rad;
  view.bias_std_m = camera.noise.bias_std_m;
  view.camera = name;
  view.R_base_camera = camera.T_base_camera.linear();
  view.scatter = sensing::lens_scatter(camera);
  view.outline_margin_rad = estimation::outline_margin_px / std::min(camera.camera.fx_px, camera.camera.fy_px);
  return view;
}

PointCloud on_surface(const PointCloud& cloud, const TriMesh& surface) {
  const geometry::TriangleTree tree(surface);
  const Index every = std::max<Index>(1, static_cast<Index>(static_cast<double>(cloud.points_m.rows()) / rays_of_plan));
  PointCloud out = cloud;
  out.normals.resize(0, 3);
  const Index count = (static_cast<Index>(cloud.points_m.rows()) + every - 1) / every;
  out.points_m.resize(count, 3);
  const double sigma_m = cloud.sigma_m.size() > 0 ? cloud.sigma_m.mean() : 0;
  if (!(sigma_m > 0)) throw Error("the cloud needs its standard deviation", "observations: cloud.sigma_m");
  out.sigma_m = VectorX::Constant(1, sigma_m / std::sqrt(static_cast<double>(every)));
  for (Index i = 0; i < count; ++i) out.points_m.row(i) = tree.closest(cloud.points_m.row(i * every)).point_m;
  return out;
}

/// The first load of a push under which something is pressed by a force; nullptr: none.
const Load* pressing_load(const Push& push) {
  for (const Step& step : push.steps)
    for (const Load& load : step.loads)
      if (load.force_n && load.force_n->norm() > 0) return &load;
  return nullptr;
}

const ToolTravel* read_travel(const Push& push) {
  for (const Step& step : push.steps)
    for (const Observation& observation : step.observations)
      if (const auto* travel = std::get_if<ToolTravel>(&observation)) return travel;
  return nullptr;
}

/// Errors of force and travel as they were stated last, each by a push that has it.
estimation::SensorPlan errors_of(const Recording& recording, std::vector<std::string>& warnings) {
  estimation::SensorPlan sensors;
  const auto last = [&](const auto& has) { return std::find_if(recording.pushes.rbegin(), recording.pushes.rend(), has); };
  const auto pressed = last([](const Push& push) { return pressing_load(push) != nullptr; });
  if (pressed != recording.pushes.rend()) {
    const Load& load = *pressing_load(*pressed);
    sensors.force_std_n = load.force_std_n;
    sensors.force_relative_std = load.force_relative_std;
    sensors.contact_std_m = load.contact_std_m;
    sensors.force_tare_std_n = pressed->force_tare_std_n;
    const auto read = last([](const Push& push) { return pressing_load(push) != nullptr && read_travel(push) != nullptr; });
    if (read == recording.pushes.rend()) return sensors;
    sensors.travel_sigma_m = read_travel(*read)->sigma_m;
    sensors.travel_offset_std_m = read->travel_offset_std_m;
    return sensors;
  }
  sensors.force_std_n = 0.03;
  sensors.force_tare_std_n = 0.05;
  sensors.contact_std_m = 0.001;
  warnings.push_back(
      "no push with a force says how well the sensors measure: 0.03 N of noise, 0.05 N of tare, a contact point known to 1 "
      "mm "
      "and no encoder were assumed");
  return sensors;
}

void add_views(PushScene& scene, const Recording& recording, const SuggestOptions& options) {
  const TriMesh& surface = scene.simulated.surface.rest();
  const Vec3 low = surface.vertices_m.colwise().minCoeff(), high = surface.vertices_m.colwise().maxCoeff();
  const Vec3 middle = 0.5 * (low + high), up = up_of(recording);
  std::vector<DepthFrame> cameras = options.cameras.empty() ? views_of(recording) : options.cameras;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < cameras.size(); ++i) names.push_back("camera " + std::to_string(i + 1));
  const PointCloud* cloud = cameras.empty() ? cloud_of(recording) : nullptr;
  int more = options.viewpoints;
  if (cameras.empty() && cloud == nullptr) {
    DepthFrame camera;
    camera.camera = {640, 480, 606, 606, 319.5, 239.5, DistortionModel::none, {}};
    camera.noise.model = "realsense_d435";
    camera.pose_std_m = camera.pose_std_rad = 5e-4;
    const Vec3 aside = up.unitOrthogonal();
    camera.T_base_camera =
        looking_at(middle + std::max(0.5, 2.5 * (high - low).norm()) * (aside + up).normalized(), middle, up);
    cameras = {camera};
    names = {"camera"};
    more = std::max(more, 3);
    scene.warnings.push_back("no camera is known: one like a RealSense D435 was assumed, at four places around the object");
  }
  if (more > 0 && cameras.empty()) scene.warnings.push_back("the recording has clouds and no camera, of which further places could be compared: views are left aside");
  for (int k = 1; k <= more && !cameras.empty(); ++k) {
    const double angle = 2 * EIGEN_PI * k / (more + 1);
    DepthFrame turned = cameras.front();
    const Eigen::AngleAxisd turn(angle, up);
    turned.T_base_camera.linear() = turn * cameras.front().T_base_camera.linear();
    turned.T_base_camera.translation() = middle + turn * (cameras.front().T_base_camera.translation() - middle);
    cameras.push_back(turned);
    names.push_back(names.front() + " turned by " + std::to_string(std::lround(angle * 180 / EIGEN_PI)) + " degrees");
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    auto rays = rays_of(names[i], cameras[i], surface, recording.environment);
    if (!rays) {
      scene.warnings.push_back(names[i] + " sees nothing of the object, or stands behind a plane");
      continue;
    }
    scene.sensors.views.push_back({names[i], std::move(*rays)});
    scene.viewpoints.push_back({names[i], cameras[i].T_base_camera});
  }
  if (cloud != nullptr) {
    scene.sensors.views.push_back({"cloud", on_surface(*cloud, surface)});
    scene.viewpoints.push_back({"cloud", std::nullopt});
  }
}

/// What the arm of the recording's robot says about a push; empty where nothing is known of the arm.
std::function<bool(const Vec3&, const Vec3&)> reach_of(const Recording& recording, const SuggestOptions& options,
                                                       std::vector<std::string>& warnings) {
  if (!recording.robot) {
    if (!options.tip_link.empty()) throw Error("the recording has no robot", "tip_link " + options.tip_link);
    return {};
  }
  std::optional<sensing::MountedTool> tool;
  if (!options.tip_link.empty()) {
    tool.emplace().link = options.tip_link;
  } else {
    std::string why = "its joints do not explain where the pushes touched";
    try {
      tool = sensing::find_tool(sensing::Kinematics(*recording.robot), recording);
    } catch (const Error& error) {
      why = error.what();
    }
    if (!tool) {
      warnings.push_back("the robot's joint limits are not looked at: " + why + " (name the link of its tip, z along the push)");
      return {};
    }
  }
  const auto arm = std::make_shared<sensing::ArmReach>(*recording.robot, *tool, recording.environment.planes);
  const double beyond_m = std::min(options.candidates.limits.travel_m, in_front_m);
  return [arm, beyond_m](const Vec3& contact_m, const Vec3& direction) {
    return arm->reaches(contact_m, direction, in_front_m, beyond_m);
  };
}

/// What supports do that the linear model of all candidates does not.
void warn_of_supports(const Recording& recording, std::vector<std::string>& warnings) {
  for (const Support& support : recording.supports) {
    if (support.contact == ContactLaw::bonded) continue;
    warnings.push_back("'" + support.name + "' (" + (support.contact == ContactLaw::friction ? "friction" : "frictionless") +
                       ") is taken to hold the object " +
                       (support.contact == ContactLaw::friction ? "without a slip" : "down, and to let it slide freely") +
                       ": pushes that would lift, tilt or slide it are not known to the ranking; look whether it stays where it is");
  }
}

}  // namespace

std::string why_not_to_build_on(const Identification& so_far) {
  constexpr const char* moved[] = {"contact_slipped", "contact_elsewhere", "object_moved"};
  for (const Verdict& verdict : so_far.verdicts)
    if (std::find(std::begin(moved), std::end(moved), verdict.code) != std::end(moved)) return verdict.code + ": " + verdict.message;
  return {};
}

std::string push_words(const estimation::RatedPush& push, const PushScene& scene) {
  const Vec3 at = push.candidate.contact_m + Vec3::Zero(), along = push.candidate.direction + Vec3::Zero();  // "+0.00", never "-0.00"
  std::string words = fmt::format("push at ({:.4f} {:.4f} {:.4f}) along ({:+.2f} {:+.2f} {:+.2f}) up to {} (about {})", at.x(), at.y(),
                                  at.z(), along.x(), along.y(), along.z(), quantity(push.force_n, "N"), quantity(push.travel_m, "m"));
  // Of an answer with one E nobody asks where it is pressed.
  if (push.expected.region_log_young_std.size() > 1) words += ", on " + scene.simulated.region_names[std::size_t(push.region)];
  if (push.view >= 0 && scene.viewpoints.size() > 1) words += ", seen by " + scene.viewpoints[std::size_t(push.view)].name;
  return words;
}

Recording as_fitted(Recording object, const Recording& recording) {
  object.pushes = recording.pushes;
  object.rest.views = recording.rest.views;
  object.robot = recording.robot;
  object.joint_names = recording.joint_names;
  return object;
}

PushScene prepare_pushes(const Recording& recording, const SuggestOptions& options, const OnProgress& progress) {
  PushScene scene;
  scene.tool = tool_of(recording, options.tool);
  scene.object = recording;
  scene.object.pushes.clear();
  scene.object.model.refine = "none";  // candidates are everywhere
  scene.simulated = build_simulated_object(scene.object, progress);
  scene.sensors = options.sensors ? *options.sensors : errors_of(recording, scene.warnings);
  scene.sensors.views.clear();
  add_views(scene, recording, options);
  warn_of_supports(recording, scene.warnings);

  std::vector<Index> held;
  for (const auto& support : scene.object.supports) {
    const auto nodes = fem::support_nodes(scene.simulated.mesh, support);
    held.insert(held.end(), nodes.begin(), nodes.end());
  }
  const auto tool =
      std::find_if(recording.tools.begin(), recording.tools.end(), [&](const Tool& t) { return t.name == scene.tool; });
  estimation::CandidateOptions candidates = options.candidates;
  if (!candidates.reachable) candidates.reachable = reach_of(recording, options, scene.warnings);
  const estimation::PushSpace space(scene.simulated.surface.rest(), scene.object,
                                    scene.simulated.mesh.nodes_m(held, Eigen::all), *tool, candidates);
  if (options.only.empty()) {
    scene.candidates = space.sample(&scene.refused);
  } else {
    const geometry::TriangleTree surface(scene.simulated.surface.rest());
    for (estimation::PushCandidate candidate : options.only) {
      const geometry::ClosestPoint foot = surface.closest(candidate.contact_m);
      const double off_m = std::sqrt(foot.squared_distance_m2);
      if (off_m > std::max(0.5 * tool->radius_m, 1e-3))
        throw Error(fmt::format("the contact ({:.4f} {:.4f} {:.4f}) lies {} away from the object's surface; the nearest place on it is ({:.4f} {:.4f} {:.4f})",
                                candidate.contact_m.x(), candidate.contact_m.y(), candidate.contact_m.z(), quantity(off_m, "m"), foot.point_m.x(),
                                foot.point_m.y(), foot.point_m.z()),
                    "candidates");
      const std::string word = space.refusal(candidate);
      if (word.empty())
        scene.candidates.push_back(candidate);
      else
        ++scene.refused[word];
    }
  }
  if (scene.candidates.empty()) {
    std::string reasons;
    for (const auto& [word, count] : scene.refused)
      reasons += (reasons.empty() ? "" : ", ") + word + " (" + std::to_string(count) + ")";
    throw Error("no push is possible: " + reasons + "; loosen the limits (tilt, stick length, tool radius)", "candidates");
  }
  return scene;
}

estimation::PushRanking suggest(const PushScene& scene, const Identification* so_far, const SuggestOptions& options,
                                const OnProgress& progress) {
  estimation::SensorPlan sensors = scene.sensors;
  const estimation::Knowledge knowledge = so_far != nullptr
                                              ? estimation::after_fit(scene.object, *so_far)
                                              : estimation::before_touch(scene.object, options.young_modulus_pa);
  if (so_far != nullptr) {
    const auto inflation = so_far->provenance.find("variance inflation of correlated points");
    if (inflation != so_far->provenance.end())
      sensors.variance_inflation = std::max(1.0, std::strtod(inflation->second.c_str(), nullptr));
  }
  estimation::RankOptions rank;
  rank.goal = options.goal;
  rank.limits = options.candidates.limits;
  rank.threads = options.threads;
  return estimation::rank_pushes(scene.object, scene.simulated, scene.tool, scene.candidates, sensors, knowledge, rank,
                                 progress);
}

}  // namespace palpate
