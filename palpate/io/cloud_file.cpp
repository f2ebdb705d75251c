// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/cloud_file.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "palpate/core/error.hpp"
#include "palpate/io/cloud_formats.hpp"
#include "palpate/io/file.hpp"

namespace palpate::io {

std::span<const CloudFormat> cloud_formats() {
  static const std::array formats = {
      CloudFormat{"ply", {".ply"}, "PLY, binary", read_ply_cloud, write_ply_cloud},
      CloudFormat{"ply_ascii", {".ply"}, "PLY, text", read_ply_cloud, write_ply_cloud_ascii},
      CloudFormat{"pcd", {".pcd"}, "Point Cloud Library, binary", read_pcd, write_pcd},
      CloudFormat{"pcd_ascii", {".pcd"}, "Point Cloud Library, text", read_pcd, write_pcd_ascii},
      CloudFormat{"xyz", {".xyz"}, "a point a line", read_xyz, write_xyz},
  };
  return formats;
}

const CloudFormat& cloud_format_of(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  for (const CloudFormat& format : cloud_formats()) {
    if (std::find(format.extensions.begin(), format.extensions.end(), extension) != format.extensions.end()) return format;
  }
  throw Error("no cloud format has the ending '" + extension + "'; known are .ply, .pcd, .xyz", path.string());
}

PointCloud parse_cloud(std::string_view bytes, const std::filesystem::path& path) {
  const std::string name = path.string();
  const CloudFormat& format = cloud_format_of(path);
  if (bytes.empty()) throw Error("the file is empty; record the cloud again or remove the observation", name);
  PointCloud cloud = format.read(bytes, name);
  if (cloud.points_m.rows() == 0) throw Error("the cloud is empty; record it again or remove the observation", name);
  for (Eigen::Index i = 0; i < cloud.points_m.rows(); ++i) {
    if (!cloud.points_m.row(i).allFinite()) {
      throw Error("point " + std::to_string(i) + " is not finite (NaN or infinite); leave invalid points out", name);
    }
  }
  if (cloud.normals.rows() > 0 && !cloud.normals.allFinite()) throw Error("a normal is not finite", name);
  if (cloud.sigma_m.size() > 0 && !(cloud.sigma_m.allFinite() && cloud.sigma_m.minCoeff() > 0)) {
    throw Error("a standard deviation in column sigma_m is not positive", name);
  }
  return cloud;
}

PointCloud read_cloud(const std::filesystem::path& path) {
  cloud_format_of(path);
  return parse_cloud(read_file(path), path);
}

void write_cloud(const std::filesystem::path& path, const PointCloud& cloud) {
  write_file(path, cloud_format_of(path).write(cloud));
}

PointCloud cloud_from_columns(const std::vector<std::string>& names, const MatrixX& values, const std::string& file) {
  const auto column = [&](std::initializer_list<const char*> spellings) -> std::optional<Eigen::Index> {
    for (const char* spelling : spellings) {
      const auto found = std::find(names.begin(), names.end(), spelling);
      if (found != names.end()) return found - names.begin();
    }
    return std::nullopt;
  };
  const std::optional<Eigen::Index> point[] = {column({"x"}), column({"y"}), column({"z"})};
  const std::optional<Eigen::Index> normal[] = {column({"nx", "normal_x"}), column({"ny", "normal_y"}),
                                                column({"nz", "normal_z"})};
  PointCloud cloud;
  cloud.points_m.resize(values.rows(), 3);
  for (int axis = 0; axis < 3; ++axis) {
    if (!point[axis]) throw Error("the points have no x, y and z", file);
    cloud.points_m.col(axis) = values.col(*point[axis]);
  }
  if (normal[0] && normal[1] && normal[2]) {
    cloud.normals.resize(values.rows(), 3);
    for (int axis = 0; axis < 3; ++axis) cloud.normals.col(axis) = values.col(*normal[axis]);
  } else {
    cloud.normals.resize(0, 3);
  }
  if (const auto sigma = column({"sigma_m"})) cloud.sigma_m = values.col(*sigma);
  return cloud;
}

CloudColumns columns_of(const PointCloud& cloud) {
  const bool normals = cloud.normals.rows() == cloud.points_m.rows() && cloud.normals.rows() > 0;
  const bool sigmas = cloud.sigma_m.size() == cloud.points_m.rows() && cloud.sigma_m.size() > 1;
  CloudColumns result;
  result.names = {"x", "y", "z"};
  if (normals) result.names.insert(result.names.end(), {"nx", "ny", "nz"});
  if (sigmas) result.names.emplace_back("sigma_m");
  result.values.resize(cloud.points_m.rows(), static_cast<Eigen::Index>(result.names.size()));
  result.values.leftCols(3) = cloud.points_m;
  if (normals) result.values.middleCols(3, 3) = cloud.normals;
  if (sigmas) result.values.rightCols(1) = cloud.sigma_m;
  return result;
}

}  // namespace palpate::io
