// SPDX-License-Identifier: Apache-2.0
#include "cli/push_robot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "cli/driver_library.hpp"
#include "cli/number_checks.hpp"
#include "cli/session.hpp"
#include "palpate/core/error.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/io/recording.hpp"

namespace palpate::cli {
namespace {

constexpr const char* own_robot = "A robot of your own";
constexpr const char* option_group = "Where to push";

struct Place {
  Vec3 contact_m, direction;
};

/// Of the pushes that are asked for. @param into  where no direction is said: the one into the object there
std::vector<Place> places_of(const RobotArguments& arguments, const std::function<Vec3(const Vec3&)>& into) {
  const std::size_t pushes = arguments.contacts.size(), directions = arguments.directions.size();
  if (directions > 1 && directions != pushes)
    throw Error(fmt::format("there are {} for {} contacts: give one each, one for all, or none", directions, pushes), "--direction");
  std::vector<Place> places;
  for (std::size_t i = 0; i < pushes; ++i) {
    const Vec3 contact_m(arguments.contacts[i].data());
    const Vec3 direction = directions == 0 ? into(contact_m) : Vec3(arguments.directions[directions == 1 ? 0 : i].data());
    if (!(direction.norm() > 0) || !direction.allFinite()) throw Error("must not be zero", "--direction");
    places.push_back({contact_m, direction.normalized()});
  }
  return places;
}

Vec3 into_surface(const TriMesh& surface, const Vec3& contact_m) {
  const auto nearest = geometry::TriangleTree(surface).closest(contact_m);
  const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(nearest.triangle, k))); };
  return (corner(2) - corner(0)).cross(corner(1) - corner(0)).normalized();
}

class FromLab : public PushRobot {
 public:
  FromLab(const RobotArguments& arguments, std::uint64_t seed)
      : lab_(lab_options(arguments.lab, seed), lab_object(arguments.lab, seed)) {
    const TriMesh& surface = lab_.object().surface;
    places_ = places_of(arguments, [&](const Vec3& at_m) { return into_surface(surface, at_m); });
    for (Place& place : places_) {
      const Vec3 onto_m = geometry::TriangleTree(surface).closest(place.contact_m).point_m;
      constexpr double near_m = 0.002;
      const double beside_m = (onto_m - place.contact_m).norm();
      if (beside_m > near_m)
        throw Error(fmt::format("({:.4f} {:.4f} {:.4f}) lies {:.1f} mm beside the object, which is nearest at ({:.4f} {:.4f} {:.4f})",
                                place.contact_m.x(), place.contact_m.y(), place.contact_m.z(), 1000 * beside_m, onto_m.x(), onto_m.y(), onto_m.z()),
                    "--contact");
      place.contact_m = onto_m;
    }
  }
  acquisition::Robot& robot() override { return lab_; }
  Recording scene() const override { return lab_.scene(); }
  std::size_t sites() const override { return places_.empty() ? lab_.object().sites.size() : places_.size(); }
  acquisition::PushPlan plan(std::size_t site) override {
    if (places_.empty()) return lab_.plan(site);
    acquisition::PushPlan plan = lab_.plan_at(places_.at(site).contact_m, places_.at(site).direction);
    plan.name = fmt::format("push {}", site + 1);
    return plan;
  }
  acquisition::PushPlan plan_at(const Vec3& contact_m, const Vec3& direction) override { return lab_.plan_at(contact_m, direction); }
  bool reaches(const Vec3& contact_m, const Vec3& direction, double start_distance_m) const override {
    return lab_.reaches(contact_m, direction, start_distance_m);
  }
  double force_step_n(std::size_t site) const override {
    return places_.empty() ? lab_.object().force_step_at(lab_.object().sites[site]) : lab_.object().force_step_n;
  }
  double travel_limit_m() const override { return lab_.object().travel_limit_m; }
  void go_on_after(std::size_t steps) override { lab_.go_on_after(steps); }
  std::optional<nlohmann::json> truth() const override { return truth_json(lab_); }
  nlohmann::json truth_of(const Push& push, const Step& step) const override { return truth_json(push, step, lab_); }

 private:
  lab::LabRobot lab_;
  std::vector<Place> places_;  // that the user asks for; none: those of the object
};

class FromDriver : public PushRobot {
 public:
  explicit FromDriver(const RobotArguments& arguments) : library_(arguments.driver, arguments.settings) {
    if (arguments.scene.empty())
      throw Error("say what stands before the robot: a recording without pushes (object, supports, tools) as --scene FOLDER",
                  "--driver");
    scene_ = io::read_recording_unchecked(arguments.scene);
    scene_.pushes.clear();
    around_ = acquisition::keep_out(scene_);
    if (scene_.tools.empty()) throw Error("names no tool; add `tools:`", arguments.scene.string());
    tool_ = arguments.tool.empty() ? scene_.tools.front().name : arguments.tool;
    bool known = false;
    for (const Tool& tool : scene_.tools) known = known || tool.name == tool_;
    if (!known) throw Error("is no tool of the scene; its first is " + scene_.tools.front().name, "--tool " + tool_);
    places_ = places_of(arguments, [&](const Vec3& at_m) { return into_the_object(at_m); });
  }
  acquisition::Robot& robot() override { return library_.robot(); }
  Recording scene() const override { return scene_; }
  std::size_t sites() const override { return places_.size(); }
  acquisition::PushPlan plan(std::size_t site) override {
    acquisition::PushPlan plan = plan_at(places_.at(site).contact_m, places_.at(site).direction);
    plan.name = fmt::format("push {}", site + 1);
    plan.site = fmt::format("place {}", site + 1);
    return plan;
  }
  acquisition::PushPlan plan_at(const Vec3& contact_m, const Vec3& direction) override {
    acquisition::PushPlan plan;
    plan.name = "push";
    plan.site = fmt::format("({:.3f} {:.3f} {:.3f})", contact_m.x(), contact_m.y(), contact_m.z());
    plan.tool = tool_;
    plan.contact_m = contact_m;
    plan.direction = direction;
    plan.R_base_tip = acquisition::tip_along(direction);
    plan.around = around_;
    return plan;
  }
  bool reaches(const Vec3& contact_m, const Vec3& direction, double start_distance_m) const override {
    Pose pose = Pose::Identity();
    pose.linear() = acquisition::tip_along(direction);
    for (const double before_m : {start_distance_m, 0.0}) {
      pose.translation() = contact_m - before_m * direction;
      if (!library_.robot().reaches(pose)) return false;
    }
    return true;
  }
  double force_step_n(std::size_t) const override { return acquisition::PushOptions{}.force_step_n; }
  double travel_limit_m() const override { return acquisition::PushOptions{}.travel_limit_m; }

 private:
  Vec3 into_the_object(const Vec3& contact_m) const {
    std::optional<TriMesh> surface = scene_.rest.surface;
    if (!surface && scene_.rest.volume) surface = geometry::boundary_surface(*scene_.rest.volume).surface;
    if (!surface) throw Error("the scene's shape is known from views only: say along which --direction to push", "--contact");
    return into_surface(*surface, contact_m);
  }

  DriverLibrary library_;
  Recording scene_;
  std::optional<acquisition::KeepOut> around_;
  std::string tool_;
  std::vector<Place> places_;
};

}  // namespace

void add_robot_options(CLI::App& app, RobotArguments& arguments) {
  const auto before = app.get_options();
  add_lab_options(app, arguments.lab);
  const auto of_the_lab = app.get_options();
  CLI::Option* const driver = app.add_option("--driver", arguments.driver,
                                           "in place of the lab's: a shared library as palpate/acquisition/driver.h says")
                                    ->group(own_robot);
  for (CLI::Option* option : of_the_lab) {
    if (std::find(before.begin(), before.end(), option) != before.end()) continue;
    driver->excludes(option);
    option->group("The lab: what its robot pushes, with what, and what goes wrong");
  }
  app.add_option("--driver-settings", arguments.settings, "handed to the driver as it is: an address, a file, ...")
      ->needs("--driver")
      ->group(own_robot);
  app.add_option("--scene", arguments.scene, "with --driver: a recording without pushes: object, supports, tools, table, robot")
      ->needs("--driver")
      ->group(own_robot);
  app.add_option("--tool", arguments.tool, "with --driver: of the scene (default: its first)")->needs("--driver")->group(own_robot);
}

void add_views_option(CLI::App& app, int& views) {
  app.add_option("--views", views,
                 "look at the untouched object from this many sides and let `estimate` build its shape from that; 0: its shape is given. "
                 "Of drivers those that have the call `look`")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
}

bool look_around(PushRobot& robot, int views, Recording& scene) {
  auto frames = acquisition::look_around(robot.robot(), views, [] { return !Session::interrupted(); });
  if (!frames)
    throw Error("the driver does not carry its camera around (it has no call `look`): give the object's shape in the scene, or put "
                "views of it into the scene's `rest.views`",
                "--views");
  if (int(frames->size()) < views) return false;
  scene.rest.views = std::move(*frames);
  scene.rest.surface.reset();
  scene.rest.volume.reset();
  scene.rest.observed_triangles.reset();
  return true;
}

void add_contact_options(CLI::App& app, RobotArguments& arguments) {
  app.add_option("--contact", arguments.contacts, "where to push, in metres, base frame; again for every push (default: the places of the lab's object)")
      ->type_name("X Y Z")
      ->allow_extra_args(false)
      ->check(coordinate("where to push, in metres, base frame"))
      ->group(option_group);
  app.add_option("--direction", arguments.directions,
                 "of these pushes, in the base frame, into the object: one for all, or one each (default: across the surface)")
      ->needs("--contact")
      ->type_name("X Y Z")
      ->allow_extra_args(false)
      ->check(coordinate("along which to push, into the object, base frame"))
      ->group(option_group);
}

std::unique_ptr<PushRobot> push_robot(const RobotArguments& arguments, std::uint64_t seed) {
  if (arguments.driver.empty()) return std::make_unique<FromLab>(arguments, seed);
  return std::make_unique<FromDriver>(arguments);
}

}  // namespace palpate::cli
