// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The push that `nu_not_determined` names: made on a finer mesh, it has to deliver the interval that was promised.
#include <gtest/gtest.h>

#include <cmath>
#include <regex>

#include "estimation/pushed_block.hpp"
#include "palpate/identify.hpp"
#include "palpate/suggest.hpp"

namespace palpate::suggest_poisson_test {
namespace {

using estimation::block_size_m;
using estimation::parameter;
using estimation::PushedBlock;
using estimation::says;

PushedBlock truth() {
  PushedBlock block;
  block.material = "linear";
  block.points = 600;
  return block;
}

/// The recording with clouds of its pushes as observations. Of the first push the sensor sees the top only.
Recording observed(Recording recording) {
  estimation::Inputs clouds = estimation::clouds_of(truth(), recording);
  estimation::Inputs above(clouds.begin(), clouds.begin() + static_cast<std::ptrdiff_t>(recording.pushes[0].steps.size()));
  estimation::leave_the_top(above);
  std::copy(above.begin(), above.end(), clouds.begin());
  std::size_t s = 0;
  for (Push& push : recording.pushes)
    for (Step& step : push.steps) step.observations = {std::get<PointCloud>(clouds[s++][0])};
  recording.rest.volume = estimation::kuhn_block(4, 3, 2, block_size_m);
  recording.model.refine = "none";
  recording.model.material = "linear";
  return recording;
}

IdentifyOptions quick() {
  IdentifyOptions options;
  options.fit.cross_checks = options.fit.stresses = false;
  return options;
}

/// Bending says little of nu.
Recording bent() {
  Recording recording = estimation::pushed_block_recording();
  for (Step& step : recording.pushes[0].steps) *step.loads[0].force_n *= 0.5;
  return recording;
}

std::string message(const Identification& answer) {
  for (const Verdict& verdict : answer.verdicts)
    if (verdict.code == "nu_not_determined") return verdict.message;
  return "";
}

TEST(PushForPoisson, ThatIsNamedDeliversWhatItPromises) {
  const Recording first = observed(bent());
  Identified found = identify(first, quick());
  const std::string before = message(found.answer);
  ASSERT_FALSE(before.empty()) << parameter(found.answer, "poisson_ratio").std;
  name_push_for_poisson(first, found);
  const std::string said = message(found.answer);
  ASSERT_GT(said.size(), before.size());
  const std::regex words(R"(push at \((\S+) (\S+) (\S+)\) along \((\S+) (\S+) (\S+)\) up to (\S+) (m?N).* within (\S+) \(95 %\))");
  std::smatch part;
  ASSERT_TRUE(std::regex_search(said, part, words)) << said;
  const auto number = [&](std::size_t k) { return std::stod(part[k]); };
  Load load;
  load.tool = "finger";
  load.contact_m = Vec3(number(1), number(2), number(3));
  load.direction = Vec3(number(4), number(5), number(6)).normalized();
  const double force_n = number(7) * (part[8] == "mN" ? 1e-3 : 1);

  Recording both = bent();
  Push push;
  push.name = "named";
  for (int level = 1; level <= 4; ++level) {
    load.force_n = force_n * level / 4 * load.direction;
    push.steps.emplace_back().loads = {load};
  }
  both.pushes.push_back(push);
  // The next push is seen as the first one was.
  Recording second = observed(both);
  for (Step& step : second.pushes[1].steps) {
    estimation::Inputs one{{std::get<PointCloud>(step.observations[0])}};
    estimation::leave_the_top(one);
    step.observations = {std::get<PointCloud>(one[0][0])};
  }
  const Identification after = identify(second, quick()).answer;
  const Parameter& nu = parameter(after, "poisson_ratio");
  std::printf("%s\npromised +-%.3f, delivered +-%.3f\n", said.c_str(), number(9), 1.96 * nu.std);
  EXPECT_LT(nu.std, 0.8 * parameter(found.answer, "poisson_ratio").std);
  EXPECT_LT(std::abs(std::log(1.96 * nu.std / number(9))), std::log(1.6)) << said;
}

TEST(PushForPoisson, NothingIsNamedWhereNuIsKnownOrWhatIsKnownIsDoubtful) {
  const Recording first = observed(bent());
  Identified found = identify(first, quick());
  const std::string before = message(found.answer);
  Identified slipped = found;
  slipped.answer.verdicts.push_back({"contact_slipped", "The tool seems to have slipped."});
  name_push_for_poisson(first, slipped);
  EXPECT_EQ(message(slipped.answer), before);
  Recording known = bent();
  known.model.poisson_fixed = 0.3;
  known = observed(known);
  Identified told = identify(known, quick());
  const auto verdicts = told.answer.verdicts.size();
  name_push_for_poisson(known, told);
  EXPECT_EQ(told.answer.verdicts.size(), verdicts);
  EXPECT_FALSE(says(told.answer, "nu_not_determined"));
}

}  // namespace
}  // namespace palpate::suggest_poisson_test
