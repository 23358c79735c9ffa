#include "server/rpc/accept_loop.h"

#include <cerrno>
#include <cstring>
#include <new>
#include <utility>
#include <vector>

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Taken of one listener before the others have their turn.
constexpr int kAtOnce = 64;
/// Before what just failed is tried again.
constexpr std::chrono::milliseconds kAgain(50);
constexpr int kSecond = 1000;  // of poll

/// Of no file: a container may be without /dev/null.
FileDescriptor OpenEvent() {
  return FileDescriptor(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
}

FileDescriptor AcceptOne(int listener, sockaddr_storage& peer) {
  socklen_t size = sizeof(peer);
  return FileDescriptor(accept4(listener, reinterpret_cast<sockaddr*>(&peer),
                                &size, SOCK_NONBLOCK | SOCK_CLOEXEC));
}

/// Whether the system has nothing to make a socket of.
bool IsExhausted(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS ||
         error == ENOMEM;
}

}  // namespace

absl::StatusOr<std::unique_ptr<AcceptLoop>> AcceptLoop::Listen(
    const std::string& address, const ConnectionLimits& limits) {
  ISOMATCH_ASSIGN_OR_RETURN(ListeningSockets sockets,
                            ListeningSockets::Open(address));
  FileDescriptor spare = OpenEvent();
  FileDescriptor stop = OpenEvent();
  if (!spare.is_open() || !stop.is_open()) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", address, ": ", std::strerror(errno)));
  }
  return std::unique_ptr<AcceptLoop>(new AcceptLoop(
      std::move(sockets), limits, std::move(spare), std::move(stop)));
}

AcceptLoop::AcceptLoop(ListeningSockets sockets, const ConnectionLimits& limits,
                       FileDescriptor spare, FileDescriptor stop)
    : sockets_(std::move(sockets)),
      spare_(std::move(spare)),
      stop_(std::move(stop)),
      table_(limits) {}

AcceptLoop::~AcceptLoop() { Stop(); }

void AcceptLoop::Start(HandOver hand_over) {
  hand_over_ = std::move(hand_over);
  thread_ = std::thread([this] { Run(); });
}

void AcceptLoop::Stop() {
  is_stopped_ = true;
  eventfd_write(stop_.get(), 1);
  if (thread_.joinable()) thread_.join();
}

int AcceptLoop::CountOpen() {
  const MutexLock lock(mutex_);
  return table_.CountOpen();
}

// Nothing is kept from one round to the next but what is in members, so
// whatever fails in a round, the next one accepts.
void AcceptLoop::Run() {
  while (!is_stopped_) {
    bool is_well = true;
    try {
      WaitForWork();
      for (const FileDescriptor& listener : sockets_.sockets()) {
        is_well = AcceptSome(listener.get()) && is_well;
      }
      refusals_.Tell(Refusals::Clock::now());
    } catch (const std::bad_alloc&) {
      is_well = false;
    }
    if (!is_well) std::this_thread::sleep_for(kAgain);
  }
}

void AcceptLoop::WaitForWork() {
  std::vector<pollfd> waits = {{stop_.get(), POLLIN, 0}};
  for (const FileDescriptor& listener : sockets_.sockets()) {
    waits.push_back({listener.get(), POLLIN, 0});
  }
  const bool is_calm = spare_.is_open() && !refusals_.is_open();
  poll(waits.data(), waits.size(), is_calm ? -1 : kSecond);
  if (!spare_.is_open()) spare_ = OpenEvent();
}

// False when the next attempt should wait.
bool AcceptLoop::AcceptSome(int listener) {
  int failures = 0;
  for (int i = 0; i < kAtOnce && !is_stopped_; ++i) {
    sockaddr_storage peer{};
    FileDescriptor socket = AcceptOne(listener, peer);
    if (socket.is_open()) {
      Admit(std::move(socket), peer);
    } else if (errno == EAGAIN) {
      return true;
    } else if (!IsExhausted(errno)) {
      ++failures;  // the peer went away, or its network
    } else if (!RefuseOne(listener)) {
      return false;
    }
  }
  return failures < kAtOnce;
}

bool AcceptLoop::RefuseOne(int listener) {
  spare_.Close();
  sockaddr_storage peer{};
  const bool is_closed = AcceptOne(listener, peer).is_open();
  spare_ = OpenEvent();
  if (is_closed) {
    refusals_.Add(Refusal::kNoDescriptor, Refusals::Clock::now());
  }
  return is_closed;
}

void AcceptLoop::Admit(FileDescriptor socket, const sockaddr_storage& peer) {
  using Admission = ConnectionTable::Admission;
  const auto now = Refusals::Clock::now();
  const Admission admission = [&] {
    const MutexLock lock(mutex_);
    return table_.Admit(socket.get(), OriginOf(peer), now);
  }();
  if (admission == Admission::kAdmitted) return hand_over_(socket.Release());
  refusals_.Add(admission == Admission::kTooMany ? Refusal::kTooMany
                                                 : Refusal::kTooManyOfOrigin,
                now);
}

}  // namespace isomatch
