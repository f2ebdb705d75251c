// SPDX-License-Identifier: Apache-2.0
// What the parts of ForwardModel share: bodies, coefficients of loads and what is seen of a body. Not for other files.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "palpate/estimation/forward_model.hpp"
#include "palpate/estimation/rigid_tool.hpp"

namespace palpate::estimation {

/// Loads of one key share their columns: tool and contact.
std::string key_of(const Load& load);

/// Tools whose motion is prescribed in a push.
std::set<std::string> driven_tools(const Push& push);

/// True for a load whose patch may be wider or narrower than stated.
bool has_radius(const Tool& tool, const Load& load);

/// True for a tool that touches at Load::contact_m, which may then be elsewhere than thought.
bool has_place(const Recording& recording, const Load& load);

/// True where something that the object touches has friction, so that a step depends on the steps before.
bool depends_on_path(const Recording& recording);
/// True where the object touches something that only pushes.
bool has_contacts(const Recording& recording);

/// An answer of a body, and the unknowns that it is at.
struct ForwardModel::SolvedAt {
  VectorX unknowns;
  std::vector<int> columns;  // unknowns that the state's derivatives are to: the parameters, then others
  fem::ResponseState state;

  bool is_lent() const { return unknowns.size() == 0; }  // not solved for here: another model's
  bool differentiated() const { return state.solution && state.solution->derivative.cols() > 0; }
  VectorX change_to(const VectorX& there) const;  // of the columns' unknowns
  /// The displacement moved along its derivatives; as it is where they would move it by more than a fifth: a straight line is no
  /// guess for a far step.
  VectorX displacement_at(const VectorX& there) const;
};

/// Force on the object that a sensor read in this step under the load's tool; zero where none did.
Vec3 read_force_n(const Step& step, const Load& load);

/// True for a load that acts by columns of force.
bool has_columns(const Load& load);

struct ForwardModel::Body {
  struct Contact {
    int force = -1;                 // first of three columns
    int shift = -1;                 // first of six, or -1
    int along = -1;                 // of a shift along `direction`: first of three, or -1 where all pushes here go that way
    int radius = -1;                // first of three, or -1
    Vec3 direction = Vec3::Zero();  // that the six are across
    bool shifts_across(const Vec3& push) const { return shift >= 0 && (along >= 0 || push == direction); }
  };
  std::map<std::string, Contact> contacts;   // of a load's key
  std::map<std::string, int> motion_column;  // of a platen
  /// Of a rigid tool whose contact is not exactly known: it stands elsewhere from before the first step on.
  struct Standing {
    int column = -1;                // first of two motions
    Vec3 direction = Vec3::Zero();  // that they are across
  };
  std::map<std::string, Standing> standing;
  int gravity_column = -1;
  MatrixX free_motions;
  MatrixX slide, slide_conjugate;  // surface and loads of a slide along them (3v x f, columns x f); empty: none
  MatrixX slide_mean;              // the surface's mean motion along them, f x 3v
  Eigen::SparseMatrix<double> forces;
  int node_motions = 0;  // columns of platens whose nodes are moved, and of supports that spread; those of rigid tools come after
  int spreads = 0;       // of them, the last ones
  SolvedAtPtr lying;     // under its weight alone, where it was last asked for
  std::size_t lying_in = 0;  // the push whose tools stood where they stand then
  std::unique_ptr<fem::Response> response;  // the surface is watched
};

struct ForwardModel::Solved {
  // What it holds for: the object is the caller's to keep the same, but another mesh must not pass unnoticed.
  std::string material;
  Index nodes = 0, vertices = 0;
  double place_m = 0;  // sum of the nodes' coordinates
  std::size_t supports = 0, spreads = 0;
  fem::StaticsOptions options;
  double poisson_lower = 0, poisson_upper = 0, response_tolerance = 0;
  bool holds_for(const Solved& other) const;

  std::vector<std::map<std::string, std::unique_ptr<Body>>> bodies;  ///< a worker (all together: linear), by driven tools
  std::shared_ptr<const SurfaceField> field;
  double field_std_m = 0, field_correlation_m = 0;
  std::shared_ptr<const geometry::TriangleTree> rest_tree;  ///< of the surface, once somebody asked
  std::shared_ptr<const std::vector<geometry::SurfaceEdge>> surface_edges;  ///< the same
};

struct ForwardModel::Coefficients {
  VectorX force, motion;
  std::vector<int> columns;   // unknowns other than log E and nu that force or motion depend on
  MatrixX d_force, d_motion;  // coefficients x columns
};

struct ForwardModel::Memory {
  std::shared_ptr<const SolvedAt> seen;     // nothing: not solved yet; of what lies at rest: without what its weight does
  std::shared_ptr<const SolvedAt> contact;  // as the solver has it
  VectorX lent_m;                           // what a model on another mesh lent to begin with; empty: none did
};

struct ForwardModel::TrueForce {
  Vec3 force_n = Vec3::Zero();
  std::vector<std::pair<int, Vec3>> derivatives;  // an unknown, and what the force changes by with it
};

/// Where a load acts: its columns, and the derivatives of those to a shift of the contact along two tangents and to the
/// radius of its patch. An unknown may have several parts.
struct ForwardModel::LoadPart {
  int first = -1;          // of three columns
  double weight = 1;       // 1, or how far the unknown is from its mean
  int unknown = -1;        // -1: the columns themselves
  double per_unknown = 1;  // what the weight grows by with it
};

}  // namespace palpate::estimation
