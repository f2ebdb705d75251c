// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The lab's force over travel, against presses to the same force from rest; of small strains with one solution alone.
#include "palpate/lab/force_curve.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/lab/pressed_block.hpp"

namespace palpate::lab::force_curve_test {
namespace {

PressedBlockOptions block_of(const char* law) {
  PressedBlockOptions block;
  block.cells_in_radius = 2;
  block.cell_share = 2;
  block.material = law;
  return block;
}

/// Counts what is asked of a block.
class Counted : public Pressed {
 public:
  Counted(const PressedBlockOptions& block, int& presses) : block_(block), presses_(presses) {}
  void press(double force_n) override { ++presses_, block_.press(force_n); }
  double force_n() const override { return block_.force_n(); }
  double travel_m() const override { return block_.travel_m(); }
  TriMesh surface() const override { return block_.surface(); }
  Index nodes() const override { return block_.nodes(); }

 private:
  PressedBlock block_;
  int& presses_;
};

TEST(ForceCurve, SmallStrainsAreSolvedForOnceAndEndWhereAPressEnds) {
  const PressedBlockOptions block = block_of("linear");
  int presses = 0;
  ForceCurve curve(std::make_unique<Counted>(block, presses), 0.5, 0.0015, true);
  for (const double travel_m : {0.001, 0.012, 0.0004}) {
    const auto place = curve.at(travel_m);
    PressedBlock afresh(block);
    afresh.press(curve.force_n(place));
    EXPECT_NEAR(afresh.travel_m(), travel_m, 1e-6 * travel_m);
    EXPECT_LT((afresh.surface().vertices_m - curve.surface(place).vertices_m).cwiseAbs().maxCoeff(), 1e-6 * travel_m);
  }
  EXPECT_EQ(presses, 1);
  EXPECT_EQ(curve.force_n(curve.at(-0.01)), 0);
  EXPECT_EQ(presses, 1);
}

TEST(ForceCurve, WhatIsNotInProportionIsSolvedForOnItsWay) {
  const PressedBlockOptions block = block_of("neo_hookean");
  int presses = 0;
  ForceCurve curve(std::make_unique<Counted>(block, presses), 2, 0.003);
  const double deep_n = curve.force_n(curve.at(0.012)), shallow_n = curve.force_n(curve.at(0.001));
  EXPECT_GT(presses, 3);
  EXPECT_GT(std::abs(deep_n / (12 * shallow_n) - 1), 0.01) << "such a law is not taken for proportional";
  PressedBlock afresh(block);
  afresh.press(deep_n);
  EXPECT_NEAR(afresh.travel_m(), 0.012, 1e-4);
}

/// Bears 5 N, and is followed over no step of more than 0.1 N; what is searched for is found.
class Fragile : public Pressed {
 public:
  Fragile(std::vector<double>& followed_n, int& searches) : followed_n_(followed_n), searches_(searches) {}
  void press(double force_n) override {
    ++searches_;
    if (force_n > 5) throw Error("no equilibrium", "Fragile");
    force_n_ = force_n;
  }
  bool follow(double force_n) override {
    if (force_n > 5 || force_n > force_n_ + 0.1) return false;
    force_n_ = force_n;
    followed_n_.push_back(force_n);
    return true;
  }
  double force_n() const override { return force_n_; }
  double travel_m() const override { return 0.001 * force_n_; }
  TriMesh surface() const override { return {}; }
  Index nodes() const override { return 0; }

 private:
  std::vector<double>& followed_n_;
  int& searches_;
  double force_n_ = 0;
};

TEST(ForceCurve, GoesOnInSmallerStepsWhereAnObjectIsNotFollowedOverAWholeOne) {
  std::vector<double> followed_n;
  int searches = 0;
  ForceCurve curve(std::make_unique<Fragile>(followed_n, searches), 0.35, 0.0002);
  EXPECT_NEAR(curve.force_n(curve.at(0.0045)), 4.5, 1e-9);
  EXPECT_GT(followed_n.size(), 40u);
  EXPECT_EQ(searches, 0);
  EXPECT_THROW(curve.at(0.006), Error) << "no more than it bears";
  EXPECT_EQ(searches, 1);
  EXPECT_NEAR(curve.force_n(curve.at(0.003)), 3, 1e-9) << "what is known stays";

  followed_n.clear();
  ForceCurve far(std::make_unique<Fragile>(followed_n, searches), 4, 0.004);
  EXPECT_NEAR(far.force_n(far.at(0.0005)), 0.5, 1e-9);
  EXPECT_EQ(searches, 2) << "a step that stays too long is searched for at last";
}

TEST(ForceCurve, ABlockThatIsNotFollowedIsLeftAsItWas) {
  PressedBlockOptions block = block_of("foam");
  block.poisson_ratio = 0.1;
  PressedBlock pressed(block), in_steps(block);
  pressed.press(16);
  for (double force_n = 1; force_n <= 16; ++force_n) ASSERT_TRUE(in_steps.follow(force_n));
  EXPECT_NEAR(pressed.travel_m(), in_steps.travel_m(), 1e-5 * in_steps.travel_m());
  const double travel_m = in_steps.travel_m();
  EXPECT_FALSE(in_steps.follow(400));
  EXPECT_EQ(in_steps.travel_m(), travel_m);
  EXPECT_EQ(in_steps.force_n(), 16);
}

/// Softens until it bears no more: 10 N at 50 mm. A short way is half of what is left to that.
class Softening : public Pressed {
 public:
  explicit Softening(int& presses) : presses_(presses) {}
  void press(double force_n) override {
    ++presses_;
    if (force_n >= most_n) throw Error("found no equilibrium", "Softening");
    force_n_ = force_n;
  }
  bool follow(double force_n) override {
    if (most_n - force_n < 0.5 * (most_n - force_n_)) return false;
    press(force_n);
    return true;
  }
  double force_n() const override { return force_n_; }
  double travel_m() const override { return 0.05 * (1 - std::sqrt(1 - force_n_ / most_n)); }
  TriMesh surface() const override {
    TriMesh out;
    out.vertices_m = Points::Constant(3, 3, -travel_m());
    out.triangles = Triangles(1, 3);
    out.triangles << 0, 1, 2;
    return out;
  }
  Index nodes() const override { return 3; }

 private:
  static constexpr double most_n = 10;
  int& presses_;
  double force_n_ = 0;
};

TEST(ForceCurve, EndsAtTheMostThatTheObjectBears) {
  int presses = 0;
  ForceCurve curve(std::make_unique<Softening>(presses), 0.5, 0.003);
  EXPECT_NEAR(curve.force_n(curve.at(0.03)), 10 * (1 - 0.4 * 0.4), 0.02);
  EXPECT_NEAR(curve.force_n(curve.at(0.051)), 10, 0.01);
  EXPECT_NEAR(curve.surface(curve.at(0.051)).vertices_m(0, 0), -0.051, 1e-6);
  EXPECT_LT(presses, 60);
  EXPECT_THROW(curve.at(0.06), Error);
  EXPECT_NEAR(curve.force_n(curve.at(0.03)), 10 * (1 - 0.4 * 0.4), 0.02) << "and what was known is";
}

/// Not found beyond some force, neither on its way nor from rest.
class Lost : public Softening {
 public:
  Lost(int& presses, int& lost, double most_found_n) : Softening(presses), lost_(lost), most_found_n_(most_found_n) {}
  void press(double force_n) override {
    if (force_n > most_found_n_) {
      ++lost_;
      throw Error("found no equilibrium", "Lost");
    }
    Softening::press(force_n);
  }
  bool follow(double force_n) override { return force_n <= most_found_n_ && Softening::follow(force_n); }

 private:
  int& lost_;
  double most_found_n_;
};

TEST(ForceCurve, EndsWhereASearchJustBeyondTheLastFindsNothing) {
  int presses = 0, lost = 0;
  ForceCurve softening(std::make_unique<Softening>(presses), 0.5, 0.001);
  const auto place = softening.at(0.045);
  const double last_n = softening.force_n({place.below + 1, 0}), most_n = last_n + 1e-5, limit_m = 0.05 * (1 - std::sqrt(1 - last_n / 10));
  ForceCurve near(std::make_unique<Lost>(presses, lost, most_n), 0.5, 0.001);
  EXPECT_NEAR(near.force_n(near.at(1.01 * limit_m)), last_n, 1e-9);
  EXPECT_EQ(lost, 1);
  EXPECT_THROW(near.at(1.1 * limit_m), Error);
  EXPECT_EQ(lost, 1) << "once is enough";

  ForceCurve far(std::make_unique<Lost>(presses, lost, 7.8), 0.5, 0.003);
  EXPECT_THROW(far.at(0.04), Error) << "the same in a long step is an object that was not found";
  EXPECT_NEAR(far.force_n(far.at(0.02)), 10 * (1 - 0.6 * 0.6), 0.02);
}

}  // namespace
}  // namespace palpate::lab::force_curve_test
