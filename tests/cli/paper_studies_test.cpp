// label: statistics
// SPDX-License-Identifier: Apache-2.0
// What the studies of `palpate paper` show on one seed, against the truth of the lab: minutes each.
#include "cli/paper_studies.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace palpate::cli::paper_studies_test {
namespace {

bool holds(const StudyRow& row) {
  return row.palpate.lower_95_pa <= row.young_modulus_pa && row.young_modulus_pa <= row.palpate.upper_95_pa;
}

TEST(PaperStudies, APointLoadPutsBothMethodsOffAndPalpatesOwnModelDoesNot) {
  const auto rows = study_of("meshes")->run({}, {});
  ASSERT_EQ(rows.size(), 7u);
  const StudyRow &point = rows[0], &finer = rows[1], &own = rows[5], &to_surface = rows[6];
  // A point has no size but the mesh's: E goes where that puts it.
  EXPECT_GT(std::abs(std::log(finer.paper.young_modulus_pa / point.paper.young_modulus_pa)), 0.3);
  EXPECT_GT(std::abs(std::log(finer.palpate.young_modulus_pa / point.palpate.young_modulus_pa)), 0.3);
  EXPECT_GT(std::abs(std::log(point.palpate.young_modulus_pa / rows[2].palpate.young_modulus_pa)), 0.3) << "the same mesh under the patch";
  EXPECT_FALSE(point.palpate.verdicts.empty()) << "a wrong load must not pass in silence";
  EXPECT_TRUE(holds(own));
  EXPECT_TRUE(own.palpate.verdicts.empty());
  // What the metric does is apart from mesh and load.
  EXPECT_TRUE(std::isfinite(to_surface.paper.young_modulus_pa));
  EXPECT_NE(to_surface.paper.young_modulus_pa, own.paper.young_modulus_pa);
}

TEST(PaperStudies, WithNothingWrongTheIntervalHoldsInSilenceAndElseItIsSaid) {
  const auto rows = study_of("faults")->run({}, {});
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_TRUE(holds(rows.front()));
  EXPECT_TRUE(rows.front().palpate.verdicts.empty());
  for (std::size_t k = 1; k < rows.size(); ++k) EXPECT_FALSE(rows[k].palpate.verdicts.empty()) << rows[k].what;
}

}  // namespace
}  // namespace palpate::cli::paper_studies_test
