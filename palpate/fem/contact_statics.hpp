// SPDX-License-Identifier: Apache-2.0
// Static equilibrium of a body that touches rigid ones: tools, tables, walls, platens. The patch is found, not given.
//
//   min over u, z of  W(u; E, nu) - a' F' u + sum of contact energies - wrenches' tool motion
//
// where z are the motions of tools along their free axes. Contact is a layer on the surface's quadrature points whose
// stiffness is `stiffness` E over the size of a face; the penetration that is left is reported. The contact energy is
// proportional to E, so under prescribed poses alone u does not depend on E, exactly.
#pragma once

#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "palpate/fem/contact/contact_terms.hpp"
#include "palpate/fem/contact/rigid_shape.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {

struct RigidContact {
  std::string name;
  RigidShapePtr shape;
  Pose T_base_tool = Pose::Identity();  ///< at zero motion; z into the object (tool_pose)
  Touch law = Touch::frictionless;
  double friction_coefficient = 0;
  /// 6 x m twists (translation of the tip, rotation about it; base axes) along which the tool moves until it balances its
  /// wrench; no columns: the pose is prescribed and the wrench is the answer.
  MatrixX free_axes = MatrixX(6, 0);
  double stiffness = 0;        ///< 0: that of the options
  /// Above zero: what lies this near to the shape at the start, or inside it, just touches it there: gap and force are zero.
  /// A mesh is a little uneven; one vertex that reaches into the table would else lift a stiff object off the rest of its foot.
  double seat_m = 0;
  double bond_reach_m = 1e-6;  ///< Touch::bonded: what lies this near to the shape at the start is glued
};

/// Free axes of a tool that slides along its push direction, or moves with a held orientation.
MatrixX along(const Vec3& direction);
MatrixX any_translation();

struct ContactLoads {
  VectorX force_coefficients, motion_coefficients;  ///< of the boundary's columns, as in Statics
  /// One a contact: translation of its tip (m) and rotation vector (rad) from T_base_tool, base axes. Motion along free axes
  /// is only a start.
  std::vector<Vec6> motion;
  std::vector<Vec6> wrench;  ///< one a contact: force and torque about the tip on the object; acts along free axes
};

struct ContactOptions {
  StaticsOptions statics;
  /// Of the layer, times E over the size of a face. Softer: more of the travel is the layer's (TouchResult::layer_m); much
  /// stiffer: points under a rim that runs through a face hold more than the face can follow, and the contact is too stiff.
  double stiffness = 50;
  int points_per_edge = 4;  ///< faces are cut into this number squared of triangles of three points
  int increments = 1;       ///< parts that a load step is cut into; friction and sticking depend on the path
  int max_halvings = 8;     ///< of an increment that does not converge
  int max_friction_rounds = 60;
  double friction_tolerance = 1e-7;  ///< change of the friction limits' sum over the largest force
};

/// What one rigid body does in an equilibrium.
struct TouchResult {
  Pose T_base_tool = Pose::Identity();
  Vec6 wrench = Vec6::Zero();  ///< of the tool on the object: force, torque about the tip; base axes
  double area_m2 = 0;          ///< of the deformed surface in contact
  double penetration_m = 0;    ///< largest
  double layer_m = 0;  ///< mean compression of the layer, weighted with the pressure (see layer_travel_m)
  int active_points = 0, slipping_points = 0;
  Points patch_m;  ///< active points, present positions
  VectorX patch_pressure_pa;
};

/// End of one increment, for derivatives.
struct ContactIncrement {
  double share = 0;  ///< of the load step, 0 at its start
  ContactLoads loads;
  VectorX displacement_m;
  std::vector<Pose> poses;
  std::vector<TouchMemory> memory;  ///< anchors as the increment began with them, friction limits as it ended
};

struct ContactEquilibrium {
  VectorX displacement_m;  ///< 3n
  double young_modulus_pa = 0, poisson_ratio = 0;
  VectorX extra;
  ContactLoads loads;
  std::vector<TouchResult> touches;  ///< one a contact
  VectorX motion_reaction;           ///< as in Equilibrium
  bool converged = false;
  std::string reason;
  int newton_steps = 0, factorisations = 0;
  int increments = 0;            ///< of this step
  int increments_from_rest = 0;  ///< of all steps of the sequence
  int inverted_elements = 0;
  double residual = 0;
  /// What the rounding of positions leaves of the residual: a stiff layer feels the last digit of a place. Where it is above
  /// the tolerance, the equilibrium is known to this share of the forces only.
  double rounding = 0;
  std::shared_ptr<const std::vector<TouchMemory>> memory;  ///< what the next step of a sequence starts from
  /// Where this load step started, and its increments (the last one alone where nothing depends on the path).
  std::shared_ptr<const std::vector<ContactIncrement>> path;
};

/// Derivatives of one load step's loads, and of E, nu, radii and the layers' stiffness, to q parameters.
struct ContactLoadsAlong {
  VectorX log_young, poisson, log_layer;            ///< q; log_layer: of all contacts together
  MatrixX log_stiffness;                            ///< a region x q; no rows where there is one region
  MatrixX region_poisson;                           ///< a region x q; no rows where none has its own
  MatrixX force_coefficients, motion_coefficients;  ///< rows as in ContactLoads, q columns
  std::vector<MatrixX> motion, wrench;              ///< 6 x q, one a contact
  std::vector<VectorX> radius;                      ///< q, one a contact
};

/// Of what points of one contact stick to, tool frame.
struct AnchorSensitivity {
  std::unordered_map<std::size_t, Index> row_of;  ///< a surface point that touches: first of three rows
  MatrixX anchor, normal;                         ///< 3 rows a point, q columns
};

/// Derivatives of a state at the end of a sequence of load steps to q parameters; handed on from step to step.
struct ContactPathSensitivity {
  MatrixX displacement;                ///< 3n x q
  std::vector<MatrixX> wrench;         ///< 6 x q, one a contact
  std::vector<MatrixX> motion;         ///< 6 x q: twist of the tool
  MatrixX motion_reaction;             ///< m x q
  std::vector<AnchorSensitivity> anchors;
  ContactLoadsAlong loads;             ///< of the step that ends here
};

/// Exact derivatives away from changes of what touches and slides. One column a parameter: log E, nu, force coefficients,
/// motion coefficients, then for every contact 6 of its pose (a shift of the tip, a rotation about it), 6 of its wrench, 1 of
/// its radius; then log of every region's stiffness.
struct ContactSensitivity {
  MatrixX displacement;         ///< 3n x p
  std::vector<MatrixX> wrench;  ///< 6 x p, one a contact
  std::vector<MatrixX> motion;  ///< 6 x p: twist of the tool (tip travel)
  MatrixX motion_reaction;      ///< m x p
  Index log_young = 0, poisson = 1, first_force = 2, first_motion = 2;
  std::vector<Index> first_pose, first_wrench, radius;  ///< one a contact; radius -1 where the shape has none
  Index first_stiffness = 2;
};

class ContactStatics {
 public:
  /// Supports may leave rigid motions free where contacts carry the loads.
  /// @throws Error as Statics, and on contacts with a missing shape or dependent free axes
  ContactStatics(const TetMesh& mesh, const std::string& material, Boundary boundary, std::vector<RigidContact> contacts,
                 ContactOptions options = {});
  ~ContactStatics();
  ContactStatics(ContactStatics&&) noexcept;
  ContactStatics& operator=(ContactStatics&&) noexcept;

  /// Solves from here on are with these (ContactOptions::statics.region). The layers are as much stiffer as what lies behind
  /// them. @throws Error unless there is one positive number a region
  void set_region_stiffness(const VectorX& stiffness);
  /// The same of StaticsOptions::region_poisson. @throws Error unless there is one in (-1, 0.5), or NaN, a region
  void set_region_poisson(const VectorX& poisson);

  /// All zeros, of the right sizes.
  ContactLoads no_loads() const;

  /// @param from   the equilibrium that this load step starts from (friction and sticking remember it); nullptr: rest
  /// @param guess  where friction or sticking remember: the same load step's end at parameters nearby (its displacement_m may
  ///               have been moved along its derivatives). Saves work; the path starts at `from` all the same.
  ContactEquilibrium solve(double young_modulus_pa, double poisson_ratio, const ContactLoads& loads,
                           const ContactEquilibrium* from = nullptr, const VectorX& extra = {},
                           const ContactEquilibrium* guess = nullptr) const;
  /// Forgets the factor that the next solution begins with, so that its digits do not depend on what was solved before.
  void forget();

  /// Of one load step from rest; of the end of any sequence where no contact remembers (frictionless, bonded).
  /// @throws Error for contacts with friction or sticking ones in a state that another one led to: use sensitivity_along
  ContactSensitivity sensitivity(const ContactEquilibrium& at) const;

  /// What the layers add to every tool's travel along its force, to first order in their compliance: subtract it for rigid
  /// surfaces. A tool that is free to move: as it moves; one with a prescribed pose: at the same force. One factorisation. (A
  /// patch that grows with the force, as a sphere's, takes less of the travel than layer_m; a punch's takes all of it.)
  /// @throws Error as `sensitivity`
  VectorX layer_travel_m(const ContactEquilibrium& at) const;

  /// All zeros, of the right sizes: loads that do not depend on q parameters, and the derivatives of the state of rest.
  ContactLoadsAlong no_loads_along(Index parameters) const;
  ContactPathSensitivity rest_along(Index parameters) const;
  /// Derivatives at the end of a load step, by the implicit function theorem in each of its increments.
  /// @param from  at its start (rest_along, or the derivatives of the state that it started from); may have fewer
  ///              parameters, of which the others come after
  ContactPathSensitivity sensitivity_along(const ContactEquilibrium& at, const ContactLoadsAlong& along,
                                           const ContactPathSensitivity& from) const;

  const std::vector<RigidContact>& contacts() const;
  const TetMesh& mesh() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::fem
