// SPDX-License-Identifier: Apache-2.0
// Objects that the lab makes by itself, standing on its table, each with places to push; and any closed surface of a user's.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/lab/look.hpp"
#include "palpate/lab/pressed.hpp"
#include "palpate/lab/pressed_object.hpp"

namespace palpate::lab {

struct PushSite {
  std::string name;
  Vec3 contact_m = Vec3::Zero();  ///< on the surface at rest, base frame
  Vec3 direction = -Vec3::UnitZ();
  double stiffness = 1;  ///< about, over that of a half space of the same stuff: thin parts give way as a whole
};

/// What the truth is made of; what is not given is drawn from the seed.
struct ObjectOptions {
  std::uint64_t seed = 1;
  std::optional<double> young_modulus_pa;            ///< drawn log-uniformly from 10 to 40 kPa
  std::optional<double> poisson_ratio;               ///< drawn uniformly from 0.1 to 0.45 ...
  int poisson_steps = 1000;                          ///< ... and rounded to a whole number of one in so many
  std::string material = "neo_hookean";              ///< a law of the solver's table
  std::vector<double> extra;                         ///< its further parameters, in the table's order; empty = their initial values
  double region_ratio = 1;                           ///< of an object with regions: their stiffnesses differ by this factor
  Vec3 base_centre_m = Vec3(0.6, 0.0, 0.0);          ///< of the object's foot on the table, base frame
  /// How it stands on the table, and at the wall if there is one: glued, or only pushed against them. Without friction its place
  /// on the table is anybody's guess: nothing holds it there.
  ContactLaw stands = ContactLaw::bonded;
  double friction_coefficient = 0.6;                 ///< with ContactLaw::friction
  /// An upright wall behind the object, at its outermost points along x; a site more pushes towards it.
  bool wall = false;
  bool punch = false;                                ///< a stiff flat face presses, not a soft pad: contact is solved for
  std::optional<double> albedo, texture;             ///< to a camera (Look); not given: as the object usually is
  Index tetrahedra = 20000;                          ///< of the true mesh; a block's feet ask for more, thin legs and a user's
                                                     ///< shape for twice as many
  int cells_in_radius = 5;                           ///< edges across the pad's radius
};

struct LabObject {
  std::string name, description;
  TriMesh surface;  ///< what the recording says about its shape at rest, base frame
  Vec3 foot_m = Vec3::Zero();  ///< on the table, base frame
  RestState state = RestState::stress_free;
  std::vector<Support> supports;
  std::vector<PushSite> sites;
  double pad_radius_m = 0.02;
  bool punch = false;          ///< not a soft pad but a stiff flat face of that radius
  double travel_limit_m = 0.01;  ///< as deep as its own truth bears under a soft pad
  double force_step_n = 1;       ///< a quarter of about the force that this takes at a site of stiffness 1, ...
  /// ... and at another: what a first trial push would tell.
  double force_step_at(const PushSite& site) const { return site.stiffness * force_step_n; }
  // The truth; nothing that estimates reads it.
  Look look;
  std::string material;
  double young_modulus_pa = 0, poisson_ratio = 0;
  std::vector<double> extra;
  std::vector<TrueRegion> regions;  ///< empty: one stiffness everywhere
  std::function<std::unique_ptr<Pressed>(const PushSite&)> press;
};

/// Where a straight push along `direction` through `aim_m`, given from the object's foot, first meets its surface.
/// @throws Error when it passes the object by.
PushSite place_on(const LabObject& object, const std::string& name, const Vec3& aim_m, const Vec3& direction, double stiffness = 1);

/// The object's truth as it is solved for anywhere, but for the place of the push; and pressed there.
PressedObjectOptions pressed_options(const LabObject& object, const ObjectOptions& options);
std::unique_ptr<Pressed> press_at(PressedObjectOptions options, const PushSite& at);

struct BuiltInObject {
  std::string_view name;
  std::string_view summary;
  LabObject (*make)(const ObjectOptions&);
  Look look;
};

/// The table that --help and the tests loop over.
std::span<const BuiltInObject> built_in_objects();

/// @throws Error listing the names when there is none of that name, or naming the option that is out of range.
LabObject make_object(std::string_view name, const ObjectOptions& options = {});

/// Turned so that what was along `up` (0, 1, 2: x, y, z) is along z, and scaled to this longest extent (0: as it is).
TriMesh turned_and_scaled(TriMesh surface, int up, double size_m);

/// A user's closed surface (metres), put with its lowest point and middle at the table's place; glued, what lies in the lowest
/// fifteenth of its height is held. Pushed from above at its top.
/// @throws Error when it is not closed or not between 2 cm and 50 cm large.
LabObject object_from_surface(const TriMesh& surface, const std::string& name, const ObjectOptions& options = {});

}  // namespace palpate::lab
