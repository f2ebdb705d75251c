// SPDX-License-Identifier: Apache-2.0
// The readers and writers behind the table in cloud_file.cpp.
#pragma once

#include "palpate/io/cloud_file.hpp"

namespace palpate::io {

PointCloud read_ply_cloud(std::string_view bytes, const std::string& name);
std::string write_ply_cloud(const PointCloud& cloud);
std::string write_ply_cloud_ascii(const PointCloud& cloud);
PointCloud read_pcd(std::string_view bytes, const std::string& name);
std::string write_pcd(const PointCloud& cloud);
std::string write_pcd_ascii(const PointCloud& cloud);
PointCloud read_xyz(std::string_view bytes, const std::string& name);
std::string write_xyz(const PointCloud& cloud);

/// A cloud from a table of named columns: what PLY and PCD have in common. Throws Error when x, y or z is missing.
PointCloud cloud_from_columns(const std::vector<std::string>& names, const MatrixX& values, const std::string& file);
/// The other way round.
struct CloudColumns {
  std::vector<std::string> names;
  MatrixX values;
};
CloudColumns columns_of(const PointCloud& cloud);

}  // namespace palpate::io
