#include "tests/bench/worker_networks.h"

#include <cerrno>
#include <cstdio>
#include <cstring>

#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace isomatch::bench {
namespace {

absl::Status Ip(const std::string& arguments) {
  const std::string command = absl::StrCat("ip ", arguments, " 2>&1");
  FILE* const output = popen(command.c_str(), "r");
  if (output == nullptr) return absl::UnavailableError(command);
  std::string said;
  char text[256];
  while (fgets(text, sizeof text, output) != nullptr) said += text;
  if (pclose(output) == 0) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("ip ", arguments, ": ", said));
}

}  // namespace

absl::StatusOr<std::unique_ptr<WorkerNetworks>> WorkerNetworks::Make(
    int workers) {
  if (geteuid() != 0) {
    return absl::PermissionDeniedError(
        "--namespaces makes networks, which only root may");
  }
  // Names of interfaces have at most 15 letters.
  std::unique_ptr<WorkerNetworks> networks(
      new WorkerNetworks(absl::StrCat("iso", getpid() % 100000)));
  const std::string& bridge = networks->prefix_;
  ISOMATCH_RETURN_IF_ERROR(
      Ip(absl::StrCat("link add ", bridge, " type bridge")));
  ISOMATCH_RETURN_IF_ERROR(
      Ip(absl::StrCat("addr add ", kAddress, "/24 dev ", bridge)));
  ISOMATCH_RETURN_IF_ERROR(Ip(absl::StrCat("link set ", bridge, " up")));
  for (int worker = 0; worker < workers; ++worker) {
    const std::string name = networks->NameOf(worker);
    ISOMATCH_RETURN_IF_ERROR(Ip(absl::StrCat("netns add ", name)));
    networks->workers_ = worker + 1;
    for (const std::string& step :
         {absl::StrCat("link add ", name, " type veth peer name eth0 netns ",
                       name),
          absl::StrCat("link set ", name, " master ", bridge, " up"),
          absl::StrCat("-n ", name, " addr add 10.213.0.", worker + 2,
                       "/24 dev eth0"),
          absl::StrCat("-n ", name, " link set eth0 up")}) {
      ISOMATCH_RETURN_IF_ERROR(Ip(step));
    }
  }
  return networks;
}

WorkerNetworks::~WorkerNetworks() {
  for (int worker = 0; worker < workers_; ++worker) {
    (void)Ip(absl::StrCat("netns del ", NameOf(worker)));
  }
  (void)Ip(absl::StrCat("link del ", prefix_));
}

std::string WorkerNetworks::NameOf(int worker) const {
  return absl::StrCat(prefix_, "w", worker);
}

absl::Status WorkerNetworks::Enter(int worker) const {
  const std::string path = absl::StrCat("/run/netns/", NameOf(worker));
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool has_entered = file >= 0 && setns(file, CLONE_NEWNET) == 0;
  const int error = errno;
  if (file >= 0) close(file);
  if (has_entered) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(path, ": ", std::strerror(error)));
}

}  // namespace isomatch::bench
