// label: oracle
// SPDX-License-Identifier: Apache-2.0
// States that objects of like nu share, against objects that are pressed by themselves.
#include "palpate/lab/pressed_memory.hpp"

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/lab/paper_scenes.hpp"
#include "palpate/lab/pressed_block.hpp"

namespace palpate::lab::pressed_memory_test {
namespace {

std::unique_ptr<Pressed> block(double young_modulus_pa, const PushSite&) {
  PressedBlockOptions block;
  block.cells_in_radius = 2;
  block.cell_share = 2;
  block.young_modulus_pa = young_modulus_pa;
  return std::make_unique<PressedBlock>(block);
}

TEST(PressedMemory, OfAnotherEThereIsNothingToSolveFor) {
  const PushSite top{"top", Vec3(0, 0, 0.1), -Vec3::UnitZ(), 1};
  PressedMemory memory;
  for (const double young_pa : {23e3, 7.7e3, 31e3}) {
    const auto kept = memory.at("block", young_pa, top, block), alone = block(young_pa, top);
    EXPECT_EQ(kept->nodes(), alone->nodes());
    EXPECT_EQ(kept->surface().vertices_m, alone->surface().vertices_m);
    for (const double share : {0.003, 0.012, 0.03}) {
      const double force_n = share * young_pa * 0.01;
      kept->press(force_n);
      alone->press(force_n);
      EXPECT_EQ(kept->force_n(), force_n);
      EXPECT_NEAR(kept->travel_m(), alone->travel_m(), 1e-7 * alone->travel_m());
      EXPECT_LT((kept->surface().vertices_m - alone->surface().vertices_m).cwiseAbs().maxCoeff(), 1e-7 * alone->travel_m());
    }
    EXPECT_EQ(memory.solved(), 3) << young_pa;
  }
}

TEST(PressedMemory, GoesOnWhereTheOneBeforeEndedAndTakesAnotherWay) {
  const PushSite top{"top", Vec3(0, 0, 0.1), -Vec3::UnitZ(), 1};
  PressedMemory memory;
  const auto pressed = [&](PressedMemory& by, double young_pa, const std::vector<double>& shares) {
    auto object = by.at("block", young_pa, top, block);
    for (const double share : shares) object->press(share * young_pa);
    return object;
  };
  pressed(memory, 12e3, {3e-5, 1e-4});
  const auto deeper = pressed(memory, 17e3, {3e-5, 1e-4, 2e-4});
  EXPECT_EQ(memory.solved(), 2 + 3) << "the new object is brought to where the other one stood";
  const auto otherwise = pressed(memory, 9e3, {3e-5, 1.5e-4, 2e-4});
  for (const auto& [one, shares] : {std::pair(deeper.get(), std::vector<double>{3e-5, 1e-4, 2e-4}),
                                    std::pair(otherwise.get(), std::vector<double>{3e-5, 1.5e-4, 2e-4})}) {
    PressedMemory fresh;
    const auto same = pressed(fresh, 25e3, shares);
    EXPECT_EQ(one->travel_m(), same->travel_m()) << "to the last digit";
    EXPECT_EQ(one->surface().vertices_m, same->surface().vertices_m);
  }
}

TEST(PressedMemory, WhatIsKeptElsewhereOutlivesIt) {
  const PushSite top{"top", Vec3(0, 0, 0.1), -Vec3::UnitZ(), 1};
  std::map<std::string, MatrixX> kept;
  const PressedMemory::Store store{[&](const std::string& name) { return kept.contains(name) ? std::optional(kept[name]) : std::nullopt; },
                                   [&](const std::string& name, const MatrixX& states) { kept[name] = states; }};
  const auto pressed = [&](PressedMemory& by, const PressedMemory::Make& make, std::size_t times) {
    auto object = by.at("block", 17e3, top, make);
    for (const double share : std::vector{3e-5, 1e-4, 2e-4}) {
      if (times-- == 0) break;
      object->press(share * 17e3);
    }
    return object;
  };
  PressedMemory first(store), second(store), alone;
  pressed(first, block, 2);  // stopped before the third
  ASSERT_EQ(kept.size(), 1u);
  EXPECT_EQ(kept.begin()->second.rows(), 3) << "at rest and two";
  const auto on = pressed(second, block, 3), whole = pressed(alone, block, 3);
  EXPECT_EQ(second.solved(), 3) << "the third, and the way to it";
  EXPECT_EQ(on->travel_m(), whole->travel_m()) << "to the last digit";
  EXPECT_EQ(on->surface().vertices_m, whole->surface().vertices_m);
  PressedMemory third(store);
  EXPECT_EQ(pressed(third, block, 3)->surface().vertices_m, whole->surface().vertices_m);
  EXPECT_EQ(third.solved(), 0);

  PressedMemory other(store);  // on a finer mesh
  const auto finer = [](double young_modulus_pa, const PushSite&) {
    PressedBlockOptions block;
    block.cells_in_radius = 3;
    block.cell_share = 2;
    block.young_modulus_pa = young_modulus_pa;
    return std::make_unique<PressedBlock>(block);
  };
  pressed(other, finer, 3);
  EXPECT_EQ(other.solved(), 3) << "states of another surface are not taken";
}

/// A spring of a newton a millimetre that is followed by short steps alone, and bears 6 N.
class ShortSteps : public Pressed {
 public:
  void press(double force_n) override {
    if (force_n > 6) throw Error("no equilibrium", "ShortSteps");
    force_n_ = force_n;
  }
  bool follow(double force_n) override {
    if (force_n - force_n_ > 1.5) return false;
    press(force_n);
    return true;
  }
  double force_n() const override { return force_n_; }
  double travel_m() const override { return 1e-3 * force_n_; }
  TriMesh surface() const override {
    TriMesh out;
    out.vertices_m = Points::Constant(3, 3, 1 - travel_m());
    out.triangles = Triangles(1, 3);
    out.triangles << 0, 1, 2;
    return out;
  }
  Index nodes() const override { return 3; }

 private:
  double force_n_ = 0;
};

TEST(PressedMemory, WhatWasTooFarIsNotTriedAgain) {
  const PushSite top{"top", Vec3(0, 0, 0.1), -Vec3::UnitZ(), 1};
  std::map<std::string, MatrixX> kept;
  const PressedMemory::Store store{[&](const std::string& name) { return kept.contains(name) ? std::optional(kept[name]) : std::nullopt; },
                                   [&](const std::string& name, const MatrixX& states) { kept[name] = states; }};
  const auto spring = [](double, const PushSite&) { return std::make_unique<ShortSteps>(); };
  for (const int solved : {4, 0}) {
    PressedMemory memory(store);
    const auto object = memory.at("spring", 1e4, top, spring);
    EXPECT_TRUE(object->follow(1));
    EXPECT_FALSE(object->follow(3));
    EXPECT_TRUE(object->follow(2));
    EXPECT_TRUE(object->follow(3));
    EXPECT_FALSE(object->follow(5));
    EXPECT_EQ(object->force_n(), 3);
    EXPECT_EQ(object->travel_m(), 3e-3);
    object->press(5);
    EXPECT_EQ(memory.solved(), solved);
    EXPECT_EQ(kept.begin()->second.rows(), 1 + 4 + 2);
  }
  PressedMemory memory(store);  // another way has other folds
  const auto otherwise = memory.at("spring", 1e4, top, spring);
  EXPECT_TRUE(otherwise->follow(1));
  EXPECT_TRUE(otherwise->follow(2.5));
  EXPECT_FALSE(otherwise->follow(5));
  EXPECT_EQ(kept.begin()->second.rows(), 1 + 2 + 2) << "one of the first way, after its first state, and one of this";
}

TEST(PressedMemory, WhatWasNotFoundIsNotSearchedForAgain) {
  const PushSite top{"top", Vec3(0, 0, 0.1), -Vec3::UnitZ(), 1};
  std::map<std::string, MatrixX> kept;
  const PressedMemory::Store store{[&](const std::string& name) { return kept.contains(name) ? std::optional(kept[name]) : std::nullopt; },
                                   [&](const std::string& name, const MatrixX& states) { kept[name] = states; }};
  int made = 0;
  const auto spring = [&](double, const PushSite&) { return ++made, std::make_unique<ShortSteps>(); };
  for (const int solved : {3, 0}) {
    PressedMemory memory(store);
    const auto object = memory.at("spring", 1e4, top, spring);
    object->press(4);
    EXPECT_FALSE(object->follow(7));
    EXPECT_THROW(object->press(7), Error);
    EXPECT_EQ(object->force_n(), 4);
    EXPECT_EQ(object->travel_m(), 4e-3);
    object->press(5.5);  // from rest over 4 N, for it was lost
    EXPECT_EQ(object->travel_m(), 5.5e-3);
    EXPECT_EQ(memory.solved(), solved);
    EXPECT_EQ(kept.begin()->second.rows(), 1 + 2 + 2);
  }
  EXPECT_EQ(made, 3) << "two at first, for the state at rest the last time";
}

TEST(PressedMemory, ARecordingIsTheSameWithAndWithoutIt) {
  const PaperScene& scene = paper_scene("cube");
  PressedMemory memory;
  const PaperTrial first = make_paper_trial(scene, 1, {}, {}, &memory);
  const int solved = memory.solved();
  EXPECT_GT(solved, 0);
  std::uint64_t seed = 2;
  const auto poisson_of = [&](std::uint64_t of) {
    return make_paper_trial(scene, of, [](std::string_view, double) { return false; }).poisson_ratio;
  };
  while (poisson_of(seed) != first.poisson_ratio) ++seed;
  const PaperTrial by_memory = make_paper_trial(scene, seed, {}, {}, &memory), alone = make_paper_trial(scene, seed);
  EXPECT_EQ(memory.solved(), solved);
  EXPECT_NE(alone.young_modulus_pa, first.young_modulus_pa);
  const Push &a = by_memory.recording.pushes.at(0), &b = alone.recording.pushes.at(0);
  ASSERT_EQ(a.steps.size(), b.steps.size());
  for (std::size_t s = 0; s < a.steps.size(); ++s) {
    ASSERT_EQ(a.steps[s].observations.size(), b.steps[s].observations.size());
    for (std::size_t k = 0; k < a.steps[s].observations.size(); ++k) {
      if (const auto* image = std::get_if<DepthFrame>(&a.steps[s].observations[k])) {
        EXPECT_TRUE(image->depth_m == std::get<DepthFrame>(b.steps[s].observations[k]).depth_m) << s;
      }
      if (const auto* travel = std::get_if<ToolTravel>(&a.steps[s].observations[k])) {
        EXPECT_EQ(travel->travel_m, std::get<ToolTravel>(b.steps[s].observations[k]).travel_m) << s;
      }
    }
    if (!a.steps[s].loads.empty()) {
      EXPECT_EQ(*a.steps[s].loads[0].force_n, *b.steps[s].loads[0].force_n) << s;
    }
  }
  EXPECT_EQ(by_memory.unused.steps.size(), alone.unused.steps.size());
}

}  // namespace
}  // namespace palpate::lab::pressed_memory_test
