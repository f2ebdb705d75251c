// label: statistics
// SPDX-License-Identifier: Apache-2.0
// What the studies of `palpate paper` show on one seed, against the truth of the lab. Minutes each.
#include "cli/paper_studies.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace palpate::cli {
namespace {

bool holds(const StudyRow& row) {
  return row.palpate.lower_95_pa <= row.young_modulus_pa && row.young_modulus_pa <= row.palpate.upper_95_pa;
}

TEST(PaperStudies, APointLoadPutsBothMethodsOffAndPalpatesOwnModelDoesNot) {
  const auto rows = study_of("meshes")->run({}, {});
  ASSERT_EQ(rows.size(), 5u);
  const StudyRow &point = rows.front(), &own = rows.back();
  // The dent under a point is as deep as elements are small: E goes where it pleases.
  EXPECT_GT(std::abs(point.paper.young_modulus_pa / point.young_modulus_pa - 1), 0.5);
  EXPECT_GT(std::abs(point.palpate.young_modulus_pa / point.young_modulus_pa - 1), 0.5);
  EXPECT_FALSE(point.palpate.verdicts.empty()) << "a wrong load must not pass in silence";
  EXPECT_TRUE(holds(own));
  EXPECT_TRUE(own.palpate.verdicts.empty());
}

TEST(PaperStudies, WithNothingWrongTheIntervalHoldsInSilence) {
  const auto rows = study_of("faults")->run({}, {});
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_TRUE(holds(rows.front()));
  EXPECT_TRUE(rows.front().palpate.verdicts.empty());
}

}  // namespace
}  // namespace palpate::cli
