// SPDX-License-Identifier: Apache-2.0
// What `palpate paper` has run: one file a scene (or study) and seed under OUT/seeds, whole when it is there. A run goes on from
// them, and those of several folders are joined. To be kept, many may stand in one file, a line each.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "cli/paper_scores.hpp"
#include "cli/paper_studies.hpp"

namespace palpate::cli {

/// A mesh file in the cow's place; without a name: the lab's own animal.
struct PlacedObject {
  std::string name, sha256, up = "z";
  double size_m = 0;
};

/// Of one seed. Where a file says otherwise, it is not what was asked for.
struct SeedAsked {
  std::string name;  ///< of a scene or a study
  std::uint64_t seed = 1;
  TrialOptions options;  ///< of a study: pictures and coarse; the number of threads changes seconds alone
  PlacedObject object;   ///< of the cow
};

/// All that pages and tables are made from.
struct PaperRuns {
  std::vector<SceneAnswers> scenes;  ///< in the table's order, seeds rising
  std::vector<StudyAnswer> studies;  ///< the same
  std::string version;               ///< of the program that made them; empty: there are none
  std::set<int> threads;
  std::string object;                ///< in the cow's place; empty: none
  std::string placed;                ///< the same, and how it is put
  std::string put;                   ///< options that put it so
  std::shared_ptr<lab::PaperScene> cow;  ///< its scene
  bool coarse = false;               ///< of --quick, all of them
  std::uint64_t details_of = 1;      ///< seed that also has pictures and the like

  /// That makes the same again.
  std::string command() const;
};

/// The cow's scene with another object, whose name must outlive it.
lab::PaperScene in_the_cows_place(std::string_view object, const TriMesh* surface);

class SeedFolder {
 public:
  /// @param out  of the page; made if need be
  explicit SeedFolder(const std::filesystem::path& out);
  /// @throws Error when it is there, but is not what is asked for.
  bool has(const SeedAsked& asked) const;
  /// Written aside and put in place. Returns what was written.
  nlohmann::json keep(const SeedAsked& asked, const TrialAnswer& answer) const;
  nlohmann::json keep(const SeedAsked& asked, const StudyAnswer& answer, int threads) const;
  /// All that is there.
  /// @throws Error naming the file that is damaged, or of another version or object than the others.
  PaperRuns collect() const;
  /// Takes over what another folder has.
  /// @throws Error when it has none, or another answer for a seed that is here.
  void take_from(const std::filesystem::path& out) const;

 private:
  std::filesystem::path seeds_;
};

/// Adds what a file holds. @param file  to name in errors
/// @throws Error when it is damaged, or no answer that compares with the others: of another version, another object in the cow's
///         place, or one of them of --quick alone
void add_seed(PaperRuns& runs, const nlohmann::json& seed, const std::string& file);

/// OUT/paper.html and OUT/paper.json. Returns the latter.
nlohmann::json write_page(const PaperRuns& runs, const std::filesystem::path& out);

}  // namespace palpate::cli
