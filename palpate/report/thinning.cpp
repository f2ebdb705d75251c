// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/thinning.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>

namespace palpate::report {
namespace {

constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

void append_little_endian(std::vector<std::uint8_t>& bytes, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

/// Cluster of each vertex for a grid with `cells` along the longest side; the number of clusters is their largest plus one.
std::vector<Index> clusters_of(const Points& vertices, const Vec3& origin, double size_m, int cells) {
  std::map<std::tuple<int, int, int>, Index> cluster_of_cell;
  std::vector<Index> clusters(static_cast<std::size_t>(vertices.rows()));
  for (Eigen::Index i = 0; i < vertices.rows(); ++i) {
    const Vec3 cell = ((vertices.row(i).transpose() - origin) / size_m * cells).array().floor();
    const std::tuple key(static_cast<int>(cell.x()), static_cast<int>(cell.y()), static_cast<int>(cell.z()));
    const auto [entry, inserted] = cluster_of_cell.try_emplace(key, static_cast<Index>(cluster_of_cell.size()));
    clusters[static_cast<std::size_t>(i)] = entry->second;
  }
  return clusters;
}

std::size_t count_of(const std::vector<Index>& clusters) {
  return clusters.empty() ? 0 : static_cast<std::size_t>(*std::max_element(clusters.begin(), clusters.end())) + 1;
}

ThinnedMesh merged(const TriMesh& mesh, const std::vector<Index>& clusters) {
  const std::size_t count = count_of(clusters);
  Points mean = Points::Zero(static_cast<Eigen::Index>(count), 3);
  VectorX members = VectorX::Zero(static_cast<Eigen::Index>(count));
  for (Eigen::Index i = 0; i < mesh.vertices_m.rows(); ++i) {
    mean.row(clusters[static_cast<std::size_t>(i)]) += mesh.vertices_m.row(i);
    members(clusters[static_cast<std::size_t>(i)]) += 1;
  }
  ThinnedMesh thinned;
  thinned.kept.assign(count, -1);
  std::vector<double> best(count, 0);
  for (Eigen::Index i = 0; i < mesh.vertices_m.rows(); ++i) {
    const auto c = static_cast<std::size_t>(clusters[static_cast<std::size_t>(i)]);
    const auto row = static_cast<Eigen::Index>(c);
    const double distance = (mesh.vertices_m.row(i) - mean.row(row) / members(row)).squaredNorm();
    if (thinned.kept[c] < 0 || distance < best[c]) {
      thinned.kept[c] = static_cast<Index>(i);
      best[c] = distance;
    }
  }
  std::vector<std::array<Index, 3>> triangles;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    std::array<Index, 3> corners;
    for (int k = 0; k < 3; ++k) {
      corners[static_cast<std::size_t>(k)] = clusters[static_cast<std::size_t>(mesh.triangles(t, k))];
    }
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    triangles.push_back(corners);
  }
  std::sort(triangles.begin(), triangles.end());
  triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
  thinned.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k)
      thinned.triangles(static_cast<Eigen::Index>(t), k) = triangles[t][static_cast<std::size_t>(k)];
  }
  return thinned;
}

}  // namespace

ThinnedMesh thin(const TriMesh& mesh, std::size_t max_vertices) {
  std::vector<Index> used(static_cast<std::size_t>(mesh.vertices_m.rows()), -1);
  ThinnedMesh whole;
  whole.triangles = mesh.triangles;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      Index& vertex = used[static_cast<std::size_t>(mesh.triangles(t, k))];
      if (vertex < 0) {
        vertex = static_cast<Index>(whole.kept.size());
        whole.kept.push_back(mesh.triangles(t, k));
      }
      whole.triangles(t, k) = vertex;
    }
  }
  if (whole.kept.size() <= max_vertices || whole.kept.empty()) return whole;

  TriMesh compact;
  compact.triangles = whole.triangles;
  compact.vertices_m.resize(static_cast<Eigen::Index>(whole.kept.size()), 3);
  for (std::size_t i = 0; i < whole.kept.size(); ++i) {
    compact.vertices_m.row(static_cast<Eigen::Index>(i)) = mesh.vertices_m.row(whole.kept[i]);
  }
  const Vec3 origin = compact.vertices_m.colwise().minCoeff();
  const double size_m = (compact.vertices_m.colwise().maxCoeff().transpose() - origin).maxCoeff() * (1 + 1e-9) + 1e-300;
  int cells = 1, too_many = 4096;  // the number of clusters grows with the cells, nearly monotonically
  while (too_many - cells > 1) {
    const int middle = (cells + too_many) / 2;
    (count_of(clusters_of(compact.vertices_m, origin, size_m, middle)) <= max_vertices ? cells : too_many) = middle;
  }
  ThinnedMesh thinned = merged(compact, clusters_of(compact.vertices_m, origin, size_m, cells));
  for (Index& vertex : thinned.kept) vertex = whole.kept[static_cast<std::size_t>(vertex)];
  return thinned;
}

std::vector<std::size_t> spread(std::size_t count, std::size_t max_count) {
  if (count <= max_count) {
    std::vector<std::size_t> all(count);
    std::iota(all.begin(), all.end(), std::size_t{0});
    return all;
  }
  std::vector<std::size_t> chosen;
  if (max_count == 1) return {0};
  for (std::size_t i = 0; i < max_count; ++i) chosen.push_back(i * (count - 1) / (max_count - 1));
  return chosen;
}

std::string encode_points(const Points& points, std::span<const Index> rows, const Box16& box) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(rows.size() * 6);
  for (const Index row : rows) {
    for (int axis = 0; axis < 3; ++axis) {
      const double share = (points(row, axis) - box.origin_m(axis)) / box.size_m;
      const double clamped = std::isfinite(share) ? std::clamp(share, 0.0, 1.0) : 0.0;
      append_little_endian(bytes, static_cast<std::uint32_t>(std::lround(clamped * 65535)), 2);
    }
  }
  return base64(bytes);
}

std::string encode_signed(std::span<const double> values, double scale) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(values.size());
  for (const double value : values) {
    const long step = std::isfinite(value) && scale > 0 ? std::lround(std::clamp(value / scale, -1.0, 1.0) * 127) : -128;
    bytes.push_back(static_cast<std::uint8_t>(static_cast<std::int8_t>(step)));
  }
  return base64(bytes);
}

std::string encode_unsigned(std::span<const double> values, double scale) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(values.size());
  for (const double value : values) {
    const double share = std::isfinite(value) && scale > 0 ? std::clamp(value / scale, 0.0, 1.0) : 0.0;
    bytes.push_back(static_cast<std::uint8_t>(std::lround(share * 255)));
  }
  return base64(bytes);
}

std::string encode_triangles(const Triangles& triangles, std::size_t vertices) {
  std::vector<std::uint8_t> bytes;
  const int width = vertices <= 65536 ? 2 : 4;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) append_little_endian(bytes, static_cast<std::uint32_t>(triangles(t, k)), width);
  }
  return base64(bytes);
}

std::string base64(std::span<const std::uint8_t> bytes) {
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? alphabet[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::vector<std::uint8_t> from_base64(std::string_view text) {
  std::vector<std::uint8_t> bytes;
  std::uint32_t group = 0;
  int bits = 0;
  for (const char c : text) {
    const std::size_t value = alphabet.find(c);
    if (value == std::string_view::npos) continue;
    group = group << 6 | static_cast<std::uint32_t>(value);
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      bytes.push_back(static_cast<std::uint8_t>(group >> bits));
    }
  }
  return bytes;
}

}  // namespace palpate::report
