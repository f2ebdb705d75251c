// label: data
// SPDX-License-Identifier: Apache-2.0
// The example converters on the data sets that they are for: what they write is a recording without a fault, and the
// quickest of them leads to the published modulus. Without the data only their refusals are tested.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "palpate/identify.hpp"
#include "palpate/io/recording.hpp"
#include "temporary_folder.hpp"

namespace palpate::converters_test {
namespace {

namespace fs = std::filesystem;

class Converters : public ::testing::Test {
 protected:
  fs::path data(const std::string& set) const { return fs::path(PALPATE_SHARED_DIR) / "data" / set; }

  /// Exit code of the set's converter.
  int convert(const std::string& set, const std::string& sequence, const std::string& options = {}) const {
    const fs::path program = fs::path(PALPATE_SOURCE_DIR) / "examples" / set / "convert";
    const std::string command = "'" + program.string() + "' '" + data(set).string() + "' '" + sequence + "' '" +
                                folder_.string() + "' " + options + " 2> /dev/null";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  const palpate::test::TemporaryFolder files_{"converted"};
  const fs::path folder_ = files_ / "recording";
};

struct Expected {
  const char* set;
  const char* sequence;
  const char* options;
  std::size_t pushes, steps;  ///< steps of the first push
};

void PrintTo(const Expected& expected, std::ostream* out) {
  *out << expected.set << "_" << expected.sequence << expected.options;
}

class ConvertedSequence : public Converters, public ::testing::WithParamInterface<Expected> {};

TEST_P(ConvertedSequence, IsARecordingWithoutFault) {
  const Expected& expected = GetParam();
  if (!fs::exists(data(expected.set))) GTEST_SKIP() << "no data set " << data(expected.set);
  ASSERT_EQ(convert(expected.set, expected.sequence, expected.options), 0);
  const Recording recording = io::read_recording(folder_);
  EXPECT_EQ(recording.pushes.size(), expected.pushes);
  EXPECT_EQ(recording.pushes.front().steps.size(), expected.steps);
  EXPECT_FALSE(recording.supports.empty());
  EXPECT_TRUE(recording.rest.volume.has_value());
}

INSTANTIATE_TEST_SUITE_P(Sets, ConvertedSequence,
                         ::testing::Values(Expected{"liver", "linear_s1", "", 1, 50},
                                           Expected{"liver", "linear_s1", "--mesh remeshed", 1, 50},
                                           Expected{"liver", "neohookean_s3", "--force-noise 0.02 --seed 3", 1, 50},
                                           Expected{"beam_known_force", "load52_a", "", 1, 1},
                                           Expected{"beam_known_force", "all_a", "", 3, 1},
                                           Expected{"silicone_compression", "EF50_25T_B2", "", 1, 30},
                                           Expected{"silicone_compression", "EF10_0T", "", 10, 30},
                                           Expected{"silicone_gravity_depth", "h_m_c", "", 1, 1}));

TEST_F(Converters, ForceNoiseIsSeededAndOfTheSizeThatWasAskedFor) {
  if (!fs::exists(data("liver"))) GTEST_SKIP() << "no data set " << data("liver");
  const auto forces = [&](const std::string& options) {
    EXPECT_EQ(convert("liver", "linear_s1", options), 0);
    VectorX norms(50);
    const Recording recording = io::read_recording(folder_);
    for (Index s = 0; s < 50; ++s)
      norms(s) = recording.pushes[0].steps[static_cast<std::size_t>(s)].loads[0].force_n->norm();
    fs::remove_all(folder_);
    return norms;
  };
  const VectorX clean = forces(""), noisy = forces("--force-noise 0.02 --seed 3");
  EXPECT_EQ(noisy, forces("--force-noise 0.02 --seed 3"));
  EXPECT_NE(noisy, forces("--force-noise 0.02 --seed 4"));
  const VectorX relative = (noisy.array() / clean.array() - 1).matrix();
  EXPECT_NEAR(relative.norm() / std::sqrt(50.0), 0.02, 0.006);
}

TEST_F(Converters, CompressionOfOneMaterialHasThePublishedModulus) {
  if (!fs::exists(data("silicone_compression"))) GTEST_SKIP() << "no data set " << data("silicone_compression");
  ASSERT_EQ(convert("silicone_compression", "EF10_0T"), 0);
  const Identified found = identify(io::read_recording(folder_));
  ASSERT_EQ(found.answer.termination, Termination::converged) << found.answer.message;
  EXPECT_NEAR(found.answer.parameters.at(0).value, 56270, 0.06 * 56270);  // published mean over these tests
}

TEST_F(Converters, RefuseWhatIsNotThere) {
  EXPECT_EQ(convert("liver", "no_such_sequence"), 3);
  EXPECT_EQ(convert("beam_known_force", "load7_a"), 3);
  EXPECT_EQ(convert("silicone_compression", "EF99_0T"), 3);
  EXPECT_EQ(convert("silicone_gravity_depth", "no_such_case"), 3);
  EXPECT_FALSE(fs::exists(folder_)) << "a refused conversion leaves nothing behind";
}

TEST_F(Converters, TakeBackWhatTheyWroteWhenAFileIsMissing) {
  if (!fs::exists(data("beam_known_force"))) GTEST_SKIP() << "no data set " << data("beam_known_force");
  EXPECT_EQ(convert("beam_known_force", "gravity_zz"), 3);
  EXPECT_FALSE(fs::exists(folder_));
}

}  // namespace
}  // namespace palpate::converters_test
