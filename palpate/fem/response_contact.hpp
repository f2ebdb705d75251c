// SPDX-License-Identifier: Apache-2.0
// A Response's body with rigid contacts: coefficients of motion put on tools, derivatives carried along a path. Not for other files.
#pragma once

#include "palpate/fem/response.hpp"

namespace palpate::fem {

class TouchingResponse {
 public:
  TouchingResponse(const TetMesh& mesh, const std::string& material, Boundary boundary, const Response::Options& options,
                   Index parameters);

  /// What is watched and conjugate is left to the caller.
  ResponseState solve(const ResponseQuery& query, const LoadDirections& along, const ResponseStart& start);
  void forget() { statics_.forget(); }

 private:
  std::optional<ContactEquilibrium> before_touching(const VectorX& motion) const;
  ContactPathSensitivity before_touching_along(const MatrixX& motion, Index count) const;
  MatrixX reactions_along(const ContactPathSensitivity& d) const;

  Index node_motions_, parameters_;
  std::vector<DrivenContact> driven_;
  std::vector<char> standing_;  ///< one a driven contact: it says where a tool stands, and does not move it
  ContactStatics statics_;
};

}  // namespace palpate::fem
