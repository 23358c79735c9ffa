#include "core/pipeline/instruction_set.h"

#include <atomic>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace isomatch {
namespace {

std::vector<const char*> FindNames() {
  std::vector<const char*> names;
#ifdef ISOMATCH_DISPATCH
  __builtin_cpu_init();
  if (__builtin_cpu_supports("x86-64-v3")) names.push_back("x86-64-v3");
#endif
  names.push_back(ISOMATCH_BASELINE);
  return names;
}

const std::vector<const char*>& Names() {
  static const auto& names = *new std::vector<const char*>(FindNames());
  return names;
}

std::atomic<const char*>& Chosen() {
  static std::atomic<const char*> chosen = Names().front();
  return chosen;
}

}  // namespace

std::vector<std::string> InstructionSets() {
  return {Names().begin(), Names().end()};
}

std::string InstructionSet() { return Chosen().load(); }

absl::Status UseInstructionSet(absl::string_view name) {
  for (const char* const known : Names()) {
    if (known != name) continue;
    Chosen() = known;
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("instruction set '", name,
                                                 "', expected one of ",
                                                 absl::StrJoin(Names(), ", ")));
}

}  // namespace isomatch
