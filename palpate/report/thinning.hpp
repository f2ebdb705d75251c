// SPDX-License-Identifier: Apache-2.0
// What makes a page of a few megabytes out of any recording: fewer vertices and points, fewer bits a number.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::report {

/// A coarser mesh whose vertices are some of the fine one's, so that any field on the fine vertices carries over.
struct ThinnedMesh {
  std::vector<Index> kept;  ///< fine vertex of each coarse one
  Triangles triangles;      ///< of coarse vertices
};

/// Vertex clustering (Rossignac and Borrel 1993): the vertices of one cell of a grid become the one nearest their mean.
/// Returns the mesh itself (without unused vertices) when it has at most `max_vertices`.
ThinnedMesh thin(const TriMesh& mesh, std::size_t max_vertices);

/// At most `max_count` of 0..count-1, evenly spread, first and last kept.
std::vector<std::size_t> spread(std::size_t count, std::size_t max_count);

/// Cubic box: coordinate = origin + size * q / 65535.
struct Box16 {
  Vec3 origin_m = Vec3::Zero();
  double size_m = 1;
};

/// Rows `rows` of `points` as 16 bit coordinates in the box, little endian, base64. Values outside are clamped.
std::string encode_points(const Points& points, std::span<const Index> rows, const Box16& box);

/// Values as signed bytes, -127..127 for -scale..scale, -128 for NaN, base64.
std::string encode_signed(std::span<const double> values, double scale);

/// Values as unsigned bytes, 0..255 for 0..scale, base64.
std::string encode_unsigned(std::span<const double> values, double scale);

/// Triangles as 16 or 32 bit little endian indices (16 when `vertices` <= 65536), base64.
std::string encode_triangles(const Triangles& triangles, std::size_t vertices);

std::string base64(std::span<const std::uint8_t> bytes);
std::vector<std::uint8_t> from_base64(std::string_view text);

}  // namespace palpate::report
