#include "client/mesh_claims.h"

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

using Words = std::vector<absl::string_view>;

// The shortest that can be written in text: "0 0 0\n" and "3 0 1 2".
constexpr std::int64_t kOffVertexBytes = 6;
constexpr std::int64_t kOffFaceBytes = 7;

absl::Status CheckFits(const std::string& claim, std::int64_t needed_bytes,
                       std::int64_t file_bytes) {
  if (needed_bytes <= file_bytes) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("the header claims ", claim, ", which takes at least ",
                   needed_bytes, " bytes, but the file has ", file_bytes));
}

// The first words of an OFF file, without comments.
Words OffWords(absl::string_view head) {
  Words words;
  for (const absl::string_view line : absl::StrSplit(head, '\n')) {
    const Words of_line = SplitWords(line.substr(0, line.find('#')));
    words.insert(words.end(), of_line.begin(), of_line.end());
    if (words.size() >= 4) break;
  }
  return words;
}

}  // namespace

absl::Status CheckOffClaims(absl::string_view bytes) {
  const Words words = OffWords(bytes);
  if (words.empty() || !absl::EndsWith(words[0], "OFF")) {
    return absl::InvalidArgumentError(
        "expected the letters OFF at its beginning");
  }
  if (words.size() < 3 || words[1] == "BINARY") {
    return absl::InvalidArgumentError(
        "expected text with the numbers of vertices and faces after OFF");
  }
  ISOMATCH_ASSIGN_OR_RETURN(const std::int64_t vertices,
                            ParseHeaderCount(words[1], "vertices"));
  ISOMATCH_ASSIGN_OR_RETURN(const std::int64_t faces,
                            ParseHeaderCount(words[2], "faces"));
  return CheckFits(absl::StrCat(vertices, " vertices and ", faces, " faces"),
                   vertices * kOffVertexBytes + faces * kOffFaceBytes,
                   static_cast<std::int64_t>(bytes.size()));
}

}  // namespace isomatch
