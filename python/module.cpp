// SPDX-License-Identifier: Apache-2.0
// The functions behind `import palpate`. What users see, with its documentation, is python/palpate/__init__.py.
#include <fmt/format.h>

#include <filesystem>

#include "cli/bag_recording.hpp"
#include "cli/exported_object.hpp"
#include "cli/learned_object.hpp"
#include "cli/paths.hpp"
#include "cli/predicted_push.hpp"
#include "palpate/core/version.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/regions.hpp"
#include "palpate/io/exporters.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/result.hpp"
#include "palpate/io/urdf.hpp"
#include "palpate/lab/built_in.hpp"
#include "palpate/online.hpp"
#include "palpate/report/report.hpp"
#include "palpate/sensing/depth_noise.hpp"
#include "palpate/suggest.hpp"
#include "python/arguments.hpp"
#include "python/check.hpp"
#include "python/poses.hpp"
#include "python/python_calls.hpp"
#include "python/robot.hpp"

namespace palpate::python {
namespace {

namespace fs = std::filesystem;

/// Every noun that has a class in Python, those that others hold first.
void for_each_noun(auto&& each) {
  const auto all = [&]<typename... T>() { (each.template operator()<T>(), ...); };
  all.template operator()<TriMesh, TetMesh, Plane, Camera, DepthNoise, DepthFrame, PointCloud, Markers, ToolTravel, Wrench, Tool, Support, Load,
                          Step, Push, Environment, ModelDefaults, Rest, RobotShape, RobotLink, RobotJoint, RobotModel, Region, Recording, Verdict,
                          Parameter, Nuisance, Slip, FitSummary, HeldOut, RegionShare, BudgetEntry, YoungAtLoad, LawFit, StepFit, PosteriorGrid,
                          FitIteration, Identification, Identified, prediction::Band, PushPrediction, SuggestedPush,
                          acquisition::RobotState, acquisition::RobotLimits, MadePush, LoopPush, Loop, estimation::CheckedError, RigCheck>();
}

/// What Python makes its classes of: [(name, about, [(field, type, about, maker of its default)], taker of the class)].
py::list nouns() {
  py::list list;
  for_each_noun([&]<typename T>() {
    py::list fields;
    Noun<T>::fields([&](const char* name, auto member, const char* about) {
      using Field = std::remove_reference_t<decltype(std::declval<T&>().*member)>;
      py::cpp_function make([member] { return to_python(T{}.*member); });
      fields.append(py::make_tuple(name, Convert<Field>::type(), about, make));
    });
    py::cpp_function take([](const py::object& made) { class_of<T> = made.inc_ref().ptr(); });
    list.append(py::make_tuple(Noun<T>::name, Noun<T>::about, fields, take));
  });
  return list;
}

py::object read_recording(const py::object& path, const py::object& mapping) {
  LoadedRecording loaded = cli::load_existing(path_of(path), mapping.is_none() ? fs::path() : path_of(mapping));
  check_loaded(loaded.recording);
  std::vector<std::string>& warnings = loaded.recording.warnings;
  for (const acquisition::ClockOffset& clock : loaded.clocks)
    if (clock.usable) warnings.push_back("clock of " + clock.sensor + ": " + cli::to_words(clock));
  return to_python(loaded.recording);
}

py::list problems(const py::object& given) {
  py::list list;
  for (const io::Problem& problem : io::check_recording(recording_of(given))) list.append(py::make_tuple(to_python(problem.where), to_python(problem.what)));
  return list;
}

py::object identify_recording(const py::object& given, const py::dict& options, const py::object& progress) {
  Recording recording = recording_of(given);
  const std::vector<std::string> known = recording.warnings;
  Options from(options);
  const IdentifyOptions asked = identify_options(from);
  from.all_taken();
  const Identified found = without_lock(progress, [&](const OnProgress& told) {
    check_loaded(recording, "palpate.check_recording");
    Identified answer = identify(recording, asked, told);
    if (answer.answer.termination != Termination::cancelled) name_push_for_poisson(recording, answer, asked.fit.threads, told);
    return answer;
  });
  warn_of(recording.warnings, known);
  warn_of(found.object.warnings, recording.warnings);  // of the shape, once it was filled
  return to_python(found);
}

void write_result(const py::object& found, const py::object& recording, const py::object& folder) {
  const fs::path out = path_of(folder);
  cli::must_take_files(out);
  cli::write_learned_object(from_python<Identified>(found, Place("found")), from_python<Recording>(recording, Place("recording")), out);
}

cli::LearnedObject learned_of(const py::object& given) {
  Identified found = from_python<Identified>(given, Place("found"));
  if (!found.object.rest.volume) throw Error("holds no mesh: the fit was stopped, or found nothing", "found.object.rest.volume");
  return {std::move(found.answer), std::move(found.object)};
}

py::object read_result(const py::object& folder) {
  cli::LearnedObject learned = cli::load_learned_object(path_of(folder));
  Identified found;
  found.volume = *learned.object.rest.volume;
  if (!learned.object.regions.empty()) found.region = cli::elasticity_of(learned).region;
  found.answer = std::move(learned.answer);
  found.object = std::move(learned.object);
  return to_python(found);
}

py::object predict(const py::object& found, const py::dict& options) {
  const cli::LearnedObject learned = learned_of(found);
  cli::AskedPush asked;
  asked.option.clear();
  int threads = 0;
  Options from(options);
  from.take("contact_m", asked.contact_m);
  from.take("direction", asked.direction);
  from.take("force_n", asked.force_n);
  from.take("travel_m", asked.travel_m);
  from.take("radius_m", asked.radius_m);
  from.take("tool", asked.tool);
  from.take("threads", threads);
  from.all_taken();
  const cli::PredictedPush push = without_lock(py::none(), [&](const OnProgress&) { return cli::predict_push(learned, asked, threads_of(threads)); });
  const auto by_node = [](const VectorX& field) { return Points(Eigen::Map<const Points>(field.data(), field.size() / 3, 3)); };
  const prediction::Prediction& there = push.found;
  return to_python(PushPrediction{there.converged, there.converged ? "" : there.reason, push.load.contact_m, push.load.direction, there.force_n,
                                  there.travel_m, there.stiffness_n_m, by_node(there.displacement_m), by_node(there.displacement_std_m),
                                  there.von_mises_pa, there.von_mises_std_pa, there.largest_displacement_m, there.largest_von_mises_pa, push.warnings});
}

/// 0: the recording's. @throws Error for what no recording may state either (palpate/core/recording_values.cpp)
double density_of(const py::object& given) {
  const double density = from_python<std::optional<double>>(given, Place("density_kg_m3")).value_or(0);
  if (density != 0 && !(density >= 5 && density <= 30000))
    throw Error(fmt::format("is {:g}, outside 5 to 30000 kg/m3; is it in g/cm3? Multiply by 1000. None: the recording's", density), "density_kg_m3");
  return density;
}

py::object export_to(const py::object& found, const std::string& to, const py::object& folder, const py::object& density_kg_m3,
                     const py::object& gravity_m_s2, const std::string& elements) {
  if (elements != "split" && elements != "corners") throw Error("is '" + elements + "'; it is split or corners", "elements");
  const auto linear = elements == "split" ? io::LinearElements::split : io::LinearElements::corners;
  const io::Exporter& exporter = io::exporter_named(to);
  const double density = density_of(density_kg_m3);
  const fs::path out = path_of(folder);
  cli::must_take_files(out);
  const auto gravity = from_python<std::optional<Vec3>>(gravity_m_s2, Place("gravity_m_s2"));
  const cli::LearnedObject learned = learned_of(found);
  const cli::ExportedObject exported =
      without_lock(py::none(), [&](const OnProgress&) { return cli::exported_object(learned, exporter, {density, gravity, linear}, threads_of(0)); });
  fs::create_directories(out);
  std::vector<std::string> names{exporter.main_file};
  for (const auto& [name, bytes] : exported.files) {
    io::write_file(out / name, bytes);
    if (name != exporter.main_file) names.push_back(name);
  }
  warn_of(exported.warnings);
  return to_python(names);
}

py::object suggest_pushes(const py::object& given, const py::object& so_far, const py::object& object, const py::dict& options, const py::object& progress) {
  Recording recording = recording_of(given);
  std::optional<Identification> answer;
  if (!so_far.is_none()) answer = from_python<Identification>(so_far, Place("so_far"));
  if (!object.is_none()) recording = as_fitted(from_python<Recording>(object, Place("so_far.object")), recording);
  if (answer)
    if (const std::string why = why_not_to_build_on(*answer); !why.empty()) throw Error("cannot be built on: " + why, "so_far");
  SuggestOptions asked;
  std::string goal = "both";
  int seed = 1, threads = 0;
  Options from(options);
  from.take("goal", goal);
  from.take("tool", asked.tool);
  from.take("tip_link", asked.tip_link);
  from.take("contacts", asked.candidates.contacts);
  from.take("tilts", asked.candidates.tilts);
  from.take("views", asked.viewpoints);
  from.take("young_modulus_pa", asked.young_modulus_pa);
  from.take("force_limit_n", asked.candidates.limits.force_n);
  from.take("travel_limit_m", asked.candidates.limits.travel_m);
  from.take("seed", seed);
  from.take("threads", threads);
  from.all_taken();
  asked.goal = estimation::push_goal(goal);
  asked.candidates.seed = static_cast<std::uint64_t>(seed);
  asked.threads = threads_of(threads);
  const auto ranked = without_lock(progress, [&](const OnProgress& told) {
    std::vector<SuggestedPush> list;
    const PushScene scene = prepare_pushes(recording, asked, told);
    for (const estimation::RatedPush& push : suggest(scene, answer ? &*answer : nullptr, asked, told).pushes) list.push_back(suggested(push, scene));
    return list;
  });
  return to_python(ranked);
}

class OnlineFront {
 public:
  OnlineFront(const py::object& scene, const py::dict& options) : estimator_(recording_of(scene, "scene"), checked(options)) {}

  void begin(const py::object& push) { estimator_.begin(from_python<Push>(push, Place("push"))); }
  py::object add(const py::object& given, const py::object& progress) {
    Step step = from_python<Step>(given, Place("step"));
    if (step.source.empty()) step.source = "step";
    return to_python(without_lock(progress, [&](const OnProgress& told) { return estimator_.add(step, told); }));
  }
  py::object estimate() const { return to_python(estimator_.estimate()); }
  py::object recording() const { return to_python(estimator_.recording()); }
  py::object answer(const py::object& progress) const {
    return to_python(without_lock(progress, [&](const OnProgress& told) { return estimator_.answer(told); }));
  }

 private:
  static IdentifyOptions checked(const py::dict& options) {
    Options from(options);
    const IdentifyOptions asked = identify_options(from);
    from.all_taken();
    return asked;
  }
  OnlineEstimator estimator_;
};

/// Of a folder that vanished or was closed after it had been looked at: a place and a reason like any other.
Error error_of(const fs::filesystem_error& wrong) {
  const fs::path& path = wrong.path1().empty() ? wrong.path2() : wrong.path1();
  return Error(fmt::format("cannot be made, read or written ({}); give another path, or change its permissions", wrong.code().message()),
               path.empty() ? "path" : path.string());
}

void raise_error(PyObject* type, const Error& wrong) {
  const auto text = [](const std::string& words) { return to_python(words); };  // files' names may hold any bytes
  const py::object raised = py::reinterpret_borrow<py::object>(type)(text(wrong.what()));
  raised.attr("where") = text(wrong.where());
  raised.attr("message") = text(wrong.message());
  PyErr_SetObject(type, raised.ptr());
}

py::object demo(int seed, const py::object& progress) {
  lab::DemoOptions options;
  options.seed = static_cast<std::uint64_t>(seed);
  const lab::Demo made = without_lock(progress, [&](const OnProgress& told) { return lab::make_demo(options, told); });
  return py::make_tuple(to_python(made.recording), py::dict(py::arg("young_modulus_pa") = made.truth.young_modulus_pa,
                                                            py::arg("poisson_ratio") = made.truth.poisson_ratio));
}

}  // namespace
}  // namespace palpate::python

PYBIND11_MODULE(_palpate, m) {
  using namespace palpate;
  using namespace palpate::python;
  namespace fs = std::filesystem;
  m.attr("__version__") = version;
  static PyObject* const error = PyErr_NewExceptionWithDoc(
      "palpate.Error", "No answer can exist: `where` names the file, line and field (or the argument), `message` says what is wrong and the cure.",
      PyExc_ValueError, nullptr);
  m.attr("Error") = py::reinterpret_borrow<py::object>(error);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& wrong) {
      raise_error(error, wrong);
    } catch (const fs::filesystem_error& wrong) {
      raise_error(error, error_of(wrong));
    }
  });
  m.def("nouns", &nouns);
  m.def("read_recording", &read_recording);
  m.def("read_scene", [](const py::object& folder) {
    Recording scene = io::read_recording_unchecked(path_of(folder));
    scene.pushes.clear();
    return to_python(scene);
  });
  m.def("write_recording", [](const py::object& recording, const py::object& folder) { io::write_recording(recording_of(recording), path_of(folder)); });
  m.def("problems", &problems);
  m.def("read_surface", [](const py::object& path) { return to_python(io::read_tri_mesh(path_of(path))); });
  m.def("read_volume", [](const py::object& path) { return to_python(io::read_tet_mesh(path_of(path))); });
  m.def("read_robot", [](const py::object& path) { return to_python(io::read_urdf(path_of(path))); });
  m.def("identify", &identify_recording);
  m.def("write_result", &write_result);
  m.def("read_result", &read_result);
  m.def("result_json", [](const py::object& answer) { return io::result_json(from_python<Identification>(answer, Place("answer"))).dump(); });
  m.def("check", &check_with);
  m.def("pose", &pose_of);
  m.def("predict", &predict);
  m.def("export", &export_to);
  m.def("suggest", &suggest_pushes);
  m.def("push", &push_with);
  m.def("explore", &explore_with);
  m.def("look_around", &look_around_with);
  m.def("demo", &demo);
  m.def("materials", [] {
    py::list list;
    for (const fem::MaterialLaw* law : fem::material_table()) list.append(py::str(std::string(law->name())));
    return list;
  });
  m.def("exporters", [] {
    py::dict dict;
    for (const io::Exporter& one : io::exporters()) dict[py::str(one.name)] = one.about;
    return dict;
  });
  m.def("depth_sensors", [] {
    py::dict dict;
    for (const sensing::DepthNoiseModel& one : sensing::depth_noise_models()) dict[py::str(one.name.data(), one.name.size())] = py::str(one.source.data(), one.source.size());
    return dict;
  });
  py::class_<OnlineFront>(m, "OnlineEstimator")
      .def(py::init<py::object, py::dict>())
      .def("begin", &OnlineFront::begin)
      .def("add", &OnlineFront::add)
      .def("estimate", &OnlineFront::estimate)
      .def("recording", &OnlineFront::recording)
      .def("answer", &OnlineFront::answer);
}
