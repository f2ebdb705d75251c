// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/object.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/geometry/mesh_checks.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/box_surface.hpp"
#include "palpate/lab/implicit_surface.hpp"
#include "palpate/lab/pressed_balloon.hpp"
#include "palpate/lab/pressed_block.hpp"
#include "palpate/lab/pressed_object.hpp"
#include "palpate/lab/random.hpp"

namespace palpate::lab {
namespace {

constexpr double surface_cell_m = 0.003;  // chords of a sphere of 60 mm then lie within 0.02 mm of it

// Truth from options and seed; `stiffer` raises the range that E is drawn from.
LabObject draw(const std::string& name, const ObjectOptions& o, double stiffer = 1) {
  const auto need = [](bool good, const char* field, const char* rule) {
    if (!good) throw Error(rule, std::string("ObjectOptions.") + field);
  };
  need(!o.young_modulus_pa || *o.young_modulus_pa > 0, "young_modulus_pa", "must be positive");
  need(!o.poisson_ratio || (*o.poisson_ratio >= 0 && *o.poisson_ratio < 0.4999), "poisson_ratio", "must be in [0, 0.4999)");
  need(o.poisson_steps >= 10, "poisson_steps", "must be at least 10");
  need(o.friction_coefficient > 0 && std::isfinite(o.friction_coefficient), "friction_coefficient", "must be positive");
  need(!o.albedo || (*o.albedo > 0 && *o.albedo <= 1), "albedo", "must be above 0 and at most 1");
  need(!o.texture || (*o.texture >= 0 && *o.texture <= 1), "texture", "must be between 0 and 1");
  need(o.region_ratio > 0 && std::isfinite(o.region_ratio), "region_ratio", "must be positive");
  need(o.tetrahedra >= 200, "tetrahedra", "must be at least 200");
  need(o.cells_in_radius >= 1, "cells_in_radius", "must be at least 1");
  const auto& parameters = fem::material_law(o.material).extra_parameters();
  need(o.extra.empty() || o.extra.size() == parameters.size(), "extra", "must have one value a further parameter of the law");
  Random random(o.seed);
  const double young = 10e3 * stiffer * std::exp(random.uniform() * std::log(4.0)), poisson = random.uniform(0.1, 0.45);
  LabObject object;
  object.name = name;
  object.foot_m = o.base_centre_m;
  object.material = o.material;
  object.young_modulus_pa = o.young_modulus_pa.value_or(std::round(young / 10) * 10);
  object.poisson_ratio = o.poisson_ratio.value_or(std::round(poisson * o.poisson_steps) / o.poisson_steps);
  object.extra = o.extra;
  if (object.extra.empty())
    for (const auto& parameter : parameters) object.extra.push_back(parameter.initial);
  return object;
}

Support flat(const ObjectOptions& o, SupportKind kind, const char* name, const Vec3& point_m, const Vec3& normal) {
  Support support;
  support.kind = o.stands == ContactLaw::bonded ? SupportKind::plane : kind;
  support.contact = o.stands;
  if (o.stands == ContactLaw::friction) support.friction_coefficient = o.friction_coefficient;
  support.name = name;
  support.plane = {point_m, normal};
  return support;
}

std::string standing(const ObjectOptions& o) {
  const std::string how = o.stands == ContactLaw::bonded     ? "glued to the table"
                          : o.stands == ContactLaw::friction ? "standing on the table"
                                                             : "standing on a smooth table";
  return !o.wall ? how : how + (o.stands == ContactLaw::bonded ? " and to a wall behind it" : ", a wall behind it");
}

// On the table, and at the wall if there is one.
void stand(LabObject& object, const ObjectOptions& o) {
  object.supports.push_back(flat(o, SupportKind::table, "table", o.base_centre_m, Vec3::UnitZ()));
  if (!o.wall) return;
  const double behind_m = object.surface.vertices_m.col(0).maxCoeff();
  bool flat_there = false;
  for (Index t = 0; t < object.surface.triangles.rows(); ++t)
    flat_there = flat_there || (object.surface.vertices_m(object.surface.triangles.row(t), 0).array() > behind_m - 1e-9).all();
  if (o.stands == ContactLaw::bonded && !flat_there)
    throw Error("the " + object.name + " has no flat side that could be glued to a wall; let it stand rough", "ObjectOptions.stands");
  object.supports.push_back(flat(o, SupportKind::wall, "wall", Vec3(behind_m, o.base_centre_m.y(), o.base_centre_m.z()), -Vec3::UnitX()));
}

PushSite site(const LabObject& object, const ObjectOptions& o, const std::string& name, const Vec3& aim_m, const Vec3& direction,
              double stiffness = 1) {
  const geometry::TriangleTree tree(object.surface);
  const Vec3 along = direction.normalized(), start = o.base_centre_m + aim_m - along;
  const auto hit = tree.cast(start, along);
  if (!hit) throw Error("passes the object by", "site " + name);
  return {name, start + hit->range_m * along, along, stiffness};
}

// Pad, depth and force of a push on a body that is large against the pad.
void size_pushes(LabObject& object, double pad_radius_m) {
  object.pad_radius_m = pad_radius_m;
  object.travel_limit_m = 0.5 * pad_radius_m;
  // A punch on a half space: F = 2 a E d / (1 - nu^2); two digits, as a person would choose.
  const double force =
      2 * pad_radius_m * object.young_modulus_pa * object.travel_limit_m / (1 - object.poisson_ratio * object.poisson_ratio);
  const double digit = std::pow(10.0, std::floor(std::log10(0.25 * force)) - 1);
  object.force_step_n = std::max(0.1, std::round(0.25 * force / digit) * digit);
}

// Legs have few elements across them: with as many as a stout body needs, an animal on four gave way 0.3 % too little.
ObjectOptions for_thin_parts(ObjectOptions o) {
  o.tetrahedra *= 2;
  return o;
}

void make_pressable(LabObject& object, const ObjectOptions& o) {
  object.punch = o.punch;
  if (o.wall) {
    const double height_m = object.surface.vertices_m.col(2).maxCoeff() - o.base_centre_m.z();
    object.sites.push_back(site(object, o, "to the wall", {0, 0, 0.6 * height_m}, Vec3(0.94, 0, -0.34)));
  }
  object.press = [pressed = pressed_options(object, o)](const PushSite& at) { return press_at(pressed, at); };
}

// Pushes in the plane y = 0, on top or on the side that looks along -x, are solved on a mesh that is made for the round pad;
// others on one as for any object.
void make_pressable_block(LabObject& object, const ObjectOptions& o, const Vec3& size_m) {
  make_pressable(object, o);
  if (!object.regions.empty() || o.wall || o.punch || o.stands != ContactLaw::bonded) return;
  PressedBlockOptions block;
  block.size_m = size_m;
  block.pad_radius_m = object.pad_radius_m;
  block.base_centre_m = o.base_centre_m;
  block.cells_in_radius = std::max(1, o.cells_in_radius - 2);
  block.material = object.material;
  block.young_modulus_pa = object.young_modulus_pa;
  block.poisson_ratio = object.poisson_ratio;
  block.extra = object.extra;
  object.press = [block, anywhere = object.press](const PushSite& at) -> std::unique_ptr<Pressed> {
    PressedBlockOptions here = block;
    const Vec3 from_foot = at.contact_m - block.base_centre_m, half = 0.5 * block.size_m;
    const double room_m = 1.1 * block.pad_radius_m;
    here.direction = at.direction;
    here.at_side = std::abs(from_foot.x() + half.x()) < 1e-9 && from_foot.z() < block.size_m.z() - 1e-9;
    here.site_m = here.at_side ? from_foot.z() : from_foot.x();
    const bool on_top = std::abs(from_foot.z() - block.size_m.z()) < 1e-9 && std::abs(from_foot.x()) < half.x() - room_m;
    const bool on_side = here.at_side && from_foot.z() > room_m && from_foot.z() < block.size_m.z() - room_m;
    const bool into = (here.at_side ? at.direction.x() : -at.direction.z()) > 0.1;
    if (std::abs(from_foot.y()) > 1e-9 || std::abs(at.direction.y()) > 1e-9 || !into || !(on_top || on_side) || half.y() < room_m)
      return anywhere(at);
    return std::make_unique<PressedBlock>(here);
  };
}

// A box relative to the foot; without one, what the others leave.
TrueRegion region(const ObjectOptions& o, const std::string& name, double young_modulus_pa,
                  const std::optional<std::pair<Vec3, Vec3>>& box_m = {}) {
  TrueRegion out{{}, young_modulus_pa};
  out.region.name = name;
  if (box_m) {
    out.region.select = RegionSelection::box;
    out.region.box_min_m = o.base_centre_m + box_m->first;
    out.region.box_max_m = o.base_centre_m + box_m->second;
  }
  return out;
}

LabObject shaped(const std::string& name, const ObjectOptions& o, const Implicit& body, const Vec3& min_m, const Vec3& max_m,
                 double stiffer = 1) {
  LabObject object = draw(name, o, stiffer);
  object.surface = implicit_surface(body, {min_m, max_m, surface_cell_m});
  object.surface.vertices_m.rowwise() += o.base_centre_m.transpose();
  stand(object, o);
  return object;
}

LabObject cube(const ObjectOptions& o) {
  LabObject object = draw("cube", o);
  constexpr double edge_m = 0.15;
  object.description = "a foam cube of 150 mm, " + standing(o);
  object.surface = box_surface(o.base_centre_m - Vec3(0.5 * edge_m, 0.5 * edge_m, 0), o.base_centre_m + Vec3(0.5 * edge_m, 0.5 * edge_m, edge_m), 30);
  stand(object, o);
  size_pushes(object, 0.025);
  for (const double x : {-0.02, 0.03})
    object.sites.push_back(site(object, o, x < 0 ? "top" : "top aside", {x, 0, edge_m}, -Vec3::UnitZ()));
  make_pressable_block(object, o, Vec3::Constant(edge_m));
  return object;
}

LabObject ball(const ObjectOptions& o) {
  const Vec3 centre(0, 0, 0.052);
  LabObject object = shaped("ball", o, [&](const Vec3& p) { return (p - centre).norm() - 0.06; }, {-0.07, -0.07, 0}, {0.07, 0.07, 0.12});
  object.description = "a ball of 120 mm with a flattened foot, " + standing(o);
  size_pushes(object, 0.018);
  object.sites = {site(object, o, "top", centre, -Vec3::UnitZ()), site(object, o, "slanted", centre, {0.5, 0, -0.866})};
  make_pressable(object, o);
  return object;
}

// Stout enough: a pad's dead load of the usual depth on its end is two fifths of what would buckle it.
LabObject bar(const ObjectOptions& o) {
  LabObject object = draw("bar", o, 10);
  object.description = "an upright bar of 80 x 80 x 160 mm, " + standing(o);
  object.surface = box_surface(o.base_centre_m - Vec3(0.04, 0.04, 0), o.base_centre_m + Vec3(0.04, 0.04, 0.16), 20);
  stand(object, o);
  size_pushes(object, 0.015);
  object.sites = {site(object, o, "side", {-0.04, 0, 0.125}, {0.866, 0, -0.5}, 0.12),
                  site(object, o, "end", {0.005, 0, 0.16}, -Vec3::UnitZ(), 0.5)};
  if (o.region_ratio != 1) {
    object.regions = {region(o, "upper", o.region_ratio * object.young_modulus_pa, {{Vec3(-1, -1, 0.08), Vec3(1, 1, 1)}}),
                      region(o, "lower", object.young_modulus_pa)};
  }
  make_pressable_block(object, o, Vec3(0.08, 0.08, 0.16));
  return object;
}

// A sitting plush bear that faces -y.
double bear_body(const Vec3& p) {
  const Vec3 mirrored(std::abs(p.x()), p.y(), p.z());
  double d = ellipsoid(p, {0, 0, 0.058}, {0.058, 0.052, 0.066});
  d = smooth_union(d, ellipsoid(p, {0, -0.004, 0.155}, {0.047, 0.043, 0.042}), 0.03);
  d = smooth_union(d, ellipsoid(p, {0, -0.045, 0.147}, {0.018, 0.016, 0.015}), 0.012);                        // snout
  d = smooth_union(d, ellipsoid(mirrored, {0.036, 0, 0.19}, {0.016, 0.01, 0.016}), 0.01);                      // ears
  d = smooth_union(d, capsule(mirrored, {0.05, -0.005, 0.1}, {0.082, -0.03, 0.06}, 0.018), 0.015);             // arms
  return smooth_union(d, capsule(mirrored, {0.035, -0.025, 0.02}, {0.052, -0.085, 0.02}, 0.024), 0.02);        // legs
}

LabObject bear(const ObjectOptions& o) {
  LabObject object = shaped("bear", o, bear_body, {-0.12, -0.13, 0}, {0.12, 0.08, 0.22});
  object.description = "a sitting plush bear of 200 mm, " + standing(o);
  size_pushes(object, 0.015);
  object.sites = {site(object, o, "head", {0, -0.004, 0.155}, -Vec3::UnitZ(), 0.7),
                  site(object, o, "belly", {0, 0, 0.075}, {0, 0.866, -0.5}, 0.5),
                  site(object, o, "back", {0, 0.02, 0.08}, {0, -0.5, -0.866})};
  if (o.region_ratio != 1) {
    object.regions = {region(o, "head", o.region_ratio * object.young_modulus_pa, {{Vec3(-1, -1, 0.118), Vec3(1, 1, 1)}}),
                      region(o, "back", object.young_modulus_pa / o.region_ratio, {{Vec3(-1, 0.004, -1), Vec3(1, 1, 0.118)}}),
                      region(o, "belly", object.young_modulus_pa)};
  }
  make_pressable(object, o);
  return object;
}

// A four-legged animal that looks along -x.
double animal_body(const Vec3& p) {
  const Vec3 mirrored(p.x(), std::abs(p.y()), p.z());
  double d = capsule(p, {-0.05, 0, 0.1}, {0.06, 0, 0.1}, 0.042);
  for (const double x : {-0.058, 0.064}) d = smooth_union(d, capsule(mirrored, {x, 0.026, 0.09}, {x, 0.03, -0.03}, 0.017), 0.02);
  d = smooth_union(d, capsule(p, {-0.07, 0, 0.115}, {-0.105, 0, 0.145}, 0.024), 0.025);
  d = smooth_union(d, ellipsoid(p, {-0.125, 0, 0.15}, {0.034, 0.024, 0.024}), 0.015);
  return smooth_union(d, ellipsoid(mirrored, {-0.105, 0.024, 0.172}, {0.008, 0.016, 0.012}), 0.008);  // ears
}

LabObject animal(const ObjectOptions& o) {
  LabObject object = shaped("animal", o, animal_body, {-0.18, -0.07, 0}, {0.13, 0.07, 0.21});
  object.description = "a soft animal of 280 mm on four legs, " + standing(o);
  size_pushes(object, 0.015);
  object.sites = {site(object, o, "back", {0.0, 0, 0.1}, -Vec3::UnitZ(), 0.6), site(object, o, "flank", {0.03, 0, 0.1}, {0, 0.5, -0.866}, 0.4)};
  make_pressable(object, for_thin_parts(o));
  return object;
}

// No solid: E is the skin's, and a solid model finds an apparent modulus at most.
LabObject balloon(const ObjectOptions& o) {
  if (o.wall || o.stands != ContactLaw::bonded) throw Error("is glued to the table, without a wall", "balloon");
  if (o.punch) throw Error("is pressed by a soft pad only", "balloon");
  if (o.poisson_ratio || o.material != ObjectOptions{}.material || o.region_ratio != 1)
    throw Error("is an incompressible skin of one stiffness: it takes no Poisson ratio, no other law and no regions", "balloon");
  LabObject object = draw("balloon", o, 60);
  object.description = "a balloon of 150 mm, a skin of 0.3 mm stretched to twice its size, glued to the table at its foot";
  object.state = RestState::under_pressure;
  object.material = "neo_hookean";
  object.extra.clear();
  object.poisson_ratio = 0.5;
  PressedBalloonOptions balloon;
  balloon.young_modulus_pa = object.young_modulus_pa;
  balloon.base_centre_m = o.base_centre_m;
  object.pad_radius_m = balloon.pad_radius_m;
  object.travel_limit_m = 0.5 * object.pad_radius_m;
  PressedBalloon trial(balloon);
  object.surface = trial.surface();
  stand(object, o);
  object.sites = {site(object, o, "top", {0, 0, 0.1}, -Vec3::UnitZ())};
  // A short touch says how stiff it is, and the spring is nearly straight.
  const double touch_n = 0.01 * trial.pressure_pa() * EIGEN_PI * object.pad_radius_m * object.pad_radius_m;
  trial.press(touch_n);
  object.force_step_n = std::max(0.1, std::round(2.5 * touch_n / trial.travel_m() * object.travel_limit_m) / 10);
  object.press = [balloon, top = object.sites[0]](const PushSite& at) -> std::unique_ptr<Pressed> {
    if ((at.contact_m - top.contact_m).norm() > 1e-6 || (at.direction - top.direction).norm() > 1e-6)
      throw Error("can be pressed at its top only, straight down", "balloon");
    return std::make_unique<PressedBalloon>(balloon);
  };
  return object;
}

constexpr std::array<BuiltInObject, 6> table_of_objects{{
    {"cube", "foam cube of 150 mm, pressed from above at two sites", cube, {0.5, 0.9}},
    {"ball", "ball of 120 mm, from above and slanted", ball, {0.5, 0.9}},
    {"bar", "upright bar of 80 x 80 x 160 mm and ten times the stiffness, at its side and its end", bar, {0.5, 0.9}},
    {"bear", "sitting plush bear of 200 mm: head, belly, back", bear, {0.4, 1}},
    {"animal", "animal of 280 mm on four legs: back, flank", animal, {0.4, 1}},
    {"balloon", "inflated skin of 150 mm, at its top: it has an apparent modulus only", balloon, {0.6, 0.7}},
}};

constexpr std::array<std::string_view, 2> with_regions{"bar", "bear"};

// Before anything is made: a ratio that changes nothing would be believed to have.
void check_regions(std::string_view name, const ObjectOptions& o) {
  if (o.region_ratio == 1 || std::find(with_regions.begin(), with_regions.end(), name) != with_regions.end()) return;
  throw Error("must be 1 for " + std::string(name) + ", which is of one stiffness; objects with regions are: bar, bear", "ObjectOptions.region_ratio");
}

LabObject looking(LabObject object, const ObjectOptions& o, const Look& usual) {
  object.look = {o.albedo.value_or(usual.albedo), o.texture.value_or(usual.texture)};
  return object;
}

// From the foot: the middle where something is below it, else (a ring, a crooked thing) the highest facet that looks up.
Vec3 above_middle_or_highest(const LabObject& object, const ObjectOptions& o) {
  const Points& v = object.surface.vertices_m;
  const double above_m = v.col(2).maxCoeff() + 1;
  const Vec3 middle(o.base_centre_m.x(), o.base_centre_m.y(), above_m);
  if (geometry::TriangleTree(object.surface).cast(middle, -Vec3::UnitZ())) return {0, 0, 0};
  Vec3 highest = v.row(0);
  double best_m = -std::numeric_limits<double>::infinity();
  for (Index t = 0; t < object.surface.triangles.rows(); ++t) {
    const Vec3 a = v.row(object.surface.triangles(t, 0)), b = v.row(object.surface.triangles(t, 1)), c = v.row(object.surface.triangles(t, 2));
    const Vec3 centre = (a + b + c) / 3;
    constexpr double looks_up = 0.8;
    if (centre.z() <= best_m || (b - a).cross(c - a).normalized().z() < looks_up) continue;
    best_m = centre.z();
    highest = centre;
  }
  return highest - o.base_centre_m;
}

}  // namespace

PressedObjectOptions pressed_options(const LabObject& object, const ObjectOptions& o) {
  PressedObjectOptions pressed;
  pressed.surface = object.surface;
  pressed.supports = object.supports;
  pressed.pad_radius_m = object.pad_radius_m;
  pressed.punch = object.punch;
  pressed.material = object.material;
  pressed.young_modulus_pa = object.young_modulus_pa;
  pressed.poisson_ratio = object.poisson_ratio;
  pressed.extra = object.extra;
  pressed.tetrahedra = o.tetrahedra;
  pressed.cells_in_radius = o.cells_in_radius;
  pressed.regions = object.regions;
  return pressed;
}

std::unique_ptr<Pressed> press_at(PressedObjectOptions options, const PushSite& at) {
  options.contact_m = at.contact_m;
  options.direction = at.direction;
  return std::make_unique<PressedObject>(options);
}

PushSite place_on(const LabObject& object, const std::string& name, const Vec3& aim_m, const Vec3& direction, double stiffness) {
  ObjectOptions o;
  o.base_centre_m = object.foot_m;
  return site(object, o, name, aim_m, direction, stiffness);
}

std::span<const BuiltInObject> built_in_objects() { return table_of_objects; }

LabObject make_object(std::string_view name, const ObjectOptions& options) {
  std::string names;
  for (const BuiltInObject& row : table_of_objects) {
    if (row.name == name) check_regions(name, options);
    if (row.name == name) return looking(row.make(options), options, row.look);
    names += (names.empty() ? "" : ", ") + std::string(row.name);
  }
  throw Error("is no object of the lab (there are: " + names + ") and no mesh file", "object " + std::string(name));
}

TriMesh turned_and_scaled(TriMesh surface, int up, double size_m) {
  if (up < 0 || up > 2) throw Error("must be 0, 1 or 2", "up");
  if (!(size_m >= 0)) throw Error("must not be negative", "size_m");
  if (up != 2) {  // a cyclic change of axes is a rotation
    const Points before_m = surface.vertices_m;
    for (int k = 0; k < 3; ++k) surface.vertices_m.col(k) = before_m.col((up + 1 + k) % 3);
  }
  const Vec3 extent_m = (surface.vertices_m.colwise().maxCoeff() - surface.vertices_m.colwise().minCoeff()).transpose();
  if (size_m > 0 && extent_m.maxCoeff() > 0) surface.vertices_m *= size_m / extent_m.maxCoeff();
  return surface;
}

LabObject object_from_surface(const TriMesh& surface, const std::string& name, const ObjectOptions& options) {
  const auto check = geometry::check_surface(surface);
  if (!check.watertight()) throw Error("must be closed and consistently oriented; `palpate model` repairs a surface", name);
  const Vec3 extent = check.max_m - check.min_m;
  if (!(extent.minCoeff() > 0.02 && extent.maxCoeff() < 0.5))
    throw Error("must be between 2 cm and 50 cm large; are its units metres? Scale it first", name + ": extent_m");
  check_regions("the surface " + name, options);
  LabObject object = draw(name, options);
  object.description = "the surface " + name + ", " + standing(options);
  object.surface = surface;
  const Vec3 foot(0.5 * (check.min_m.x() + check.max_m.x()), 0.5 * (check.min_m.y() + check.max_m.y()), check.min_m.z());
  object.surface.vertices_m.rowwise() += (options.base_centre_m - foot).transpose();
  if (options.stands == ContactLaw::bonded) {
    Support glue;  // what lies lower than a fifteenth of its height: few shapes stand on a plane
    glue.kind = SupportKind::box;
    glue.name = "table";
    glue.box_min_m = options.base_centre_m - Vec3(extent.x(), extent.y(), 0.01);
    glue.box_max_m = options.base_centre_m + Vec3(extent.x(), extent.y(), extent.z() / 15);
    object.supports.push_back(glue);
    if (options.wall) throw Error("can be glued to the table only: no flat side of it is known", name + ", wall");
  } else {
    stand(object, options);
  }
  size_pushes(object, 0.12 * extent.minCoeff());
  object.sites = {site(object, options, "top", above_middle_or_highest(object, options), -Vec3::UnitZ())};
  make_pressable(object, for_thin_parts(options));
  return looking(std::move(object), options, {});
}

}  // namespace palpate::lab
