// label: contract
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/cloud_file.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "io/broken_bytes.hpp"

namespace palpate::io {

void PrintTo(const CloudFormat& format, std::ostream* out) { *out << format.name; }

namespace cloud_file_test {
namespace {

using namespace palpate::io::test;

PointCloud cloud_of(Eigen::Index points, bool normals, bool sigmas) {
  std::srand(3);
  PointCloud cloud;
  cloud.points_m = Points::Random(points, 3) / 3;
  cloud.normals = normals ? Points(Points::Random(points, 3)) : Points(0, 3);
  if (sigmas) cloud.sigma_m = VectorX::Random(points).cwiseAbs().array() + 1e-4;
  return cloud;
}

class EveryCloudFormat : public testing::TestWithParam<CloudFormat> {
 protected:
  const CloudFormat& format = GetParam();
  std::string file_name = "file.name" + format.extensions.front();
  Reader reader = [this](std::string_view bytes, const std::string&) { parse_cloud(bytes, file_name); };
};

TEST_P(EveryCloudFormat, GivesBackExactlyWhatWasWritten) {
  for (const bool normals : {false, true}) {
    const bool sigmas = format.name != "xyz";
    const PointCloud cloud = cloud_of(50, normals, sigmas);
    const PointCloud back = parse_cloud(format.write(cloud), file_name);
    EXPECT_EQ(cloud.points_m, back.points_m);
    EXPECT_EQ(cloud.normals, back.normals);
    EXPECT_EQ(cloud.sigma_m, back.sigma_m);
  }
}

TEST_P(EveryCloudFormat, RefusesCutOffFiles) {
  for (const std::string& bytes : truncated(format.write(cloud_of(40, true, true)))) {
    if (format.name == "xyz") {  // nothing in it says where it ends
      refuses(reader, bytes);
    } else {
      EXPECT_TRUE(refuses(reader, bytes)) << bytes.size();
    }
  }
}

TEST_P(EveryCloudFormat, RefusesGarbage) {
  for (const std::string& bytes : garbage()) EXPECT_TRUE(refuses(reader, bytes));
}

TEST_P(EveryCloudFormat, SurvivesDamage) { survives(reader, damaged(format.write(cloud_of(30, true, true)), 400)); }

TEST_P(EveryCloudFormat, RefusesNan) {
  PointCloud cloud = cloud_of(5, false, false);
  cloud.points_m(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refuses(reader, format.write(cloud)));
}

TEST_P(EveryCloudFormat, RefusesAnEmptyCloud) { EXPECT_TRUE(refuses(reader, format.write(cloud_of(0, false, false)))); }

TEST_P(EveryCloudFormat, ReadsWindowsLineEnds) {
  const std::string bytes = format.write(cloud_of(5, false, false));
  if (bytes.find('\0') != std::string::npos || format.name == "ply" || format.name == "pcd") return;
  EXPECT_EQ(parse_cloud(with_crlf(bytes), file_name).points_m, cloud_of(5, false, false).points_m);
}

INSTANTIATE_TEST_SUITE_P(Cloud, EveryCloudFormat, testing::ValuesIn(cloud_formats().begin(), cloud_formats().end()),
                         [](const auto& one) { return one.param.name; });

TEST(CloudCounts, MoreThanTheFileCanHoldIsRefused) {
  const auto refused = [](const std::string& bytes, const char* name) {
    return refuses([&](std::string_view all, const std::string&) { parse_cloud(all, name); }, bytes);
  };
  const std::string head =
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2000000000\nHEIGHT 1\nPOINTS 2000000000\n";
  for (const char* data : {"ascii", "binary", "binary_compressed"}) {
    EXPECT_TRUE(refused(head + "DATA " + data + "\n0 0 0\n0 0 0\n", "file.name.pcd")) << data;
  }
  EXPECT_TRUE(
      refused("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2000000000\nHEIGHT 2000000000\nDATA binary\n",
              "file.name.pcd"));
}

TEST(Pcd, OrganisedCloudsLoseTheirPixelsWithoutData) {
  const PointCloud cloud = parse_cloud(
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 2\nPOINTS 4\nDATA ascii\n"
      "0 0 1\nnan nan nan\n1 0 1\n1 1 1\n",
      "organised.pcd");
  ASSERT_EQ(cloud.points_m.rows(), 3);
  EXPECT_EQ(cloud.points_m.row(1), Vec3(1, 0, 1).transpose());
}

TEST(Pcd, CompressedDataAreUnpacked) {
  // Two points (1, 1, 1): columns of two floats. LZF: four letters as they are, then a copy of 20 letters from 4 back.
  float one = 1;
  std::string packed = "\x03";
  packed.append(reinterpret_cast<const char*>(&one), 4);
  packed += {static_cast<char>(0xe0), static_cast<char>(20 - 2 - 7), 3};
  std::string bytes =
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary_compressed\n";
  const auto add = [&](std::uint32_t value) { bytes.append(reinterpret_cast<const char*>(&value), 4); };
  add(static_cast<std::uint32_t>(packed.size()));
  add(24);
  bytes += packed;
  const PointCloud cloud = parse_cloud(bytes, "compressed.pcd");
  EXPECT_EQ(cloud.points_m, Points::Ones(2, 3));
}

TEST(Xyz, CommasCommentsAndNormals) {
  const PointCloud cloud = parse_cloud("# x y z\n1,2,3\n4\t5 6 # last\n", "a.xyz");
  EXPECT_EQ(cloud.points_m.row(1), Vec3(4, 5, 6).transpose());
  EXPECT_EQ(parse_cloud("1 2 3 0 0 1\n", "a.xyz").normals.row(0), Vec3(0, 0, 1).transpose());
  EXPECT_THROW(parse_cloud("1 2 3 255 0 0\n", "a.xyz"), Error) << "a colour is no normal";
  EXPECT_THROW(parse_cloud("1 2 3\n1 2\n", "a.xyz"), Error);
}

}  // namespace
}  // namespace cloud_file_test
}  // namespace palpate::io
