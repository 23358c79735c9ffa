#include "client/cli/page_opener.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <spawn.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

bool IsSet(const char* variable) {
  const char* const value = std::getenv(variable);
  return value != nullptr && *value != '\0';
}

/// Starts xdg-open; false when there is none. It and the browser write nothing
/// to this terminal and outlive this process.
bool StartXdgOpen(const std::string& path) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    posix_spawn_file_actions_addopen(&actions, stream, "/dev/null", O_RDWR, 0);
  }
  std::string program = "xdg-open";
  std::string argument = path;
  char* const arguments[] = {program.data(), argument.data(), nullptr};
  pid_t process = 0;
  const int error = posix_spawnp(&process, program.c_str(), &actions, nullptr,
                                 arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  return error == 0;
}

}  // namespace

absl::StatusOr<std::string> MakeTemporaryFolder() {
  std::error_code error;
  const fs::path place = fs::temp_directory_path(error);
  std::string path = (place / "isomatch-view-XXXXXX").string();
  if (!error && mkdtemp(path.data()) != nullptr) return path;
  return absl::UnavailableError(absl::StrCat(
      "'", path,
      "': cannot be made: ", error ? error.message() : std::strerror(errno),
      "; say where the page goes by --output PAGE.html"));
}

absl::Status OpenPage(const std::string& path, const Terminal& terminal) {
  const bool has_display = IsSet("DISPLAY") || IsSet("WAYLAND_DISPLAY");
  if (has_display && StartXdgOpen(path)) {
    return Print(absl::StrCat(path, ": opened in the browser\n"), terminal);
  }
  return Print(absl::StrCat(path, ": open it in a browser",
                            has_display ? " (there is no xdg-open)"
                                        : "; there is no display here",
                            "\n"),
               terminal);
}

}  // namespace isomatch
