// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/push_events.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "palpate/core/error.hpp"
#include "refusals.hpp"

namespace palpate::sensing::push_events_test {
namespace {

const Vec3 down = -Vec3::UnitZ();

ContactSample sample(double time_s, double force_n, double depth_m, const Vec3& aside_n = Vec3::Zero(),
                     const Vec3& aside_m = Vec3::Zero()) {
  return {time_s, force_n * down + aside_n, depth_m * down + aside_m};
}

TEST(Contact, IsTheFirstSampleOfARunAboveNoise) {
  std::mt19937 generator(1);
  std::normal_distribution<double> noise(0, 0.1);
  std::vector<ContactSample> samples;
  for (int i = 0; i < 200; ++i) samples.push_back(sample(0.01 * i, noise(generator) + (i >= 120 ? 0.1 * (i - 119) : 0), 0));
  samples[50].force_n = 2 * down;  // one spike
  const auto contact = find_contact(samples, down, 0.1);
  ASSERT_TRUE(contact);
  EXPECT_GE(*contact, 121u);  // 0.5 N are five sigma
  EXPECT_LE(*contact, 128u);
  EXPECT_FALSE(find_contact(std::span(samples).first(110), down, 0.1));
  EXPECT_FALSE(find_contact(samples, Vec3::UnitX(), 0.1));
  EXPECT_THROW(find_contact(samples, 2 * down, 0.1), Error);
  EXPECT_THROW(find_contact(samples, down, -1), Error);
}

TEST(Settling, RelaxingForceSettlesWhenItsSlopeIsSmall) {
  // F = 5 + 2 exp(-t / 0.8 s): dF/dt falls under 0.05 N/s at t = 3.13 s
  std::vector<ContactSample> samples;
  double settled_at = -1;
  for (int i = 0; i <= 800; ++i) {
    const double t = 0.01 * i;
    samples.push_back(sample(t, 5 + 2 * std::exp(-t / 0.8), 0.01));
    if (settled_at < 0 && settling(samples, down).settled) settled_at = t;
  }
  EXPECT_GT(settled_at, 3.13);
  EXPECT_LT(settled_at, 3.13 + 0.5);  // the window looks back half a second
  EXPECT_NEAR(settling(samples, down).force_n, 5, 1e-3);
}

TEST(Settling, NoiseAloneNeverSettlesACreepingForce) {
  std::mt19937 generator(5);
  std::normal_distribution<double> noise(0, 0.2);
  int settled = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<ContactSample> samples;
    for (int i = 0; i <= 50; ++i) samples.push_back(sample(0.01 * i, 5 - 0.3 * 0.01 * i + noise(generator), 0.01));
    settled += settling(samples, down).settled;
  }
  EXPECT_LE(settled, 4);
}

TEST(Settling, NeedsItsWholeWindow) {
  std::vector<ContactSample> samples;
  EXPECT_FALSE(settling(samples, down).settled);
  for (int i = 0; i < 20; ++i) samples.push_back(sample(0.01 * i, 5, 0.01));
  EXPECT_FALSE(settling(samples, down).settled);
  for (int i = 20; i < 60; ++i) samples.push_back(sample(0.01 * i, 5, 0.01));
  EXPECT_TRUE(settling(samples, down).settled);
}

TEST(Watch, NamesWhatHappens) {
  std::vector<ContactSample> push;
  for (int i = 0; i <= 10; ++i) push.push_back(sample(i, 1.0 * i, 0.001 * i));
  EXPECT_EQ(watch(push, down, 0.1), PushEvent::none);
  const auto with = [&](const ContactSample& s) {
    std::vector<ContactSample> more = push;
    more.push_back(s);
    return watch(more, down, 0.1);
  };
  EXPECT_EQ(with(sample(11, 11, 0.011, {}, {0.003, 0, 0})), PushEvent::slip_sideways);
  EXPECT_EQ(with(sample(11, 11, 0.011, {}, {0.001, 0, 0})), PushEvent::none);
  EXPECT_EQ(with(sample(11, 11, 0.011, {9.5, 0, 0})), PushEvent::slip_friction);
  EXPECT_EQ(with(sample(11, 7, 0.011)), PushEvent::force_drop);
  EXPECT_EQ(with(sample(11, 7, 0.0105)), PushEvent::none) << "an arm that repeats to a millimetre";
  EXPECT_EQ(with(sample(11, 7, 0.006)), PushEvent::none) << "going back, the force may fall";
  EXPECT_EQ(with(sample(11, 0.05, 0.011)), PushEvent::contact_lost);
  SlipOptions noisy;
  noisy.noise_n = 0.4;
  push.push_back(sample(11, 7, 0.011));
  EXPECT_EQ(watch(push, down, 0.1, noisy), PushEvent::force_drop) << "3 N are beyond six times 0.4";
  noisy.noise_n = 0.6;
  EXPECT_EQ(watch(push, down, 0.1, noisy), PushEvent::none);
  EXPECT_EQ(watch({}, down, 0.1), PushEvent::none);
  EXPECT_STRNE(to_words(PushEvent::force_drop), to_words(PushEvent::none));
}

TEST(PushEventOptions, BadOnesAreRefused) {
  const auto refused = [](auto options, auto change) { return refuses([](const auto& o) { check(o); }, options, change); };
  using C = ContactOptions;
  using S = SettlingOptions;
  using L = SlipOptions;
  EXPECT_FALSE(refused(C{}, [](C&) {}));
  EXPECT_FALSE(refused(S{}, [](S&) {}));
  EXPECT_FALSE(refused(L{}, [](L&) {}));
  EXPECT_TRUE(refused(C{}, [](C& o) { o.threshold_n = 0; }));
  EXPECT_TRUE(refused(C{}, [](C& o) { o.noise_factor = -1; }));
  EXPECT_TRUE(refused(C{}, [](C& o) { o.confirm_samples = 0; }));
  EXPECT_TRUE(refused(S{}, [](S& o) { o.rate_n_s = 0; }));
  EXPECT_TRUE(refused(S{}, [](S& o) { o.relative_rate_s = -1; }));
  EXPECT_TRUE(refused(S{}, [](S& o) { o.window_s = 0; }));
  EXPECT_TRUE(refused(L{}, [](L& o) { o.tangential_m = 0; }));
  EXPECT_TRUE(refused(L{}, [](L& o) { o.friction_limit = 0; }));
  EXPECT_TRUE(refused(L{}, [](L& o) { o.force_drop = 1.5; }));
  EXPECT_TRUE(refused(L{}, [](L& o) { o.least_force_n = -1; }));
  EXPECT_TRUE(refused(L{}, [](L& o) { o.noise_n = -1; }));
}

}  // namespace
}  // namespace palpate::sensing::push_events_test
