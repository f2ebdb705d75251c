// SPDX-License-Identifier: Apache-2.0
// Energy, forces and tangent of rigid bodies touching the boundary of a mesh, by a stiff layer of stiffness k per area on
// quadrature points (Wriggers, Computational Contact Mechanics, 2006, ch. 6):
//
//   e(y) = chi(y) k/2 <-g(y)>^2 + tangential part,      y = R' (x - c) in the tool's frame
//
// All of it derives from an energy (friction: for a given limit), so that Newton's steps have a merit function.
#pragma once

#include <string>
#include <vector>

#include "palpate/fem/contact/rigid_shape.hpp"
#include "palpate/fem/contact/surface_points.hpp"

namespace palpate::fem {

enum class Touch {
  frictionless,
  friction,  ///< Coulomb: |tangential| <= friction_coefficient * pressure
  sticking,  ///< what touches does not slide; it may come off
  bonded,    ///< what touches at the start is glued, also against pulling
};

/// Tangential memory and friction limits of one rigid body, one entry a surface point (empty for frictionless).
struct TouchMemory {
  std::vector<Vec3> anchor_m;    ///< tool frame: where the point sticks
  std::vector<Vec3> normal;      ///< of the shape at the anchor
  std::vector<double> limit_pa;  ///< largest tangential traction; infinite: sticks
  std::vector<char> touching;    ///< 0: no, 1: sticks, 2: slides
};

/// A rigid body as the terms see it.
struct TouchingBody {
  const RigidShape* shape = nullptr;
  Touch law = Touch::frictionless;
  Pose T_base_tool = Pose::Identity();
  const TouchMemory* memory = nullptr;  ///< needed but for frictionless
  double stiffness_pa = 0;              ///< k times the size of a face
  const std::vector<double>* seat_m = nullptr;  ///< a surface point: gap at the start that counts as none; nullptr: no point
};

/// Derivatives to the tool's twist q = (translation of the tip, rotation about the tip), base axes.
struct ToolTerms {
  Vec6 gradient = Vec6::Zero();  ///< dE/dq: the wrench of the tool on the object
  Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();  ///< d(gradient)/dq
  MatrixX coupling;                                                           ///< 3n x 6: d(nodal forces)/dq
};

class ContactTerms {
 public:
  ContactTerms(const TetMesh& mesh, const BlockPattern& pattern, int per_edge);

  /// The layer is as much stiffer as what lies behind it. @param region  an element: its region
  void set_regions(const std::vector<int>& region, const VectorX& stiffness);
  /// Adds what each region's surface has of forces (3n x r) and of the tool's gradient (6 x r).
  void forces_by_region(const TouchingBody& body, const VectorX& u, MatrixX& forces, MatrixX& gradients) const;

  const SurfacePoints& points() const { return points_; }
  Vec3 position(const VectorX& u, Index face, int point) const;

  /// Adds the nodal forces dE/du (3n) and the tool's gradient; returns the energy.
  /// @param rounding2_n2  adds the squared norm of what the rounding of positions does to the forces
  double energy_and_forces(const TouchingBody& body, const VectorX& u, VectorX& forces, Vec6& gradient,
                           double* rounding2_n2 = nullptr) const;
  /// Adds the tangent to the blocks and fills the tool's terms. @param convex  leaves out what bends the wrong way (deep
  /// penetration of a curved tool), far from the solution
  void tangent(const TouchingBody& body, const VectorX& u, bool convex, BlockValues& blocks, ToolTerms& tool) const;
  /// d(nodal forces)/d radius (3n) and d(gradient)/d radius at fixed anchors and friction limits.
  void d_radius(const TouchingBody& body, const VectorX& u, VectorX& forces, Vec6& gradient) const;
  /// What touches with a memory (friction, sticking, bonded), for derivatives along a path (contact_path.hpp).
  struct Held {
    Index face = 0;
    int point = 0;
    std::size_t index = 0;         ///< of the point in TouchMemory
    double weight_m2 = 0;
    double stiffness_pa_m = 0;     ///< of the layer, per area
    Vec3 arm_m = Vec3::Zero();     ///< from the tip, base axes
    Vec3 y_m = Vec3::Zero();       ///< tool frame
    Vec3 anchor_m = Vec3::Zero(), normal = Vec3::Zero();  ///< where it sticks, tool frame
    Vec3 across = Vec3::Zero();    ///< unit tangential offset from the anchor, tool frame
    double length_m = 0;           ///< of that offset
    bool slips = false;
    double limit_pa = 0;           ///< largest tangential traction
    Vec3 pressure_slope = Vec3::Zero();  ///< d pressure / dy
    double pressure_d_radius = 0;
  };
  std::vector<Held> held(const TouchingBody& body, const VectorX& u) const;
  /// d(unit normal of the shape)/dy and /d radius at a place that stands for a piece of this face.
  Mat3 normal_slope(const TouchingBody& body, Index face, const Vec3& y) const;
  Vec3 normal_d_radius(const TouchingBody& body, Index face, const Vec3& y) const;
  /// Points that lie within `reach_m` of the body's surface are glued to where they are.
  TouchMemory bond(const TouchingBody& body, const VectorX& u, double reach_m) const;
  /// Memory at the start of an increment: points that do not touch will slide from where they are now.
  void begin_increment(const TouchingBody& body, const VectorX& u, TouchMemory& memory) const;
  /// Friction limits from the present pressures; returns the largest change of force, newton.
  double update_limits(const TouchingBody& body, const VectorX& u, double friction, TouchMemory& memory) const;
  /// Gaps at the start of points that lie within `reach_m` of the body's surface or inside it, else 0 (TouchingBody::seat_m).
  std::vector<double> seats(const TouchingBody& body, double reach_m) const;
  /// At the end of an increment: anchors follow what has slipped (return map).
  void end_increment(const TouchingBody& body, const VectorX& u, TouchMemory& memory) const;

  struct Patch {
    Points points_m;      ///< present positions of touching points
    VectorX pressure_pa;  ///< per rest area
    VectorX area_m2;      ///< present area that each stands for
    double penetration_m = 0;
    double layer_energy_j = 0;  ///< of the normal compression
    int slipping = 0;
  };
  Patch patch(const TouchingBody& body, const VectorX& u) const;

 private:
  struct Sample {
    Vec3 gradient;  // of the energy density to y
    Mat3 hessian;
    double energy = 0, pressure = 0, gap = 0;
    bool slips = false;
  };
  /// Stiffness of the layer per area, Pa/m.
  double layer_pa_m(const TouchingBody& body, Index face) const {
    return body.stiffness_pa * (harder_.empty() ? 1 : harder_[static_cast<std::size_t>(face)]) / points_.face_size_m(face);
  }
  template <typename Outward>
  bool sample(const TouchingBody& body, Index face, int point, const Vec3& y, const Outward& outward_of, bool with_hessian,
              Sample& out) const;
  bool shape_at(const TouchingBody& body, Index face, int point, const Vec3& y, ShapePoint& out) const;
  template <typename Visit>
  void for_each_candidate(const TouchingBody& body, const VectorX& u, Visit&& visit) const;
  template <int nodes, typename Visit>
  void for_each_candidate_of(const TouchingBody& body, const VectorX& u, Visit&& visit) const;
  template <typename Visit>
  void for_each_touching(const TouchingBody& body, const VectorX& u, Visit&& visit, bool with_hessian = false) const;

  Points rest_m_;
  SurfacePoints points_;
  std::vector<int> region_;     // a face; empty: one
  std::vector<double> harder_;  // a face: its region's stiffness
};

}  // namespace palpate::fem
