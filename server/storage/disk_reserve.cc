#include "server/storage/disk_reserve.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/file_descriptor.h"

namespace isomatch {
namespace {

constexpr auto kPause = std::chrono::seconds(10);

}  // namespace

DiskReserve::DiskReserve(const std::string& path, std::int64_t bytes)
    : path_(path), bytes_(bytes) {
  if (!IsThere()) Take();
}

bool DiskReserve::IsThere() const {
  struct stat about = {};
  return stat(path_.c_str(), &about) == 0 && about.st_size >= bytes_;
}

bool DiskReserve::Release() {
  const bool was_there = IsThere();
  unlink(path_.c_str());
  next_try_ = std::chrono::steady_clock::now() + kPause;
  return was_there;
}

void DiskReserve::Refill() {
  if (std::chrono::steady_clock::now() < next_try_) return;
  if (!IsThere()) Take();
  next_try_ = std::chrono::steady_clock::now() + kPause;
}

void DiskReserve::Take() {
  const auto file = FileDescriptor::Open(path_, O_CREAT | O_WRONLY);
  if (!file.is_open()) return;
  const bool is_taken = posix_fallocate(file.get(), 0, bytes_) == 0;
  if (!is_taken) unlink(path_.c_str());  // not even a part of it
}

}  // namespace isomatch
