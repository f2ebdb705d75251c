// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/opposed_ball.hpp"

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/lab/implicit_surface.hpp"

namespace palpate::lab {

LabObject opposed_ball(const ObjectOptions& o) {
  constexpr double radius_m = opposed_ball_radius_m, room_m = 0.01;
  LabObject object = make_object("ball", o);  // the same draw of E and nu
  object.name = "opposed ball";
  object.description = "a ball of 120 mm that nothing holds, between a pad in the table and another";
  // The grid cuts off what reaches its bottom: the ball is made above it and put down.
  object.surface = implicit_surface([](const Vec3& p) { return p.norm() - radius_m; },
                                    {Vec3::Constant(-radius_m - room_m), Vec3::Constant(radius_m + room_m), 0.003});
  const Vec3 centre_m = o.base_centre_m + radius_m * Vec3::UnitZ();
  object.surface.vertices_m.rowwise() += centre_m.transpose();
  object.supports.clear();
  object.sites = {{"top", centre_m + radius_m * Vec3::UnitZ(), -Vec3::UnitZ()}};
  PressedObjectOptions pressed = pressed_options(object, o);
  pressed.opposed_m = o.base_centre_m;
  object.press = [pressed, top = object.sites[0]](const PushSite& at) -> std::unique_ptr<Pressed> {
    constexpr double of_the_facets_m = 1e-3;  // the surface's triangles pass the very top by less
    if ((at.contact_m - top.contact_m).norm() > of_the_facets_m || (at.direction - top.direction).norm() > 1e-6)
      throw Error("can be pressed at its top only, straight down: the other pad stands below", "opposed ball");
    return press_at(pressed, top);
  };
  return object;
}

}  // namespace palpate::lab
