// label: statistics
// SPDX-License-Identifier: Apache-2.0
// The study of what goes wrong and nobody says, on one seed: minutes.
#include <gtest/gtest.h>

#include "cli/paper_studies.hpp"

namespace palpate::cli::paper_faults_test {
namespace {

bool holds(const StudyRow& row) {
  return row.palpate.lower_95_pa <= row.young_modulus_pa && row.young_modulus_pa <= row.palpate.upper_95_pa;
}

TEST(PaperFaults, WithNothingWrongTheIntervalHoldsInSilenceAndElseItIsSaid) {
  const auto rows = study_of("faults")->run({}, {});
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_TRUE(holds(rows.front()));
  EXPECT_TRUE(rows.front().palpate.verdicts.empty());
  for (std::size_t k = 1; k < rows.size(); ++k) EXPECT_FALSE(rows[k].palpate.verdicts.empty()) << rows[k].what;
}

}  // namespace
}  // namespace palpate::cli::paper_faults_test
