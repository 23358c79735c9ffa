#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/temporary_folder.h"

namespace isomatch {

/// A file system of its own below the test's temporary directory, with what a
/// test wants /proc and /sys to say.
class FakeRoot {
 public:
  void Write(const std::string& path, const std::string& text) const {
    const std::filesystem::path file = root_ + path;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << text;
  }

  const std::string& path() const { return root_; }

 private:
  const TemporaryFolder folder_;
  const std::string root_ = folder_.Path("");
};

}  // namespace isomatch
