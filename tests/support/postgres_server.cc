#include "tests/support/postgres_server.h"

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/base/status_macros.h"
#include "tests/support/user_process.h"

namespace isomatch {
namespace {

// Debian's folder, which is not in PATH.
constexpr char kDebianFolder[] = "/usr/lib/postgresql/15/bin";
constexpr absl::Duration kPause = absl::Milliseconds(5);
constexpr absl::Duration kLongestStart = absl::Seconds(60);

absl::Status RunCommand(const UserCommand& command) {
  int status = 0;
  ISOMATCH_ASSIGN_OR_RETURN(const pid_t child, SpawnAsUser(command));
  if (waitpid(child, &status, 0) == child && status == 0) {
    return absl::OkStatus();
  }
  return absl::InternalError(
      absl::StrCat(command.words[0], ": ", TextOf(command.output)));
}

/// Makes a folder of data with a database `isomatch`.
absl::Status MakeData(const std::string& postgres,
                      const TemporaryFolder& folder) {
  ISOMATCH_ASSIGN_OR_RETURN(std::string initdb, FindPostgresProgram("initdb"));
  const std::string data = folder.Path("data");
  ISOMATCH_RETURN_IF_ERROR(RunCommand(
      {.words = {std::move(initdb), "--pgdata", data, "--auth", "trust",
                 "--username", "isomatch", "--encoding", "UTF8", "--locale",
                 "C.UTF-8", "--wal-segsize", "1", "--no-sync"},
       .output = folder.Path("log")}));
  return RunCommand(
      {.words = {postgres, "--single", "-D", data, "-F", "template1"},
       .input = folder.Write("rename.sql",
                             "ALTER DATABASE postgres RENAME TO isomatch;\n"),
       .output = folder.Path("log")});
}

/// Returns such a folder, made once in a process.
absl::StatusOr<std::string> FreshData(const std::string& postgres) {
  static const TemporaryFolder folder;
  static const absl::Status made = MakeData(postgres, folder);
  ISOMATCH_RETURN_IF_ERROR(made);
  return folder.Path("data");
}

/// Returns the processes whose parent this is.
std::vector<pid_t> ChildrenOf(pid_t parent) {
  std::vector<pid_t> children;
  std::error_code none;  // of processes that end meanwhile
  for (const auto& entry : std::filesystem::directory_iterator("/proc", none)) {
    const pid_t id = std::atoi(entry.path().filename().c_str());
    if (id == 0) continue;
    // "ID (NAME) STATE PARENT ..."
    const std::string stat = TextOf(entry.path() / "stat");
    const size_t name_end = stat.rfind(')');
    if (name_end == std::string::npos) continue;
    if (std::atoi(stat.c_str() + name_end + 3) == parent) {
      children.push_back(id);
    }
  }
  return children;
}

/// Also when it is a zombie.
bool HasEnded(pid_t process) {
  const std::string stat = TextOf(absl::StrCat("/proc/", process, "/stat"));
  const size_t name_end = stat.rfind(')');
  return name_end == std::string::npos || stat[name_end + 2] == 'Z';
}

}  // namespace

absl::StatusOr<std::string> FindPostgresProgram(const std::string& name) {
  return FindProgram(name, kDebianFolder, "postgresql-15");
}

absl::StatusOr<std::unique_ptr<PostgresServer>> PostgresServer::Start() {
  return Start(Options());
}

absl::StatusOr<std::unique_ptr<PostgresServer>> PostgresServer::Start(
    Options options) {
  ISOMATCH_ASSIGN_OR_RETURN(std::string program,
                            FindPostgresProgram("postgres"));
  ISOMATCH_ASSIGN_OR_RETURN(const std::string fresh, FreshData(program));
  std::unique_ptr<PostgresServer> server(
      new PostgresServer(std::move(program), options));
  std::filesystem::copy(fresh, server->folder_.Path("data"),
                        std::filesystem::copy_options::recursive);
  if (!options.network.empty()) {
    std::ofstream(server->folder_.Path("data/pg_hba.conf"), std::ios::app)
        << "host all all " << options.network << " trust\n";
  }
  ISOMATCH_RETURN_IF_ERROR(server->Restart());
  return server;
}

PostgresServer::~PostgresServer() {
  if (id_ == 0) return;
  kill(id_, SIGQUIT);  // unlike SIGKILL, leaves no shared memory
  waitpid(id_, nullptr, 0);
}

std::string PostgresServer::url() const {
  return absl::StrCat("postgresql://isomatch@/isomatch?host=",
                      folder_.Path(""));
}

std::string PostgresServer::tcp_url() const {
  return absl::StrCat("postgresql://isomatch@", options_.address, "/isomatch");
}

void PostgresServer::Kill() {
  if (id_ == 0) return;
  kill(id_, SIGSTOP);  // it makes no more children
  const std::vector<pid_t> children = ChildrenOf(id_);
  for (const pid_t child : children) kill(child, SIGKILL);
  kill(id_, SIGKILL);
  waitpid(id_, nullptr, 0);
  id_ = 0;
  for (const pid_t child : children) {
    while (!HasEnded(child)) absl::SleepFor(kPause);
  }
}

absl::Status PostgresServer::Restart() {
  Kill();
  const std::string fsync = options_.fsync ? "on" : "off";
  ISOMATCH_ASSIGN_OR_RETURN(
      id_, SpawnAsUser(
               {.words = {program_, "-D", folder_.Path("data"), "-k",
                          folder_.Path(""), "-h", options_.address, "-c",
                          "fsync=" + fsync, "-c", "full_page_writes=" + fsync,
                          "-c", "dynamic_shared_memory_type=mmap"},
                .output = folder_.Path("log")}));
  return WaitUntilItAnswers();
}

absl::Status PostgresServer::WaitUntilItAnswers() {
  const absl::Time deadline = absl::Now() + kLongestStart;
  while (waitpid(id_, nullptr, WNOHANG) == 0) {
    // Its first line is the process, the last one its state.
    const std::vector<std::string> lines =
        absl::StrSplit(TextOf(folder_.Path("data/postmaster.pid")), '\n');
    if (lines.size() >= 8 && lines[0] == absl::StrCat(id_) &&
        absl::StartsWith(lines[7], "ready")) {
      return absl::OkStatus();
    }
    if (absl::Now() > deadline) {
      Kill();
      break;
    }
    absl::SleepFor(kPause);
  }
  id_ = 0;
  return absl::InternalError(
      absl::StrCat(program_, ": ", TextOf(folder_.Path("log"))));
}

}  // namespace isomatch
