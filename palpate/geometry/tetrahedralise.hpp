// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/geometry/mesh_checks.hpp"

namespace palpate::geometry {

/// Edges of at most `edge_m` within `radius_m` of a point (a contact, say), growing by and by outside.
struct FinerNear {
  Vec3 point_m = Vec3::Zero();
  double radius_m = 0;
  double edge_m = 0;
};

struct TetrahedraliseOptions {
  Index tetrahedra = 10000;      ///< wished number, met within some percent; not used when edge_m is given
  double edge_m = 0;             ///< wished edge length of thick parts; 0 = from `tetrahedra`
  std::vector<FinerNear> finer;  ///< on top of `tetrahedra`
  double detail = 0.12;          ///< parts that edges would miss by more than this share of one get shorter ones (0.02..1)
  int finest = 16;               ///< how many times shorter at most (1..32)
  bool improve = true;           ///< false: the cut lattice as it is, for inspection
};

/// @throws Error naming the field and its bounds.
void check(const TetrahedraliseOptions& options);

struct Tetrahedralisation {
  TetMesh mesh;                        ///< linear
  VolumeCheck check;                   ///< of `mesh`
  SurfaceCheck surface;                ///< of the input
  std::optional<double> volume_error;  ///< signed share of the surface's volume; empty when the surface is not watertight
  double surface_rms_m = 0;            ///< between input and boundary, both ways (open input: input to boundary only);
                                       ///< triangles buried within other parts of the input do not count
  double hausdorff_m = 0;              ///< likewise, the largest distance
  double unseen_share = 0;             ///< share of the boundary that closes holes of the input
  Index flipped_triangles = 0;         ///< turned round to make the surface face outwards
  std::vector<Finding> warnings;       ///< of input and result, plain words
  bool cancelled = false;              ///< the mesh is then valid, but not yet improved
};

/// Fills a triangle soup with tetrahedra: signed distance with a winding-number sign on a body-centred cubic lattice,
/// bisected where the surface asks for it; marching tetrahedra; then merging, fitting to the surface and improvement of the
/// worst elements (after Spillmann, Wagner, Teschner 2006; Labelle, Shewchuk 2007; Klingner, Shewchuk 2008). The boundary is
/// manifold and no element is inverted, whatever the input: open, self-intersecting, non-manifold, inconsistently oriented.
/// @throws Error when the input encloses nothing, or is thinner everywhere than the resolution allows.
Tetrahedralisation tetrahedralise(const TriMesh& surface, const TetrahedraliseOptions& options = {},
                                  const OnProgress& progress = {});

}  // namespace palpate::geometry
