// Compiled for the oldest processors alone: which functions to call is found
// out here, and nothing newer may run before that.
#include <atomic>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/pipeline/instruction_set.h"
#include "core/pipeline/matcher_functions.h"

#ifdef ISOMATCH_DISPATCH
extern "C" const isomatch::MatcherFunctions*
isomatch_matcher_functions_x86_64_v3();
#endif

namespace isomatch {
namespace {

struct Variant {
  const char* name;
  const MatcherFunctions* functions;
};

std::vector<Variant> FindVariants() {
  std::vector<Variant> variants;
#ifdef ISOMATCH_DISPATCH
  __builtin_cpu_init();
  if (__builtin_cpu_supports("x86-64-v3")) {
    variants.push_back({"x86-64-v3", isomatch_matcher_functions_x86_64_v3()});
  }
#endif
  variants.push_back({ISOMATCH_BASELINE, ISOMATCH_MATCHER_FUNCTIONS()});
  return variants;
}

const std::vector<Variant>& Variants() {
  static const auto& variants = *new std::vector<Variant>(FindVariants());
  return variants;
}

std::atomic<const Variant*>& Chosen() {
  static std::atomic<const Variant*> chosen = &Variants().front();
  return chosen;
}

const MatcherFunctions& Functions() { return *Chosen().load()->functions; }

}  // namespace

std::vector<std::string> InstructionSets() {
  std::vector<std::string> names;
  for (const Variant& variant : Variants()) names.emplace_back(variant.name);
  return names;
}

std::string InstructionSet() { return Chosen().load()->name; }

absl::Status UseInstructionSet(absl::string_view name) {
  for (const Variant& variant : Variants()) {
    if (variant.name != name) continue;
    Chosen() = &variant;
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("instruction set '", name, "', expected one of ",
                   absl::StrJoin(InstructionSets(), ", ")));
}

absl::StatusOr<Correspondence> Match(const TriangleMesh& mesh_x,
                                     const TriangleMesh& mesh_y,
                                     absl::Span<const Landmark> landmarks,
                                     const MatchOptions& options,
                                     const ProgressCallback& progress,
                                     std::stop_token stop) {
  return Functions().match(mesh_x, mesh_y, landmarks, options, progress,
                           std::move(stop));
}

absl::StatusOr<PreparedShape> Prepare(TriangleMesh mesh,
                                      const MatchOptions& options,
                                      const ProgressCallback& progress,
                                      std::stop_token stop) {
  return Functions().prepare(std::move(mesh), options, progress,
                             std::move(stop));
}

absl::StatusOr<PreparedPair> PrepareBoth(TriangleMesh mesh_x,
                                         TriangleMesh mesh_y,
                                         const MatchOptions& options,
                                         const ProgressCallback& progress,
                                         std::stop_token stop) {
  return Functions().prepare_both(std::move(mesh_x), std::move(mesh_y), options,
                                  progress, std::move(stop));
}

absl::StatusOr<Correspondence> MatchPrepared(
    const PreparedShape& x, const PreparedShape& y,
    absl::Span<const Landmark> landmarks, const MatchOptions& options,
    const ProgressCallback& progress, std::stop_token stop) {
  return Functions().match_prepared(x, y, landmarks, options, progress,
                                    std::move(stop));
}

absl::StatusOr<PreparedShape> ParsePreparedShape(absl::string_view bytes,
                                                 std::stop_token stop) {
  return Functions().parse_prepared_shape(bytes, std::move(stop));
}

}  // namespace isomatch
