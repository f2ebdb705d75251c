// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "cli/new_folder.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "temporary_folder.hpp"

namespace palpate::cli::new_folder_test {
namespace {

namespace fs = std::filesystem;

void fill(const fs::path& folder) {
  fs::create_directories(folder / "deep");
  std::ofstream(folder / "deep" / "file") << "1";
}

TEST(NewFolder, WhatCameToNothingLeavesNothing) {
  const test::TemporaryFolder files("new_folder");
  {
    const NewFolder made(files / "made");
    fill(files / "made");
  }
  EXPECT_FALSE(fs::exists(files / "made"));
  fs::create_directory(files / "there");
  fs::permissions(files / "there", fs::perms::owner_all);
  {
    const NewFolder there(files / "there");
    fill(files / "there");
  }
  EXPECT_TRUE(fs::is_directory(files / "there") && fs::is_empty(files / "there"));
  EXPECT_EQ(fs::status(files / "there").permissions(), fs::perms::owner_all) << "it is the user's own";
  {
    NewFolder kept(files / "there");
    fill(files / "there");
    kept.keep();
  }
  EXPECT_TRUE(fs::exists(files / "there" / "deep" / "file"));
  {
    const NewFolder full(files / "there");
  }
  EXPECT_TRUE(fs::exists(files / "there" / "deep" / "file")) << "nothing of it was made here";
}

TEST(NewFolder, ALinkStaysALink) {
  const test::TemporaryFolder files("new_folder_link");
  fs::create_directory(files / "there");
  fs::create_directory_symlink("there", files / "link");
  fs::create_directory_symlink("nowhere", files / "dangling");
  {
    const NewFolder link(files / "link"), dangling(files / "dangling");
    fill(files / "link");
  }
  EXPECT_TRUE(fs::is_symlink(files / "link"));
  EXPECT_TRUE(fs::is_directory(files / "there") && fs::is_empty(files / "there"));
  EXPECT_TRUE(fs::is_symlink(files / "dangling"));
}

}  // namespace
}  // namespace palpate::cli::new_folder_test
