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
  MatrixX reactions_along(const ContactPathSensitivity& d) const;

  Index node_motions_, parameters_;
  std::vector<DrivenContact> driven_;
  ContactStatics statics_;
};

}  // namespace palpate::fem
