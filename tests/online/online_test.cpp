// label: unit
// SPDX-License-Identifier: Apache-2.0
// The door for a robot at work: estimates after every step, and at the end what `identify` says.
#include "palpate/online.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "estimation/pushed_block.hpp"
#include "palpate/core/error.hpp"
#include "palpate/sensing/depth_render.hpp"

namespace palpate::online_test {
namespace {

/// The pushed block with its clouds as observations; first an unloaded step.
Recording pushed_block(const estimation::PushedBlock& truth) {
  Recording recording = estimation::pushed_block_recording();
  const estimation::Inputs clouds = estimation::clouds_of(truth, recording);
  for (std::size_t s = 0; s < clouds.size(); ++s) {
    Step& step = recording.pushes[0].steps[s];
    step.time_s = double(s + 1);
    step.observations = {std::get<PointCloud>(clouds[s][0])};
  }
  recording.pushes[0].steps.insert(recording.pushes[0].steps.begin(), Step{});
  recording.rest.volume = estimation::kuhn_block(4, 3, 2, estimation::block_size_m);
  recording.model.refine = "none";
  return recording;
}

TEST(OnlineEstimator, KnowsMoreAfterEveryStepAndEndsWhereIdentifyDoes) {
  const estimation::PushedBlock truth;
  const Recording whole = pushed_block(truth);
  Recording scene = whole;
  scene.pushes.clear();
  IdentifyOptions options;
  options.fit.cross_checks = options.fit.stresses = false;

  OnlineEstimator online(scene, options);
  Push push = whole.pushes[0];
  push.steps.clear();
  online.begin(push);
  EXPECT_TRUE(online.add(whole.pushes[0].steps[0]).parameters.empty());  // nothing has pressed yet
  double before = 10;
  for (std::size_t s = 1; s < whole.pushes[0].steps.size(); ++s) {
    const Identification& now = online.add(whole.pushes[0].steps[s]);
    ASSERT_EQ(now.parameters.size(), 2u) << now.message;
    const Parameter& young = now.parameters[0];
    EXPECT_LT(std::abs(young.value - truth.young_pa), 4 * young.std);
    EXPECT_LT(young.std / young.value, before);
    before = young.std / young.value;
  }
  const Identification batch = identify(whole, options).answer, end = online.answer().answer;
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(end.parameters[k].value, batch.parameters[k].value);
    EXPECT_EQ(end.parameters[k].lower_95, batch.parameters[k].lower_95);
    EXPECT_NEAR(online.estimate().parameters[k].value, batch.parameters[k].value, 0.1 * batch.parameters[k].std);
  }
}

/// A glued block under a disc of 12 mm whose contact point is stated off its surface.
Recording glued_block(double stated_above_m) {
  Recording recording = estimation::glued_block_recording({Vec3(0, 0, -0.8), Vec3(0, 0, -1.6), Vec3(0, 0, -2.4)}, 0.028, 0.02);
  recording.model.material = "linear";
  estimation::PushedBlock truth;
  truth.material = "linear";
  const estimation::Inputs clouds = estimation::clouds_of(truth, recording);
  for (std::size_t s = 0; s < clouds.size(); ++s) {
    Step& step = recording.pushes[0].steps[s];
    step.observations = {std::get<PointCloud>(clouds[s][0])};
    step.loads[0].contact_m.z() += stated_above_m;
  }
  recording.rest.volume = estimation::kuhn_block(4, 3, 2, estimation::block_size_m);
  recording.model.refine = "none";
  return recording;
}

OnlineEstimator before_the_first_step(Recording recording) {
  Push push = recording.pushes[0];
  push.steps.clear();
  recording.pushes.clear();
  IdentifyOptions options;
  options.fit.cross_checks = options.fit.stresses = false;
  OnlineEstimator online(recording, options);
  online.begin(push);
  return online;
}

// What the recording says of contacts is taken by a running estimate as `identify` takes it, and stays so with every further step.
TEST(OnlineEstimator, ContactsLieOnTheSurface) {
  const Recording whole = glued_block(0.008);
  OnlineEstimator online = before_the_first_step(whole);
  for (const Step& step : whole.pushes[0].steps) online.add(step);
  const Parameter running = online.estimate().parameters.at(0), end = online.answer().answer.parameters.at(0);
  EXPECT_NEAR(running.value, end.value, 0.1 * end.std);
  EXPECT_EQ(online.recording().pushes[0].steps[0].loads[0].contact_m.z(), whole.pushes[0].steps[0].loads[0].contact_m.z()) << "as it was given";
}

TEST(OnlineEstimator, RefusesAContactThatIsFurtherOffThanTheToolIsWide) {
  const Recording whole = glued_block(0), off = glued_block(0.02);
  OnlineEstimator online = before_the_first_step(whole);
  online.add(whole.pushes[0].steps[0]);
  EXPECT_THROW(online.add(off.pushes[0].steps[1]), Error);
  EXPECT_EQ(online.recording().pushes[0].steps.size(), 1u);
  EXPECT_EQ(online.add(whole.pushes[0].steps[1]).parameters.size(), 2u);
  EXPECT_EQ(online.recording().pushes[0].steps.size(), 2u);
}

TEST(OnlineEstimator, AToolThatSlippedTouchesElsewhereFromThereOn) {
  Recording whole = glued_block(0);
  whole.pushes[0].steps[1].slipped = true;
  OnlineEstimator online = before_the_first_step(whole);
  for (const Step& step : whole.pushes[0].steps) online.add(step);
  const auto shifts = [](const std::vector<Nuisance>& all) {
    return std::count_if(all.begin(), all.end(), [](const Nuisance& one) { return one.name.rfind("contact_shift[down, slipped]", 0) == 0; });
  };
  EXPECT_EQ(shifts(online.estimate().nuisances), 2);
  EXPECT_EQ(shifts(online.answer().answer.nuisances), 2);
}

/// What a fixed camera's calibration errs by does not average out over steps, online or not.
class SeenByOneCamera : public testing::Test {
 protected:
  void SetUp() override {
    scene_ = estimation::pushed_block_recording();
    scene_.model.material = "linear";
    scene_.model.refine = "none";
    scene_.rest.volume = estimation::kuhn_block(4, 3, 2, estimation::block_size_m);
    const Step like = scene_.pushes[0].steps[0];
    std::vector<Step>& steps = scene_.pushes[0].steps;
    steps.assign(5, like);
    steps[0].loads.clear();
    for (int k = 1; k < 5; ++k) steps[std::size_t(k)].loads[0].force_n = Vec3(0, 0, -0.03 * k);
    const estimation::SimulatedObject object = estimation::coarse_block("linear");
    estimation::Unknowns unknowns;
    estimation::ForwardModel model(scene_, object, unknowns);
    VectorX truth = unknowns.prior_mean();
    truth(estimation::log_young) = std::log(2e4);
    truth(estimation::poisson) = 0.3;
    for (std::size_t s = 0; s < steps.size(); ++s) {
      TriMesh surface = object.surface.rest();
      surface.vertices_m = model.predict(s, truth).surface_m;
      steps[s].time_s = double(s);
      steps[s].observations = {frame_of(surface, 0.2)};
      farther_.push_back(frame_of(surface, 0.5));
    }
    push_ = scene_.pushes[0];
    scene_.pushes.clear();
    options_.fit.cross_checks = options_.fit.stresses = false;
  }
  DepthFrame frame_of(const TriMesh& surface, double distance_m) {
    const Vec3 middle(0.03, 0.02, 0.015), eye = middle + distance_m * Vec3(0.4, -1, 1).normalized();
    const Vec3 z = (middle - eye).normalized(), x = z.cross(Vec3::UnitZ()).normalized();
    DepthFrame frame;
    frame.camera = {160, 120, 150, 150, 79.5, 59.5, DistortionModel::none, {}};
    frame.T_base_camera.linear() << x, z.cross(x), z;
    frame.T_base_camera.translation() = eye;
    frame.pose_std_m = 2e-3;
    frame.pose_std_rad = 5e-3;
    frame.noise.model = "constant";
    frame.noise.sigma_m = 5e-4;
    frame.depth_m = sensing::render_depth({{&surface, Pose::Identity()}}, frame.camera, frame.T_base_camera);
    for (Index i = 0; i < frame.depth_m.size(); ++i)
      if (frame.depth_m.data()[i] > 0) frame.depth_m.data()[i] += float(5e-4 * normal_(random_));
    return frame;
  }
  OnlineEstimator begun() const {
    OnlineEstimator online(scene_, options_);
    Push named = push_;
    named.steps.clear();
    online.begin(named);
    return online;
  }
  std::mt19937 random_{3};
  std::normal_distribution<double> normal_;
  Recording scene_;
  Push push_;
  std::vector<DepthFrame> farther_;
  IdentifyOptions options_;
};

TEST_F(SeenByOneCamera, ItsCommonPoseIsAnUnknownOfAllSteps) {
  OnlineEstimator online = begun();
  for (const Step& step : push_.steps) online.add(step);
  const Identification now = online.estimate(), whole = online.answer().answer;
  const auto cameras = [](const Identification& answer) {
    return std::count_if(answer.nuisances.begin(), answer.nuisances.end(), [](const Nuisance& one) { return one.name.rfind("camera", 0) == 0; });
  };
  EXPECT_EQ(cameras(now), 6);
  EXPECT_EQ(cameras(whole), 6);
  // Rays that come to miss the block's edges speak in the whole fit alone: over twelve draws of noise the two are 0.24 standard
  // deviations apart rms, 0.6 at most.
  EXPECT_NEAR(now.parameters.at(0).std / whole.parameters.at(0).std, 1, 0.1);
  EXPECT_NEAR(now.parameters.at(0).value, whole.parameters.at(0).value, 0.5 * whole.parameters.at(0).std);
}

/// A caller's exception takes the step back with all that it left behind: a next one may have other rays.
TEST_F(SeenByOneCamera, AStepThatWasBrokenOffLeavesNothingBehind) {
  OnlineEstimator plain = begun(), broken = begun();
  for (std::size_t s = 0; s < 3; ++s) plain.add(push_.steps[s]), broken.add(push_.steps[s]);
  const double expected = plain.add(push_.steps[3]).parameters.at(0).value;
  for (const int last : {2, 4, 7}) {
    Step other = push_.steps[3];
    other.observations = {farther_[3]};
    int calls = 0;
    EXPECT_THROW(broken.add(other, [&](std::string_view, double) -> bool { return ++calls < last ? true : throw std::runtime_error("stop"); }),
                 std::runtime_error);
  }
  const Identification& then = broken.add(push_.steps[3]);
  // What the steps before said is made anew, at another place than before: 0.03 deviations, with the same rays in between as well.
  EXPECT_NEAR(then.parameters.at(0).value, expected, 0.05 * then.parameters.at(0).std);
}

/// A force that is imposed is no observation of it.
// Views are not carried along with every step, and the first push was refused for want of a shape.
TEST(OnlineEstimator, AnObjectThatIsSeenInViewsCanBePushed) {
  Recording scene = pushed_block({});
  Push push = scene.pushes[0];
  push.steps.clear();
  scene.pushes.clear();
  scene.rest.volume.reset();
  DepthFrame view;
  view.camera = {64, 48, 60, 60, 31.5, 23.5, DistortionModel::none, {}};
  view.noise.sigma_m = 1e-3;
  view.depth_m = DepthImage::Constant(48, 64, 0.5f);
  scene.rest.views = {view};
  scene.supports.clear();  // they name vertices of the mesh
  OnlineEstimator online(scene);
  EXPECT_NO_THROW(online.begin(push));
}

TEST(OnlineEstimator, WaitsUntilSomethingIsSeen) {
  Recording whole = pushed_block({});
  Recording scene = whole;
  scene.pushes.clear();
  OnlineEstimator online(scene);
  Push push = whole.pushes[0];
  push.steps.clear();
  online.begin(push);
  Step first = whole.pushes[0].steps[1];
  Wrench wrench;
  wrench.tool = first.loads[0].tool;
  wrench.force_n = *first.loads[0].force_n;
  wrench.force_sigma_n = 0.01;
  first.observations = {wrench};
  EXPECT_TRUE(online.add(first).parameters.empty());
  EXPECT_EQ(online.add(whole.pushes[0].steps[2]).parameters.size(), 2u);
}

TEST(OnlineEstimator, RefusesOptionsThatWouldHaveNoSay) {
  Recording scene = pushed_block({});
  scene.pushes.clear();
  IdentifyOptions paper, by_site;
  paper.method = "paper";
  by_site.regions = "by-site";
  EXPECT_THROW(OnlineEstimator(scene, paper), Error);
  EXPECT_THROW(OnlineEstimator(scene, by_site), Error);
}

TEST(OnlineEstimator, RefusesAStepAndGoesOnWithoutIt) {
  const Recording whole = pushed_block({});
  Recording scene = whole;
  scene.pushes.clear();
  OnlineEstimator online(scene);
  EXPECT_THROW(online.add(whole.pushes[0].steps[1]), Error);  // no push
  Push push = whole.pushes[0];
  push.steps.clear();
  online.begin(push);
  EXPECT_THROW(online.begin(push), Error);
  Step bad = whole.pushes[0].steps[1];
  bad.loads[0].tool = "no such tool";
  EXPECT_THROW(online.add(bad), Error);
  EXPECT_TRUE(online.recording().pushes[0].steps.empty());
  // Frames that no camera took are refused before anything is taken in, step by step and with a whole push.
  bad = whole.pushes[0].steps[1];
  bad.observations = {DepthFrame{}};
  EXPECT_THROW(online.add(bad), Error);
  EXPECT_TRUE(online.recording().pushes[0].steps.empty());
  Push bad_push = push;
  bad_push.name = "bad";
  bad_push.steps = {bad};
  EXPECT_THROW(online.begin(bad_push), Error);
  EXPECT_EQ(online.recording().pushes.size(), 1u);
  EXPECT_EQ(online.add(whole.pushes[0].steps[1]).parameters.size(), 2u);
}

}  // namespace
}  // namespace palpate::online_test
