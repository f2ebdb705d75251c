// SPDX-License-Identifier: Apache-2.0
#include "cli/paper_seeds.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "cli/paper_fields.hpp"
#include "cli/paper_json.hpp"
#include "cli/paper_page.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/version.hpp"
#include "palpate/io/file.hpp"

namespace palpate::cli {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Rises when answers of the same version would no longer compare, or fields change.
constexpr int seed_format = 4;

std::string file_name(const std::string& name, std::uint64_t seed) { return fmt::format("{}_{:04}.json", name, seed); }

json options_json(const SeedAsked& asked) {
  json out = {{"every_sample", asked.options.samples_alone ? 1 : 0},
              {"surface_points", asked.options.surface_points},
              {"pictures", asked.options.pictures}};
  if (asked.options.other_starts) out["other_starts"] = true;
  if (asked.options.coarse) out["coarse"] = true;
  if (asked.name == "cow" && !asked.object.name.empty())
    out["object"] = {{"sha256", asked.object.sha256}, {"up", asked.object.up}, {"size_m", asked.object.size_m}};
  return out;
}

json header(const SeedAsked& asked, int threads) {
  json out = {{"palpate", version}, {"format", seed_format}, {"name", asked.name}, {"seed", asked.seed},
              {"threads", threads}, {"options", options_json(asked)}};
  if (asked.name == "cow") out["object_name"] = asked.object.name;
  return out;
}

/// @param place  the file, and the line where it has one seed a line
json parsed(std::string_view bytes, const std::string& place) {
  json seed = json::parse(bytes, nullptr, false);
  if (!seed.is_object() || !seed.contains("options") || !seed.contains("name") || !seed.contains("seed"))
    throw Error("is no seed of palpate paper, or damaged; remove it and run that seed again", place);
  if (seed.value("format", 0) != seed_format)
    throw Error(fmt::format("is of palpate {} (format {}), this is {} (format {}): answers of different programs are not joined; use "
                            "another folder, or remove the file and run that seed again",
                            seed.value("palpate", "?"), seed.value("format", 0), version, seed_format),
                place);
  return seed;
}

struct KeptSeed {
  json seed;
  std::string place;
};

/// Files of one seed (.json) and of one a line (.jsonl: what `cat` makes of the former).
std::vector<KeptSeed> kept_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".json" || entry.path().extension() == ".jsonl") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<KeptSeed> out;
  for (const fs::path& file : files) {
    const std::string bytes = io::read_file(file);
    if (file.extension() == ".json") {
      out.push_back({parsed(bytes, file.string()), file.string()});
      continue;
    }
    int line = 0;
    for (std::size_t from = 0, to = 0; from < bytes.size(); from = to + 1) {
      to = std::min(bytes.find('\n', from), bytes.size());
      const std::string place = fmt::format("{}, line {}", file.string(), ++line);
      if (to > from) out.push_back({parsed(std::string_view(bytes).substr(from, to - from), place), place});
    }
  }
  return out;
}

/// Where a name stands in the tables, that what is collected has one order.
std::size_t place_of(std::string_view name) {
  std::size_t place = 0;
  for (const lab::PaperScene& scene : lab::paper_scenes()) {
    if (scene.name == name) return place;
    ++place;
  }
  for (const Study& study : studies()) {
    if (study.name == name) return place;
    ++place;
  }
  return place;
}

}  // namespace

lab::PaperScene in_the_cows_place(std::string_view object, const TriMesh* surface) {
  lab::PaperScene scene = lab::paper_scene("cow");
  scene.object = object;
  scene.title = "Simulated test on a mesh of the user's";
  scene.differs = "The object is the mesh file that was given, glued at its foot and pressed at its top; the pad is soft, the paper "
                  "pushed at a point.";
  scene.surface = surface;
  scene.unused.reset();  // at the same place, with other forces
  return scene;
}

std::string PaperRuns::command() const {
  std::string out = fmt::format("palpate paper -o OUT{}", coarse ? " --quick" : "");
  std::uint64_t first = ~std::uint64_t{0}, last = 0;
  std::string names;
  const auto count = [&](std::string_view name, std::uint64_t from, std::uint64_t to) {
    first = std::min(first, from);
    last = std::max(last, to);
    names += fmt::format(" --scene {}", name);
  };
  for (const SceneAnswers& scene : scenes) count(scene.scene->name, scene.trials.front().seed, scene.trials.back().seed);
  for (const StudyAnswer& study : studies) count(study.study->name, study.seed, study.seed);
  if (first <= last) out += fmt::format(" --seed {} --seeds {}", first, last - first + 1);
  if (details_of != 1) out += fmt::format(" --details-of {}", details_of);
  if (scenes.size() + studies.size() < lab::paper_scenes().size() + cli::studies().size()) out += names;
  return object.empty() ? out : out + " --object " + object + put;
}

SeedFolder::SeedFolder(const fs::path& out) : seeds_(out / "seeds") {}

bool SeedFolder::has(const SeedAsked& asked) const {
  const fs::path file = seeds_ / file_name(asked.name, asked.seed);
  if (!fs::exists(file)) return false;
  const json there = parsed(io::read_file(file), file.string()).at("options"), wanted = options_json(asked);
  if (there == wanted) return true;
  throw Error(fmt::format("was made with other options ({}; now {}): give the same (--quick, --details-of, --object and how it is put), "
                          "or another folder",
                          there.dump(), wanted.dump()),
              file.string());
}

json SeedFolder::keep(const SeedAsked& asked, const TrialAnswer& answer) const {
  fs::create_directories(seeds_);
  json seed = header(asked, asked.options.threads);
  seed["trial"] = written(answer);
  io::write_file(seeds_ / file_name(asked.name, asked.seed), seed.dump() + "\n");
  return seed;
}

json SeedFolder::keep(const SeedAsked& asked, const StudyAnswer& answer, int threads) const {
  fs::create_directories(seeds_);
  json seed = header(asked, threads);
  seed["study"] = {{"rows", written(answer.rows)}, {"failed", answer.failed}, {"seconds", answer.seconds}};
  io::write_file(seeds_ / file_name(asked.name, asked.seed), seed.dump() + "\n");
  return seed;
}

PaperRuns SeedFolder::collect() const {
  PaperRuns runs;
  if (!fs::is_directory(seeds_)) return runs;
  for (const KeptSeed& kept : kept_in(seeds_)) add_seed(runs, kept.seed, kept.place);
  return runs;
}

void SeedFolder::take_from(const fs::path& out) const {
  const fs::path from = out / "seeds";
  const std::vector<KeptSeed> all = fs::is_directory(from) ? kept_in(from) : std::vector<KeptSeed>{};
  if (all.empty()) throw Error("holds no seeds of palpate paper: give a folder that an earlier run wrote with -o", out.string());
  fs::create_directories(seeds_);
  for (const KeptSeed& kept : all) {
    const fs::path here = seeds_ / file_name(kept.seed.at("name"), kept.seed.at("seed"));
    if (!fs::exists(here)) {
      io::write_file(here, kept.seed.dump() + "\n");
    } else if (parsed(io::read_file(here), here.string()) != kept.seed) {
      throw Error("has another answer than " + here.string() + ": a seed belongs to one piece only; leave one of the two folders out",
                  kept.place);
    }
  }
}

void add_seed(PaperRuns& runs, const json& seed, const std::string& file) try {
  const std::string name = seed.at("name"), made_by = seed.at("palpate");
  const auto number = seed.at("seed").get<std::uint64_t>();
  if (!runs.version.empty() && runs.version != made_by)
    throw Error(fmt::format("is of palpate {}, others are of {}: answers of different programs are not joined; use another folder, or "
                            "remove the file and run that seed again",
                            made_by, runs.version),
                file);
  runs.version = made_by;
  runs.threads.insert(seed.at("threads").get<int>());
  const bool coarse = seed.at("options").value("coarse", false);
  if (coarse != runs.coarse && !(runs.scenes.empty() && runs.studies.empty()))
    throw Error(fmt::format("was made {} --quick, others {} it: their numbers do not compare; use another folder", coarse ? "with" : "without",
                            coarse ? "without" : "with"),
                file);
  runs.coarse = coarse;
  const bool pictures = seed.at("options").at("pictures");
  if (const Study* study = study_of(name)) {
    if (pictures) runs.details_of = number;
    StudyAnswer answer{study, number, {}, seed.at("study").at("failed"), seed.at("study").at("seconds")};
    read_into(answer.rows, seed.at("study").at("rows"));
    const auto after = [&](const StudyAnswer& other) {
      return std::pair(place_of(other.study->name), other.seed) > std::pair(place_of(name), number);
    };
    runs.studies.insert(std::find_if(runs.studies.begin(), runs.studies.end(), after), std::move(answer));
    return;
  }
  const lab::PaperScene* scene = &lab::paper_scene(name);
  if (name == "cow") {
    const std::string object = seed.at("object_name").get<std::string>() +
                               (seed.at("options").contains("object") ? " " + seed.at("options").at("object").dump() : "");
    const bool known = std::any_of(runs.scenes.begin(), runs.scenes.end(), [](const auto& one) { return one.scene->name == "cow"; });
    if (known && runs.placed != object)
      throw Error("has another object in the cow's place than other seeds: give --object as for those, or another folder", file);
    runs.placed = object;
    runs.object = seed.at("object_name");
    if (!runs.object.empty()) {
      const nlohmann::json& how = seed.at("options").at("object");
      runs.put = fmt::format(" --object-up {}", how.at("up").get<std::string>());
      if (how.at("size_m").get<double>() > 0) runs.put += fmt::format(" --object-size {}", how.at("size_m").get<double>());
      if (!runs.cow) runs.cow = std::make_shared<lab::PaperScene>(in_the_cows_place("", nullptr));
      scene = runs.cow.get();
    }
  }
  TrialAnswer trial;
  read_into(trial, seed.at("trial"));
  trial.seed = number;
  if (pictures)
    runs.details_of = number;
  else if (runs.details_of == number)
    runs.details_of = 0;  // not even the one that has them where nobody asks
  const auto later = [&](const SceneAnswers& other) { return place_of(other.scene->name) >= place_of(name); };
  auto at = std::find_if(runs.scenes.begin(), runs.scenes.end(), later);
  if (at == runs.scenes.end() || at->scene->name != name) at = runs.scenes.insert(at, SceneAnswers{scene, {}});
  const auto after = [&](const TrialAnswer& other) { return other.seed > number; };
  at->trials.insert(std::find_if(at->trials.begin(), at->trials.end(), after), std::move(trial));
} catch (const json::exception& error) {
  throw Error(std::string("is damaged (") + error.what() + "); remove it and run that seed again", file);
}

json write_page(const PaperRuns& runs, const fs::path& out) {
  const std::string command = runs.command();
  json told = {{"command", command}, {"palpate", runs.version}, {"threads", runs.threads}, {"quick", runs.coarse}, {"scenes", json::array()}, {"studies", json::array()}};
  for (const SceneAnswers& each : runs.scenes) told["scenes"].push_back(json_of(each));
  for (const StudyAnswer& each : runs.studies) told["studies"].push_back(json_of(each));
  told["study_scores"] = json_of(std::span(runs.studies));
  io::write_file(out / "paper.json", told.dump(2) + "\n");
  io::write_file(out / "paper.html", paper_page(runs.scenes, runs.studies, runs.version, command, runs.threads, runs.details_of, runs.coarse));
  return told;
}

}  // namespace palpate::cli
