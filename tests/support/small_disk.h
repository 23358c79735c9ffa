#pragma once

#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/temporary_folder.h"

namespace isomatch {

/// A disk of a few MiB of the running test, to fill it. Root can have one, and
/// who may make a namespace of users, in a process of one thread: others get
/// `problem`, and skip.
class SmallDisk {
 public:
  explicit SmallDisk(int mebibytes) {
    std::filesystem::create_directory(path_);
    const std::string size = "size=" + std::to_string(mebibytes) + "m";
    if (Mount(size) || (BecomeRootOfANamespace() && Mount(size))) return;
    problem_ = std::string("NOT TESTED, no small disk can be mounted (") +
               std::strerror(errno) +
               "): be root, or allow user namespaces to this process";
  }
  ~SmallDisk() { umount2(path_.c_str(), MNT_DETACH); }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  /// Empty if there is a disk.
  const std::string& problem() const { return problem_; }
  std::string Path(const std::string& name) const { return path_ + "/" + name; }

  /// Takes all the room that is left.
  void Fill() const {
    for (const std::size_t piece : {std::size_t{4096}, std::size_t{1}}) {
      std::ofstream file(Path("fill"), std::ios::app | std::ios::binary);
      const std::string bytes(piece, 'x');
      while (file << bytes << std::flush) {
      }
    }
  }

  /// Gives it back.
  void Empty() const { std::filesystem::remove(Path("fill")); }

 private:
  bool Mount(const std::string& size) const {
    return mount("tmpfs", path_.c_str(), "tmpfs", 0, size.c_str()) == 0;
  }

  static bool BecomeRootOfANamespace() {
    const std::string user = std::to_string(geteuid());
    const std::string group = std::to_string(getegid());
    if (unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return false;
    std::ofstream("/proc/self/setgroups") << "deny";
    std::ofstream("/proc/self/uid_map") << "0 " + user + " 1";
    std::ofstream("/proc/self/gid_map") << "0 " + group + " 1";
    return true;
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.Path("disk");
  std::string problem_;
};

}  // namespace isomatch
