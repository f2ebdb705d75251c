// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <vector>

#include "cli/mistyped.hpp"
#include "cli/option_hints.hpp"
#include "cli/session.hpp"
#include "cli/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/process_heap.hpp"

namespace palpate::cli {
namespace {

constexpr const char* three_things_to_try =
    "palpate learns how stiff an object is from a robot's pushes. Three things to try:\n"
    "\n"
    "  palpate demo -o out                    a made-up foam cube, pushed, fitted and reported, in a minute or two\n"
    "  palpate info RECORDING                 what is in a recording, and what is wrong with it\n"
    "  palpate estimate RECORDING -o out      Young's modulus and Poisson ratio with 95 % intervals\n"
    "\n"
    "`palpate --help` lists everything.";

std::vector<std::string> verb_names() {
  std::vector<std::string> names;
  for (const Verb& verb : verb_table()) names.emplace_back(verb.name);
  return names;
}

/// The verb among the arguments, or nothing; skips global options and their values.
const std::string* first_word(const std::vector<std::string>& arguments) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& argument = arguments[i];
    if (argument == "--seed" || argument == "--threads") {
      ++i;
    } else if (!argument.starts_with('-')) {
      return &argument;
    }
  }
  return nullptr;
}

/// Whether what is wrong is the command and not a file: the error names an option alone.
bool is_usage(const std::string& where) { return where.starts_with("--") && where.find(' ') == std::string::npos; }

std::string hint(const std::string& word, const std::vector<std::string>& candidates) {
  const auto meant = did_you_mean(word, candidates);
  return meant ? fmt::format(" Did you mean `{}`?", *meant) : std::string();
}

/// "--treads: no such option. Did you mean `--threads`?", or an empty string when every option is known.
std::string unknown_option(CLI::App& app, const std::vector<std::string>& arguments) {
  std::vector<std::string> known;
  const auto add_options_of = [&known](const CLI::App& part) {
    for (const CLI::Option* option : part.get_options()) {
      for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
      for (const std::string& name : option->get_snames()) known.push_back("-" + name);
    }
  };
  add_options_of(app);
  const std::string* word = first_word(arguments);
  if (word != nullptr) add_options_of(*app.get_subcommand(*word));
  for (const std::string& argument : arguments) {
    if (argument == "--") break;
    if (!argument.starts_with("--")) continue;
    const std::string name = argument.substr(0, argument.find('='));
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      return fmt::format("{}: no such option.{}", name, hint(name, known));
    }
  }
  return {};
}

/// What the help says of the option that a sentence of the parser begins with: "3 required X Y Z missing" alone helps nobody.
std::string meaning(CLI::App& app, const std::vector<std::string>& arguments, const std::string& problem) {
  const std::string* word = first_word(arguments);
  if (word == nullptr) return {};
  for (const CLI::Option* option : app.get_subcommand(*word)->get_options())
    if (problem.starts_with(option->get_name() + ":")) return fmt::format(" ({}: {})", option->get_name(), option->get_description());
  return {};
}

int fail(Session& session, ExitCode code, const std::string& kind, const std::string& what, const std::string& where = {}) {
  session.result({{"error", {{"kind", kind}, {"message", what}, {"where", where}}}, {"exit_code", static_cast<int>(code)}});
  session.announce(fmt::format("palpate: {}{}{}", where, where.empty() ? "" : ": ", what));
  return code;
}

int parse_and_run(const std::vector<std::string>& arguments, Session& session) {
  if (arguments.empty()) {
    session.announce(three_things_to_try);
    return exit_done;
  }
  // Wrong usage must answer a program in JSON too, also when parsing stops before it reaches the option.
  session.json = std::find(arguments.begin(), arguments.end(), "--json") != arguments.end();

  CLI::App app;
  Run chosen;
  build_command_line(app, session, chosen);

  const std::vector<std::string> names = verb_names();
  const std::string* word = first_word(arguments);
  if (word != nullptr && std::find(names.begin(), names.end(), *word) == names.end()) {
    return fail(session, exit_usage, "usage",
                fmt::format("`{}` is not a verb.{} `palpate --help` lists them.", *word, hint(*word, names)));
  }
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& problem) {
    const std::string mistyped = unknown_option(app, arguments);
    const bool incomplete = dynamic_cast<const CLI::ArgumentMismatch*>(&problem) != nullptr;
    const std::string missing = incomplete ? meaning(app, arguments, problem.what()) : "";
    const std::string help = word != nullptr ? "palpate " + *word + " --help" : "palpate --help";
    return fail(session, exit_usage, "usage",
                fmt::format("{} (`{}`)", mistyped.empty() ? problem.what() + missing : mistyped, help));
  }
  if (!chosen) {
    return fail(session, exit_usage, "usage", "which verb? `palpate --help` lists them.");
  }
  return chosen(session);
}

}  // namespace
}  // namespace palpate::cli

int main(int argc, char** argv) {
  using namespace palpate::cli;
  palpate::keep_heap_in_large_pages();
  hold_standard_streams();
  Session session;
  stop_on_interrupt();
  try {
    return parse_and_run({argv + 1, argv + argc}, session);
  } catch (const palpate::Error& error) {
    const bool usage = is_usage(error.where());
    return fail(session, usage ? exit_usage : exit_input, usage ? "usage" : "input", with_option(error), error.where());
  } catch (const std::filesystem::filesystem_error& error) {
    const std::string where = error.path1().empty() ? "file" : error.path1().string();
    return fail(session, exit_input, "input",
                error.code().message() + "; check that it is there, its permissions and the room on the disk", where);
  } catch (const std::bad_alloc&) {
    return fail(session, exit_internal, "internal",
                "not enough memory for this problem; use a coarser mesh or fewer points, or of a bag record only the topics that its mapping names");
  } catch (const std::exception& error) {
    return fail(session, exit_internal, "internal",
                std::string("internal error: ") + error.what() + " (please report this with the command that you ran)");
  }
}
