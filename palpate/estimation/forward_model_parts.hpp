// SPDX-License-Identifier: Apache-2.0
// What the parts of ForwardModel share: bodies, coefficients of loads and what is seen of a body. Not for other files.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "palpate/estimation/forward_model.hpp"
#include "palpate/fem/linear_response.hpp"

namespace palpate::estimation {

/// Loads of one key share their columns: tool and contact.
std::string key_of(const Load& load);

/// Tools whose motion is prescribed in a push.
std::set<std::string> driven_tools(const Push& push);

/// True for a tool that touches at Load::contact_m, which may then be elsewhere than thought.
bool has_place(const Recording& recording, const Load& load);

struct ForwardModel::Body {
  std::map<std::string, int> force_column;   // of a load's key: first of three; of nine where the contact may have shifted
  std::map<std::string, int> motion_column;  // of a platen
  int gravity_column = -1;
  MatrixX free_motions;
  Eigen::SparseMatrix<double> forces;
  std::unique_ptr<fem::Statics> statics;
  std::unique_ptr<fem::LinearResponse> response;  // linear materials only: surface rows, then the forces' own (3 a load)
};

struct ForwardModel::Coefficients {
  VectorX force, motion;
  std::vector<int> columns;   // unknowns other than log E and nu that force or motion depend on
  MatrixX d_force, d_motion;  // coefficients x columns
};

/// Surface displacements, mean motions under the forces' columns (work-conjugate) and platens' reactions, with derivatives
/// to log E, nu and the unknowns of Coefficients.
struct ForwardModel::Watched {
  VectorX moved_m, conjugate_m, reaction_n;
  MatrixX d_moved, d_conjugate, d_reaction;
};

struct ForwardModel::Memory {
  bool valid = false;
  VectorX unknowns;
  VectorX displacement_m;
  std::vector<int> columns;
  MatrixX derivative;  // 3n x columns, object frame
  Watched watched;     // with derivatives where there are columns
  int inverted_elements = 0;

  VectorX change_to(const VectorX& there) const;  // of the columns' unknowns
};

/// Where a load acts: its columns, and the derivatives of those to a shift of the contact along two tangents.
struct ForwardModel::LoadParts {
  int first = -1;                 // of the columns; -1: this load has none
  int shift_unknown = -1;         // first of two, or -1
  std::vector<double> weight{1};  // of each three columns: 1, shift, shift
};

}  // namespace palpate::estimation
