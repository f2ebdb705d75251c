// label: contract
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/depth_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "io/broken_bytes.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/png_image.hpp"

namespace palpate::io::depth_file_test {
namespace {

using namespace palpate::io::test;

constexpr double unit_m = 0.00025;

DepthImage steps_of_units() {
  DepthImage depth(24, 32);
  for (Eigen::Index row = 0; row < 24; ++row) {
    for (Eigen::Index column = 0; column < 32; ++column) {
      depth(row, column) = static_cast<float>((row * 32 + column) * 80 % 65536 * unit_m);
    }
  }
  return depth;
}

const Reader reader = [](std::string_view bytes, const std::string& name) { parse_depth(bytes, name, unit_m); };

TEST(DepthFile, PngGivesBackWholeUnitsExactly) {
  EXPECT_EQ(parse_depth(depth_png(steps_of_units(), unit_m), "a.png", unit_m), steps_of_units());
}

TEST(DepthFile, NpyGivesBackEveryDepthExactly) {
  const DepthImage depth = (DepthImage::Random(5, 7).array() + 2).matrix();
  EXPECT_EQ(parse_depth(depth_npy(depth), "a.npy", 1.0), depth);
}

TEST(DepthFile, NpyAsNumpyWritesIt) {  // numpy.save of float64 [[1, 0], [nan, inf]]
  std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }";
  header.resize(117, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\0\x76\0", 10);
  bytes += header;
  for (const double value : {1.0, 0.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    bytes.append(reinterpret_cast<const char*>(&value), 8);
  }
  DepthImage expected(2, 2);
  expected << 0.5f, 0, 0, 0;
  EXPECT_EQ(parse_depth(bytes, "a.npy", 0.5), expected);
}

TEST(DepthFile, MasksComeBack) {
  MaskImage mask = MaskImage::Zero(6, 5);
  mask(2, 3) = 1;
  EXPECT_EQ(parse_mask(mask_png(mask), "mask.png"), mask);
}

TEST(DepthFile, CutOffFilesAreRefused) {
  for (const std::string& whole : {depth_png(steps_of_units(), unit_m), depth_npy(steps_of_units())}) {
    for (const std::string& bytes : truncated(whole)) EXPECT_TRUE(refuses(reader, bytes)) << bytes.size();
  }
}

TEST(DepthFile, GarbageIsRefused) {
  for (const std::string& bytes : garbage()) EXPECT_TRUE(refuses(reader, bytes));
}

TEST(DepthFile, DamageIsSurvived) {
  survives(reader, damaged(depth_png(steps_of_units(), unit_m), 400));
  survives(reader, damaged(depth_npy(steps_of_units()), 400));
}

TEST(DepthFile, HugeHeadersAreRefusedBeforeMemoryIsAskedFor) {
  std::string png = depth_png(steps_of_units(), unit_m);
  png[16] = 0, png[17] = 0, png[18] = 0x4e, png[19] = 0x20;  // width 20000; the check sum is wrong as well
  EXPECT_TRUE(refuses(reader, png));
  std::string npy = depth_npy(steps_of_units());
  npy.replace(npy.find("(24, 32)"), 8, "(20000,2000)");
  EXPECT_TRUE(refuses(reader, npy));
}

TEST(DepthFile, WrongKindsAreRefused) {
  EXPECT_TRUE(refuses(reader, mask_png(MaskImage::Ones(4, 4))));               // 8 bits
  EXPECT_TRUE(refuses(reader, depth_npy(DepthImage::Zero(3, 3))));             // no data at all
  EXPECT_TRUE(refuses(reader, depth_npy(DepthImage::Constant(3, 3, -1.0f))));  // negative
  EXPECT_THROW(depth_png(DepthImage::Constant(2, 2, 20.0f), unit_m), Error);   // more than 16 bits
}

TEST(DepthFile, SharedDepthImageIsRead) {
  const std::filesystem::path path =
      std::filesystem::path(PALPATE_SHARED_DIR) / "data/silicone_gravity_depth/h_m_c/depth.png";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "the optional data folder is not there";
  const DepthImage depth = parse_depth(read_file(path), path.string(), unit_m);
  EXPECT_EQ(depth.rows(), 768);
  EXPECT_EQ(depth.cols(), 1024);
  EXPECT_LT(depth.maxCoeff(), 16.4f);
}

}  // namespace
}  // namespace palpate::io::depth_file_test
