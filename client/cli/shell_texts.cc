#include "client/cli/shell_texts.h"

#include <vector>

#include <CLI/CLI.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "client/cli/option_support.h"

namespace isomatch {
namespace {

// The flags of one option: {"--output", "-o"}.
std::vector<std::string> FlagsOf(const CLI::Option& option) {
  std::vector<std::string> flags;
  for (const std::string& name : option.get_lnames()) {
    flags.push_back("--" + name);
  }
  for (const std::string& name : option.get_snames()) {
    flags.push_back("-" + name);
  }
  return flags;
}

bool TakesValue(const CLI::Option& option) {
  return option.get_items_expected_max() > 0;
}

bool IsOf(const CLI::Option& option, const char* placeholder) {
  return PlaceholderOf(option) == placeholder;
}

// Those that are flags, not positional.
std::vector<const CLI::Option*> OptionsOf(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) {
    return !option->get_lnames().empty() || !option->get_snames().empty();
  });
}

std::vector<const CLI::Option*> PositionalsOf(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) {
    return option->get_lnames().empty() && option->get_snames().empty();
  });
}

std::vector<const CLI::App*> CommandsOf(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::string CommandNames(const CLI::App& app) {
  return absl::StrJoin(CommandsOf(app), " ",
                       [](std::string* out, const CLI::App* command) {
                         out->append(command->get_name());
                       });
}

// Inside a single-quoted part of a zsh specification.
std::string ZshText(const std::string& text) {
  return absl::StrReplaceAll(
      text, {{"'", "'\\''"}, {"[", "\\["}, {"]", "\\]"}, {":", "\\:"}});
}

std::string FishText(const std::string& text) {
  return absl::StrReplaceAll(text, {{"\\", "\\\\"}, {"'", "\\'"}});
}

// Text of a manual page: no line of it is a request, no dash breaks.
std::string ManText(absl::string_view text) {
  std::vector<std::string> lines;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    std::string escaped =
        absl::StrReplaceAll(line, {{"\\", "\\e"}, {"-", "\\-"}});
    if (!escaped.empty() && (escaped[0] == '.' || escaped[0] == '\'')) {
      escaped.insert(0, "\\&");
    }
    lines.push_back(std::move(escaped));
  }
  return absl::StrJoin(lines, "\n");
}

// For bash: what an option's value can be, by `COMMAND OPTION`; nothing for
// files, which are completed anyway.
std::string BashValues(const CLI::App& app) {
  std::string cases;
  for (const CLI::App* command : CommandsOf(app)) {
    for (const CLI::Option* option : OptionsOf(*command)) {
      if (!TakesValue(*option) || IsOf(*option, kFile)) continue;
      std::vector<std::string> patterns;
      for (const std::string& flag : FlagsOf(*option)) {
        patterns.push_back(
            absl::StrCat("'", command->get_name(), " ", flag, "'"));
      }
      absl::StrAppend(
          &cases, "    ", absl::StrJoin(patterns, "|"),
          ") COMPREPLY=($(compgen ",
          IsOf(*option, kFolder)
              ? "-d"
              : absl::StrCat("-W '", absl::StrJoin(ChoicesOf(*option), " "),
                             "'"),
          " -- \"$current\")); return ;;\n");
    }
  }
  return cases;
}

// What follows an option's description in a zsh specification.
std::string ZshValue(const CLI::Option& option) {
  if (!TakesValue(option)) return "";
  const std::vector<std::string> choices = ChoicesOf(option);
  if (!choices.empty()) {
    return absl::StrCat(":value:(", absl::StrJoin(choices, " "), ")");
  }
  if (IsOf(option, kFile)) return ":file:_files";
  return IsOf(option, kFolder) ? ":folder:_files -/" : ":value: ";
}

std::string FishValue(const CLI::Option& option) {
  if (!TakesValue(option)) return "";
  const std::vector<std::string> choices = ChoicesOf(option);
  if (!choices.empty()) {
    return absl::StrCat(" -x -a '", absl::StrJoin(choices, " "), "'");
  }
  if (IsOf(option, kFolder)) return " -x -a '(__fish_complete_directories)'";
  return IsOf(option, kFile) ? " -r" : " -x";
}

// "LIST", "MESH...".
std::string PositionalText(const CLI::Option& option) {
  return absl::StrCat(option.get_name(/*positional=*/true),
                      option.get_items_expected_max() > 1 ? "..." : "");
}

void AppendManCommand(const CLI::App& command, std::string& page) {
  absl::StrAppend(&page, ".SS isomatch ", command.get_name());
  for (const CLI::Option* option : PositionalsOf(command)) {
    absl::StrAppend(&page, " ", ManText(PositionalText(*option)));
  }
  absl::StrAppend(&page, " [options]\n", ManText(command.get_description()),
                  "\n");
  for (const CLI::Option* option : PositionalsOf(command)) {
    absl::StrAppend(&page, ".TP\n.I ", ManText(PositionalText(*option)), "\n",
                    ManText(option->get_description()), "\n");
  }
  for (const CLI::Option* option : OptionsOf(command)) {
    absl::StrAppend(&page, ".TP\n.B ",
                    ManText(absl::StrJoin(FlagsOf(*option), ", ")));
    if (TakesValue(*option)) {
      absl::StrAppend(&page, " ", ManText(PlaceholderOf(*option)));
    }
    absl::StrAppend(&page, "\n", ManText(option->get_description()));
    const std::vector<std::string> choices = ChoicesOf(*option);
    if (!choices.empty()) {
      absl::StrAppend(&page, ": ", ManText(absl::StrJoin(choices, ", ")));
    }
    if (!option->get_default_str().empty()) {
      absl::StrAppend(&page, " (default ", ManText(option->get_default_str()),
                      ")");
    }
    absl::StrAppend(&page, "\n");
  }
  const std::string footer = command.get_footer();
  if (!footer.empty()) {
    absl::StrAppend(&page, ".PP\n.nf\n",
                    ManText(absl::StripAsciiWhitespace(footer)), "\n.fi\n");
  }
}

}  // namespace

std::string BashCompletion(const CLI::App& app) {
  std::string script = absl::StrCat(
      "# bash completion for isomatch; made by `isomatch completion bash`\n"
      "_isomatch() {\n"
      "  local current=${COMP_WORDS[COMP_CWORD]} command= options= word\n"
      "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n"
      "    if [[ $word != -* ]]; then command=$word; break; fi\n"
      "  done\n"
      "  case $command in\n"
      "    '') COMPREPLY=($(compgen -W '",
      CommandNames(app),
      " --help --version' -- \"$current\"))\n"
      "        return ;;\n"
      "    help) COMPREPLY=($(compgen -W '",
      CommandNames(app),
      "' -- \"$current\"))\n"
      "        return ;;\n"
      "    completion) COMPREPLY=($(compgen -W 'bash zsh fish' -- "
      "\"$current\"))\n"
      "        return ;;\n");
  for (const CLI::App* command : CommandsOf(app)) {
    std::vector<std::string> flags;
    for (const CLI::Option* option : OptionsOf(*command)) {
      for (std::string& flag : FlagsOf(*option)) flags.push_back(flag);
    }
    absl::StrAppend(&script, "    ", command->get_name(), ") options='",
                    absl::StrJoin(flags, " "), "' ;;\n");
  }
  absl::StrAppend(&script,
                  "  esac\n"
                  "  case \"$command ${COMP_WORDS[COMP_CWORD-1]}\" in\n",
                  BashValues(app),
                  "  esac\n"
                  "  if [[ $current == -* ]]; then\n"
                  "    COMPREPLY=($(compgen -W \"$options\" -- \"$current\"))\n"
                  "  else\n"
                  "    COMPREPLY=($(compgen -f -- \"$current\"))\n"
                  "  fi\n"
                  "}\n"
                  "complete -o filenames -F _isomatch isomatch\n");
  return script;
}

std::string ZshCompletion(const CLI::App& app) {
  std::string script =
      "#compdef isomatch\n"
      "# made by `isomatch completion zsh`\n"
      "_isomatch() {\n"
      "  local -a commands\n"
      "  commands=(\n";
  for (const CLI::App* command : CommandsOf(app)) {
    absl::StrAppend(&script, "    '", command->get_name(), ":",
                    ZshText(command->get_description()), "'\n");
  }
  absl::StrAppend(&script,
                  "  )\n"
                  "  if (( CURRENT == 2 )); then\n"
                  "    _describe command commands\n"
                  "    return\n"
                  "  fi\n"
                  "  local command=$words[2]\n"
                  "  shift words; (( CURRENT-- ))\n"
                  "  case $command in\n"
                  "    completion) _values shell bash zsh fish ;;\n"
                  "    help) _describe command commands ;;\n");
  for (const CLI::App* command : CommandsOf(app)) {
    if (command->get_name() == "completion") continue;
    if (command->get_name() == "help") continue;
    absl::StrAppend(&script, "    ", command->get_name(), ") _arguments \\\n");
    for (const CLI::Option* option : OptionsOf(*command)) {
      for (const std::string& flag : FlagsOf(*option)) {
        absl::StrAppend(&script, "      '", flag, "[",
                        ZshText(option->get_description()), "]",
                        ZshValue(*option), "' \\\n");
      }
    }
    absl::StrAppend(&script, "      '*:file:_files' ;;\n");
  }
  return script + "  esac\n}\n_isomatch \"$@\"\n";
}

std::string FishCompletion(const CLI::App& app) {
  std::string script =
      "# fish completion for isomatch; made by `isomatch completion fish`\n";
  for (const CLI::App* command : CommandsOf(app)) {
    absl::StrAppend(&script, "complete -c isomatch -n __fish_use_subcommand ",
                    "-f -a ", command->get_name(), " -d '",
                    FishText(command->get_description()), "'\n");
  }
  for (const CLI::App* command : CommandsOf(app)) {
    for (const CLI::Option* option : OptionsOf(*command)) {
      absl::StrAppend(&script, "complete -c isomatch -n ",
                      "'__fish_seen_subcommand_from ", command->get_name(),
                      "'");
      for (const std::string& name : option->get_lnames()) {
        absl::StrAppend(&script, " -l ", name);
      }
      for (const std::string& name : option->get_snames()) {
        absl::StrAppend(&script, " -s ", name);
      }
      absl::StrAppend(&script, FishValue(*option), " -d '",
                      FishText(option->get_description()), "'\n");
    }
  }
  return script +
         "complete -c isomatch -n '__fish_seen_subcommand_from completion' "
         "-f -a 'bash zsh fish'\n"
         "complete -c isomatch -n '__fish_seen_subcommand_from help' -f -a '" +
         CommandNames(app) + "'\n";
}

std::string ManPage(const CLI::App& app, const std::string& version) {
  std::string page = absl::StrCat(
      ".TH ISOMATCH 1 \"\" \"isomatch ", ManText(version), "\"\n",
      ".SH NAME\nisomatch \\- dense correspondences between near\\-isometric "
      "3D "
      "meshes\n",
      ".SH SYNOPSIS\n.B isomatch\n.I COMMAND\n[options]\n", ".SH DESCRIPTION\n",
      ManText(app.get_description()), "\n.PP\n.nf\n",
      ManText(absl::StripAsciiWhitespace(app.get_footer())), "\n.fi\n",
      ".SH COMMANDS\n");
  for (const CLI::App* command : CommandsOf(app)) {
    AppendManCommand(*command, page);
  }
  return page +
         ".SH ENVIRONMENT\n"
         ".TP\n.B ISOMATCH_SERVER\nStands for \\-\\-server.\n"
         ".TP\n.B ISOMATCH_API_KEY\nYour API key, without "
         "\\-\\-api\\-key\\-file.\n";
}

}  // namespace isomatch
