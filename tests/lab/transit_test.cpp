// label: unit
// SPDX-License-Identifier: Apache-2.0
// On its way between pushes the lab's tip keeps clear of the object, and where a way leads through it the lab says so.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/object.hpp"
#include "palpate/lab/robot.hpp"

namespace palpate::lab::transit_test {
namespace {

// Sends a robot to the beginning of a push and no further, and keeps where its tip was.
struct Watched : acquisition::Robot {
  explicit Watched(LabRobot& robot) : lab(robot) {}
  acquisition::RobotState read() override { return lab.read(); }
  acquisition::Motion move(const Pose& pose, double speed_m_s) override {
    const auto moved = lab.move(pose, speed_m_s);
    if (moved == acquisition::Motion::done) tips_m.push_back(lab.read().T_base_tip.translation());
    return moved;
  }
  void stop() override { lab.stop(); }
  DepthFrame take_depth_image() override { return lab.take_depth_image(); }
  void wait(double duration_s) override { lab.wait(duration_s); }
  double travel_sigma_m() const override { return lab.travel_sigma_m(); }
  void on_the_way(bool is) override {
    arrived = !is;
    lab.on_the_way(is);
  }
  acquisition::PushReport come(const acquisition::PushPlan& plan) {
    arrived = false;
    return acquisition::run_push(*this, plan, {}, {}, [this] { return !arrived; });
  }

  LabRobot& lab;
  std::vector<Vec3> tips_m;
  bool arrived = false;
};

double nearest_m(const geometry::TriangleTree& surface, const Vec3& from_m, const Vec3& to_m) {
  double nearest = 1;
  for (int k = 0; k <= 10; ++k)
    nearest = std::min(nearest, std::sqrt(surface.closest(from_m + 0.1 * k * (to_m - from_m)).squared_distance_m2));
  return nearest;
}

TEST(LabTransit, NoWayBetweenTwoPushesMeetsTheObject) {
  for (const std::string name : {"bear", "animal", "bar", "ball", "cube"}) {
    LabRobot robot({}, make_object(name, {}));
    const geometry::TriangleTree surface(robot.object().surface);
    const std::size_t sites = robot.object().sites.size();
    Watched watched(robot);
    double least_m = 1;
    int straight_through = 0;
    std::optional<Vec3> last_m;
    for (std::size_t turn = 0; turn < sites * sites; ++turn) {  // every pair in both orders
      const std::size_t to = turn % 2 == 0 ? turn / 2 % sites : (turn / 2 + 1 + turn / 2 / sites) % sites;
      const acquisition::PushPlan plan = robot.plan(to);
      const Vec3 start_m = plan.contact_m - 0.05 * plan.direction;
      watched.tips_m.clear();
      const auto report = watched.come(plan);
      ASSERT_EQ(report.stop, acquisition::StopReason::user) << name << ", " << plan.site << ": " << report.message;
      ASSERT_LT((watched.tips_m.back() - start_m).norm(), 1e-5) << name << ", " << plan.site;
      EXPECT_FALSE(report.blind_retreat_m);
      if (last_m && *last_m != start_m) straight_through += nearest_m(surface, *last_m, start_m) < robot.object().pad_radius_m;
      for (const Vec3& tip_m : watched.tips_m) {
        if (last_m) least_m = std::min(least_m, nearest_m(surface, *last_m, tip_m));
        last_m = tip_m;
      }
    }
    EXPECT_GT(least_m, robot.object().pad_radius_m) << name;
    RecordProperty(name + "_least_mm", std::to_string(1000 * least_m));
    EXPECT_TRUE(name != "bear" || straight_through > 0) << "or there was nothing to go around";
  }
}

TEST(LabTransit, AWayThroughTheObjectIsFelt) {
  LabRobot robot({}, make_object("bear", {}));
  Watched watched(robot);
  watched.come(robot.plan(1));
  const geometry::TriangleTree surface(robot.object().surface);
  acquisition::PushPlan back = robot.plan(2);
  const Vec3 from_m = robot.read().T_base_tip.translation(), start_m = back.contact_m - 0.05 * back.direction;
  ASSERT_TRUE(surface.cast(from_m, start_m - from_m, 1)) << "the straight way leads through it";
  const Vec3 before_n = robot.read().force_n;
  Pose pose = Pose::Identity();
  pose.linear() = back.R_base_tip;
  pose.translation() = start_m;
  ASSERT_EQ(robot.move(pose, 0.02), acquisition::Motion::done);
  EXPECT_GT((robot.read().force_n - before_n).norm(), 5);
  const Vec3 at_m = robot.read().T_base_tip.translation();
  EXPECT_GT((at_m - start_m).norm(), 0.03) << "it does not get there";
  EXPECT_LT(std::sqrt(surface.closest(at_m).squared_distance_m2), 0.008) << "it stands at the surface";

  // A protocol that knows nothing of the object's size, or is told a wrong one, is caught.
  LabRobot other({}, make_object("bear", {}));
  Watched again(other);
  again.come(other.plan(1));
  back = other.plan(2);
  back.around = acquisition::KeepOut{Vec3(5, 5, 5), Vec3(6, 6, 6), {}};
  const auto report = again.come(back);
  EXPECT_EQ(report.stop, acquisition::StopReason::obstacle) << report.message;
  EXPECT_GT(std::sqrt(surface.closest(other.read().T_base_tip.translation()).squared_distance_m2), 0.004) << "and has gone back";
}

}  // namespace
}  // namespace palpate::lab::transit_test
