#pragma once

#include <string>
#include <vector>

namespace isomatch {

/// A Draco file made to harm a decoder.
struct HostileDraco {
  std::string name;
  std::string bytes;
};

/// Returns small files that claim much, name what is not there, or are cut
/// short; each must be refused. The first five make the decoder of Draco 1.5.5
/// allocate 2 GB or more.
std::vector<HostileDraco> HostileDracoFiles();

}  // namespace isomatch
