// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <memory>

#include "cli/number_checks.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/version.hpp"

namespace palpate::cli {

std::span<const Verb> verb_table() {
// A verb that is a word of C++ carries an underscore in the table.
#define PALPATE_VERB_ROW(name, group, summary, example) \
  Verb{std::string_view(#name) == "export_" ? "export" : #name, group, summary, example, &verbs::name},
  static constexpr std::array table{PALPATE_VERBS(PALPATE_VERB_ROW)};
#undef PALPATE_VERB_ROW
  return table;
}

void build_command_line(CLI::App& app, Session& session, Run& chosen) {
  app.name("palpate");
  app.description("palpate learns Young's modulus and Poisson ratio of deformable objects from a robot's pushes.");
  app.set_version_flag("--version", std::string("palpate ") + version, "print the version and exit");
  app.set_help_flag("-h,--help", "print this help and exit");
  app.add_option("--seed", session.seed, "seed of everything random; the same seed gives the same answer")
      ->type_name("N")
      ->check(whole_number().description(""))
      ->capture_default_str();
  app.add_option("--threads", session.threads, "threads to use; 0 takes all that the machine has")
      ->capture_default_str()
      ->type_name("N")
      ->check(CLI::Range(0, 1024).description(""));
  app.add_flag("--quiet", session.quiet, "print warnings and errors only");
  app.add_flag("--json", session.json, "print one JSON object on standard output");
  app.get_formatter()->label("SUBCOMMAND", "VERB");
  app.require_subcommand(0, 1);
  app.fallthrough();
  app.footer(
      "`palpate VERB --help` explains a verb and ends with an example.\n"
      "Exit codes: 0 done, 1 the numbers did not work out or a check failed, 2 wrong usage, 3 bad input, 4 internal error.");
  for (const Verb& verb : verb_table()) {
    CLI::App* sub = app.add_subcommand(verb.name, verb.summary);
    sub->group(verb.group);
    sub->fallthrough();
    sub->footer(std::string("Everywhere: --seed N, --threads N, --quiet, --json\n\nExample:\n  ") + verb.example);
    auto run = std::make_shared<Run>(verb.set_up(*sub));
    sub->callback([run, &chosen] { chosen = *run; });
  }
}

}  // namespace palpate::cli
