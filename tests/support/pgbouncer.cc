#include "tests/support/pgbouncer.h"

#include <csignal>
#include <filesystem>

#include <sys/wait.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/base/status_macros.h"
#include "tests/support/user_process.h"

namespace isomatch {
namespace {

// Debian's folder, which is not in every PATH.
constexpr char kBouncerFolder[] = "/usr/sbin";
constexpr int kPort = 6432;
constexpr absl::Duration kBouncerPause = absl::Milliseconds(5);
constexpr absl::Duration kLongestBouncerStart = absl::Seconds(30);

/// Its configuration. It looks for a database that was away again after one
/// second, not fifteen.
std::string Configuration(const PostgresServer& server,
                          const TemporaryFolder& folder) {
  return absl::StrCat("[databases]\nisomatch = host=", server.folder(),
                      " user=isomatch dbname=isomatch\n",
                      "[pgbouncer]\npool_mode = transaction\n",
                      "auth_type = any\nunix_socket_dir = ", folder.Path(""),
                      "\nlisten_port = ", kPort,
                      "\nmax_client_conn = 500\ndefault_pool_size = 20\n",
                      "server_login_retry = 1\n");
}

}  // namespace

absl::StatusOr<std::unique_ptr<PgBouncer>> PgBouncer::Start(
    const PostgresServer& server) {
  ISOMATCH_ASSIGN_OR_RETURN(
      std::string program,
      FindProgram("pgbouncer", kBouncerFolder, "pgbouncer"));
  std::unique_ptr<PgBouncer> bouncer(new PgBouncer(std::move(program)));
  bouncer->folder_.Write("pgbouncer.ini",
                         Configuration(server, bouncer->folder_));
  ISOMATCH_RETURN_IF_ERROR(bouncer->Restart());
  return bouncer;
}

PgBouncer::~PgBouncer() { Kill(); }

void PgBouncer::Kill() {
  if (id_ == 0) return;
  kill(id_, SIGKILL);
  waitpid(id_, nullptr, 0);
  id_ = 0;
}

std::string PgBouncer::url() const {
  return absl::StrCat("postgresql://isomatch@/isomatch?host=", folder_.Path(""),
                      "&port=", kPort);
}

absl::Status PgBouncer::Restart() {
  Kill();
  const std::string socket = folder_.Path(absl::StrCat(".s.PGSQL.", kPort));
  std::filesystem::remove(socket);  // as SIGKILL left it
  ISOMATCH_ASSIGN_OR_RETURN(
      id_, SpawnAsUser({.words = {program_, folder_.Path("pgbouncer.ini")},
                        .output = folder_.Path("log")}));
  const absl::Time deadline = absl::Now() + kLongestBouncerStart;
  while (waitpid(id_, nullptr, WNOHANG) == 0) {
    if (std::filesystem::exists(socket)) return absl::OkStatus();
    if (absl::Now() > deadline) {
      Kill();
      break;
    }
    absl::SleepFor(kBouncerPause);
  }
  id_ = 0;
  return absl::InternalError(
      absl::StrCat(program_, ": ", TextOf(folder_.Path("log"))));
}

}  // namespace isomatch
