// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/unpack.hpp"

#include <bzlib.h>
#include <gtest/gtest.h>
#include <lz4frame.h>
#include <sys/resource.h>
#include <zstd.h>

#include "io/bag_files.hpp"
#include "palpate/core/error.hpp"

namespace palpate::io::unpack_test {
namespace {

std::string packed(const std::string& text, const std::string& how) {
  std::string out(text.size() + 1000, '\0');
  if (how == "zstd") {
    out.resize(ZSTD_compress(out.data(), out.size(), text.data(), text.size(), 1));
  } else if (how == "lz4") {
    out.resize(LZ4F_compressFrameBound(text.size(), nullptr));
    out.resize(LZ4F_compressFrame(out.data(), out.size(), text.data(), text.size(), nullptr));
  } else {
    auto size = static_cast<unsigned>(out.size());
    BZ2_bzBuffToBuffCompress(out.data(), &size, const_cast<char*>(text.data()), static_cast<unsigned>(text.size()), 1, 0, 0);
    out.resize(size);
  }
  return out;
}

long peak_kib() {
  rusage use{};
  getrusage(RUSAGE_SELF, &use);
  return use.ru_maxrss;
}

class EveryCompression : public testing::TestWithParam<const char*> {};

TEST_P(EveryCompression, GivesBackWhatWasPacked) {
  std::string text = "force and travel ";
  for (int i = 0; i < 18; ++i) text += text;  // 4 MB: more than one piece
  EXPECT_EQ(unpack(packed(text, GetParam()), GetParam(), text.size()), text);
  EXPECT_EQ(unpack(packed("", GetParam()), GetParam(), 0), "");
}

TEST_P(EveryCompression, AnotherSizeThanAnnouncedIsRefused) {
  const std::string text(100'000, 'a'), small = packed(text, GetParam());
  EXPECT_FALSE(unpack(small, GetParam(), text.size() + 1));
  EXPECT_FALSE(unpack(small, GetParam(), text.size() - 1));
  EXPECT_FALSE(unpack(small.substr(0, small.size() / 2), GetParam(), text.size()));
}

/// A file of a few bytes that says it holds two gigabytes must not cost them.
TEST_P(EveryCompression, WhatIsOnlyAnnouncedTakesNoMemory) {
  const long before = peak_kib();
  EXPECT_FALSE(unpack(packed("short", GetParam()), GetParam(), std::uint64_t{1} << 31));
  EXPECT_LT(peak_kib() - before, 50'000);
}

INSTANTIATE_TEST_SUITE_P(Compression, EveryCompression, testing::Values("zstd", "lz4", "bz2"),
                         [](const auto& one) { return std::string(one.param); });

TEST(SqliteBag, PagesThatAreOnlyAnnouncedTakeNoMemory) {
  std::string bytes = test::sqlite_bytes({{"/wrench", "geometry_msgs/msg/WrenchStamped", 1, "data"}}).substr(0, 100);
  bytes[16] = 0, bytes[17] = 1;  // pages of 64 KiB
  bytes[28] = 0, bytes[29] = 1, bytes[30] = bytes[31] = '\xff';
  const long before = peak_kib();
  EXPECT_THROW(parse_bag(bytes, "a.db3"), Error);
  EXPECT_LT(peak_kib() - before, 50'000);
}

}  // namespace
}  // namespace palpate::io::unpack_test
