#include "tests/bench/own_process.h"

#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/base/file_bytes.h"

namespace isomatch::bench {
namespace {

std::string ReadAll(int file) {
  std::string bytes;
  char buffer[4096];
  for (ssize_t got; (got = read(file, buffer, sizeof buffer)) > 0;) {
    bytes.append(buffer, static_cast<std::size_t>(got));
  }
  return bytes;
}

std::string Answer(const absl::StatusOr<nlohmann::json>& result) {
  nlohmann::json answer = {{"code", result.status().code()},
                           {"message", result.status().message()}};
  if (result.ok()) answer["value"] = *result;
  return answer.dump();
}

}  // namespace

absl::StatusOr<nlohmann::json> InOwnProcess(
    const std::function<absl::StatusOr<nlohmann::json>()>& work) {
  int ends[2];
  if (pipe(ends) != 0) return absl::ErrnoToStatus(errno, "pipe");
  std::fflush(nullptr);  // or both processes would print what is waiting
  const pid_t child = fork();
  if (child < 0) return absl::ErrnoToStatus(errno, "fork");
  if (child == 0) {
    close(ends[0]);
    (void)WriteAll(ends[1], Answer(work()));  // a part of it is not JSON
    std::fflush(nullptr);
    _exit(0);
  }
  close(ends[1]);
  const std::string text = ReadAll(ends[0]);
  close(ends[0]);
  int ended = 0;
  waitpid(child, &ended, 0);
  const nlohmann::json answer = nlohmann::json::parse(text, nullptr, false);
  if (answer.is_discarded()) {
    return absl::InternalError(
        WIFSIGNALED(ended)
            ? absl::StrCat("a measuring process ended by signal ",
                           WTERMSIG(ended))
            : std::string("a measuring process ended without figures"));
  }
  const auto code = answer["code"].get<absl::StatusCode>();
  if (code == absl::StatusCode::kOk) return answer["value"];
  return absl::Status(code, answer["message"].get<std::string>());
}

}  // namespace isomatch::bench
