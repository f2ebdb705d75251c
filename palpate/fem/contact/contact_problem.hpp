// SPDX-License-Identifier: Apache-2.0
// What ContactStatics is made of: one state of body and tools, its residual and tangent, Newton's method on both together.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "palpate/fem/assembly.hpp"
#include "palpate/fem/contact_statics.hpp"
#include "palpate/fem/reduced_system.hpp"

namespace palpate::fem {

/// Body and tools of one set of parameters and loads.
struct ContactProblem {
  Moduli m;
  VectorX external;    // F a
  VectorX prescribed;  // P_c M b
  VectorX wrench;      // A' w of all contacts, one after the other
};

struct ContactState {
  VectorX u;
  std::vector<Pose> poses;
  VectorX travelled;  // z, summed (work of the wrenches)
  VectorX internal;   // forces of the body's strain
  VectorX touching;   // forces of the contacts
  std::vector<Vec6> gradients;
  double energy = 0, residual = 0;
  double tool_residual = 0;  // its part of tools along their free axes, over the largest force of a tool
  double scale_n = 0;        // of the nodes' part
  double tool_scale_n = 0;
  double rounding_n = 0;   // what positions in double precision leave of forces; no step brings the residual lower
  double rounding_j = 0;   // of energy: differences below say nothing
  VectorX unbalanced;       // free part of internal + touching - external
  VectorX unbalanced_tool;  // A' dE/dq - A' w
  int inverted = 0;
};

/// True where forces balance to `tolerance`, or as far as rounding lets them (times `roundings`).
inline bool is_settled(const ContactState& s, double tolerance, double roundings = 1) {
  const double left_n = roundings * s.rounding_n;
  return s.unbalanced.norm() <= std::max(tolerance * s.scale_n, left_n) &&
         s.tool_residual * s.tool_scale_n <= std::max(tolerance * s.tool_scale_n, left_n);
}

/// Tangent of body and tools; tool rows and columns along free axes only.
struct ContactTangent {
  BlockValues blocks;            // body and contacts
  std::vector<ToolTerms> tools;  // along all six axes
  MatrixX coupling;              // 3n x z
  MatrixX tool;                  // z x z
};

class ContactSystem {
 public:
  ContactSystem(const TetMesh& mesh, const std::string& material, Boundary boundary, std::vector<RigidContact> contacts,
                ContactOptions options);

  void set_region_stiffness(const VectorX& stiffness);
  void set_region_poisson(const VectorX& poisson);
  TouchingBody body(std::size_t contact, const Moduli& m, const Pose& pose, const std::vector<TouchMemory>& memory) const;
  ContactProblem problem(double young, double poisson, const ContactLoads& loads, const VectorX& extra) const;
  /// False where the law does not exist.
  bool evaluate(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s) const;
  void tangent(const ContactProblem& p, const std::vector<TouchMemory>& memory, const ContactState& s, bool convex,
               ContactTangent& t);
  /// @param proximal  added to every diagonal, over their mean: holds rigid motions that nothing holds
  bool factorise(const ContactTangent& t, double shift, double proximal);
  bool has_factor() const { return has_factor_; }  ///< of the last tangent that was factorised
  void forget_factor() { has_factor_ = false; }
  /// Solves [K C; C' D] [du; dz] = [ru; rz] with the last factor; refines where proximal terms were added.
  /// @param definite  Newton's method: a tool without stiffness gets some; false: as it is (sensitivities)
  void solve(const ContactTangent& t, const MatrixX& ru, const MatrixX& rz, bool definite, MatrixX& du, MatrixX& dz) const;
  /// Newton's method; an empty reason when it converged. @param tolerance  0: that of the options, else few
  /// steps are taken towards it
  std::string newton(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s,
                     ContactEquilibrium& out, double tolerance = 0);
  /// A few steps with a layer not much stiffer than the body: from a tool put deep into it to a patch that is nearly right.
  void soften_start(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s,
                    ContactEquilibrium& out);
  /// Moves a tool that touches nothing along its wrench until it does. False: it never meets the object.
  bool approach(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s) const;
  /// Moves the tools by dz along their free axes.
  void move(ContactState& s, const VectorX& dz) const;

  TetMesh mesh;
  const MaterialLaw& law;
  ContactOptions options;
  Assembly assembly;
  Boundary boundary;
  bool floating;  // supports leave rigid motions to the contacts
  ReducedSystem system;
  ContactTerms terms;
  std::vector<RigidContact> contacts;
  double softest = 0;             // bound of the layers' stiffness at a soft start, 0: none
  std::vector<Index> first_axis;  // of a contact in z, and the total
  MatrixX motions;
  double diameter_m = 0;
  double volume_m3 = 0;
  double element_area_m2 = 0;  // norm over the elements: what a stress in each of them gives in nodal forces

 private:
  std::string iterate(const ContactProblem& p, const std::vector<TouchMemory>& memory, ContactState& s,
                      ContactEquilibrium& out, double tolerance, int max_steps);
  std::vector<std::vector<double>> seats_;  // a contact; empty: none
  BlockValues body_blocks_;  // of a linear law, at linear_
  Moduli linear_;
  mutable BlockValues shifted_;
  double proximal_ = 0, diagonal_ = 0;
  bool has_factor_ = false;
};

/// The pose moved by a twist: tip translated, rotated about the tip.
Pose moved(const Pose& pose, const Vec6& twist);

}  // namespace palpate::fem
