// SPDX-License-Identifier: Apache-2.0
// Point clouds behind one table: a format is one pair of functions and one line in cloud_file.cpp.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate::io {

struct CloudFormat {
  std::string name;
  std::vector<std::string> extensions;  ///< lower case with the dot
  std::string about;
  PointCloud (*read)(std::string_view bytes, const std::string& name) = nullptr;
  std::string (*write)(const PointCloud& cloud) = nullptr;
};

std::span<const CloudFormat> cloud_formats();
const CloudFormat& cloud_format_of(const std::filesystem::path& path);

/// Points, normals where the file has them (nx ny nz, normal_x ...; columns 4 to 6 of XYZ) and a standard deviation for each
/// point where it has one (`sigma_m`; else sigma_m is of size 0). An organised PCD (height > 1) marks pixels without
/// data by NaN: these are left out. Throws Error on any other NaN, on damaged bytes and on a file without a point.
PointCloud parse_cloud(std::string_view bytes, const std::filesystem::path& path);
PointCloud read_cloud(const std::filesystem::path& path);
void write_cloud(const std::filesystem::path& path, const PointCloud& cloud);

}  // namespace palpate::io
