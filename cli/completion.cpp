// SPDX-License-Identifier: Apache-2.0
// `palpate completion SHELL`: scripts made from the same table and options that the parser uses, so they cannot drift apart.
#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "cli/verbs.hpp"

namespace palpate::cli {
namespace {

std::vector<std::string> long_options(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

std::string joined(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line += (line.empty() ? "" : " ") + word;
  return line;
}

/// Single quotes survive inside single quotes of any of the three shells when they are left out.
std::string plain(std::string text) {
  std::erase_if(text, [](char c) { return c == '\'' || c == '[' || c == ']' || c == ':' || c == '\n'; });
  return text;
}

std::string bash_script(const CLI::App& app) {
  std::string verbs, cases;
  for (const CLI::App* verb : app.get_subcommands({})) {
    verbs += (verbs.empty() ? "" : " ") + verb->get_name();
    cases += fmt::format("    {}) options=\"{}\" ;;\n", verb->get_name(), joined(long_options(*verb)));
  }
  return fmt::format(R"(# bash completion of palpate
_palpate() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" verb="" options="" i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case "${{COMP_WORDS[i]}}" in -*) ;; *) [ -z "$verb" ] && verb="${{COMP_WORDS[i]}}" ;; esac
  done
  case "$verb" in
{}    "") [[ "$word" == -* ]] || {{ COMPREPLY=($(compgen -W "{}" -- "$word")); return; }} ;;
  esac
  if [[ "$word" == -* ]]; then COMPREPLY=($(compgen -W "$options {}" -- "$word")); else COMPREPLY=($(compgen -f -- "$word")); fi
}}
complete -o filenames -F _palpate palpate
)",
                     cases, verbs, joined(long_options(app)));
}

std::string zsh_script(const CLI::App& app) {
  std::string verbs, cases, global;
  for (const std::string& name : long_options(app)) global += fmt::format(" '{}'", name);
  for (const CLI::App* verb : app.get_subcommands({})) {
    verbs += fmt::format("    '{}:{}'\n", verb->get_name(), plain(verb->get_description()));
    std::string options;
    for (const CLI::Option* option : verb->get_options()) {
      for (const std::string& name : option->get_lnames()) {
        options += fmt::format(" '--{}[{}]'", name, plain(option->get_description()));
      }
    }
    cases += fmt::format("    {}) _arguments{}{} '*:file:_files' ;;\n", verb->get_name(), options, global);
  }
  return fmt::format(R"(#compdef palpate
_palpate() {{
  local -a verbs
  verbs=(
{}  )
  if (( CURRENT == 2 )); then _describe 'verb' verbs; return; fi
  case "$words[2]" in
{}    *) _files ;;
  esac
}}
_palpate "$@"
)",
                     verbs, cases);
}

std::string fish_script(const CLI::App& app) {
  std::string script = "# fish completion of palpate\n";
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      script += fmt::format("complete -c palpate -l {} -d '{}'\n", name, plain(option->get_description()));
    }
  }
  for (const CLI::App* verb : app.get_subcommands({})) {
    script += fmt::format("complete -c palpate -n __fish_use_subcommand -a {} -d '{}'\n", verb->get_name(),
                          plain(verb->get_description()));
    for (const CLI::Option* option : verb->get_options()) {
      for (const std::string& name : option->get_lnames()) {
        script += fmt::format("complete -c palpate -n '__fish_seen_subcommand_from {}' -l {} -d '{}'\n", verb->get_name(),
                              name, plain(option->get_description()));
      }
    }
  }
  return script;
}

}  // namespace

Run verbs::completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  app.add_option("SHELL", *shell, "bash, zsh or fish")->required()->check(CLI::IsMember({"bash", "zsh", "fish"}));
  return [shell](Session& session) {
    CLI::App whole;
    Session unused;
    Run none;
    build_command_line(whole, unused, none);
    const std::string script = *shell == "bash"  ? bash_script(whole)
                               : *shell == "zsh" ? zsh_script(whole)
                                                 : fish_script(whole);
    if (session.json) {
      session.result({{"shell", *shell}, {"script", script}});
    } else {
      session.print(script);
    }
    return exit_done;
  };
}

}  // namespace palpate::cli
