#include "client/batch/batch_list.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>
#include <system_error>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/files/input_file.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

bool IsMesh(const fs::path& path) {
  const std::vector<std::string> known = MeshExtensions();
  return absl::c_linear_search(known, LowerExtension(WithoutGz(path.string())));
}

bool IsFile(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

// `path`, or with the first extension that makes it a file; empty for none.
std::string FindMesh(const fs::path& path) {
  if (IsFile(path)) return path.string();
  for (const std::string& extension : MeshExtensions()) {
    for (const char* const packed : {"", ".gz"}) {
      std::string candidate = absl::StrCat(path.string(), extension, packed);
      if (IsFile(candidate)) return candidate;
    }
  }
  return "";
}

std::string PairName(const std::string& x, const std::string& y) {
  return absl::StrCat(fs::path(WithoutGz(x)).stem().string(), "__",
                      fs::path(WithoutGz(y)).stem().string());
}

// The paths of a line; nothing when a quote has no partner.
std::optional<std::vector<std::string>> SplitPaths(absl::string_view line) {
  std::size_t length = 0;
  for (bool is_in_quotes = false;
       length < line.size() && (is_in_quotes || line[length] != '#');
       ++length) {
    is_in_quotes ^= line[length] == '"';
  }
  line = absl::StripAsciiWhitespace(line.substr(0, length));
  const bool has_tabs = line.find('\t') != absl::string_view::npos;
  std::vector<std::string> paths;
  std::string path;
  bool is_quoted = false;
  bool was_quoted = false;
  const auto end = [&] {
    // Blanks around what stands between tabs are not meant.
    const absl::string_view text =
        was_quoted ? path : absl::StripAsciiWhitespace(path);
    if (!text.empty()) paths.emplace_back(text);
    path.clear();
    was_quoted = false;
  };
  for (const char c : line) {
    if (c == '"') {
      is_quoted = !is_quoted;
      if (is_quoted) path = std::string(absl::StripAsciiWhitespace(path));
      was_quoted = true;
      continue;
    }
    if (!is_quoted) {
      if (c == '\t' || c == '\r' || (c == ' ' && !has_tabs)) {
        end();
        continue;
      }
      if (c == ' ' && was_quoted) continue;
    }
    path += c;
  }
  if (is_quoted) return std::nullopt;
  end();
  return paths;
}

absl::StatusOr<BatchPair> ParseLine(const std::string& list, int number,
                                    const std::vector<std::string>& words) {
  if (words.size() < 2 || words.size() > 4) {
    return LineError(
        list, number,
        absl::StrCat("expected X Y [LANDMARKS] or X Y X_POINTS Y_POINTS, "
                     "found ",
                     words.size(), words.size() == 1 ? " word" : " words",
                     "; paths with blanks stand between tabs or double "
                     "quotes"));
  }
  const fs::path folder = fs::path(list).parent_path();
  BatchPair pair;
  pair.x = FindMesh(folder / words[0]);
  pair.y = FindMesh(folder / words[1]);
  for (const auto& [found, word] :
       {std::pair(&pair.x, &words[0]), std::pair(&pair.y, &words[1])}) {
    if (!found->empty()) continue;
    return LineError(list, number,
                     absl::StrCat("there is no '", (folder / *word).string(),
                                  "', expected a mesh: ", kMeshFiles));
  }
  if (words.size() == 3) pair.landmarks = (folder / words[2]).string();
  if (words.size() == 4) {
    pair.points_x = (folder / words[2]).string();
    pair.points_y = (folder / words[3]).string();
  }
  pair.name = PairName(pair.x, pair.y);
  return pair;
}

// The files that `target` stands for.
absl::StatusOr<std::vector<std::string>> Expand(const std::string& target) {
  std::error_code error;
  if (!fs::is_directory(target, error)) {
    ISOMATCH_RETURN_IF_ERROR(CheckInputFile(target, "a mesh"));
    return std::vector<std::string>{target};
  }
  std::vector<std::string> files;
  for (const fs::directory_entry& entry :
       fs::directory_iterator(target, error)) {
    if (IsMesh(entry.path()) && IsFile(entry.path())) {
      files.push_back(entry.path().string());
    }
  }
  std::sort(files.begin(), files.end());
  if (!files.empty()) return files;
  return absl::InvalidArgumentError(absl::StrCat(
      "'", target, "': expected a folder with files ", kMeshFiles));
}

absl::Status SameName(const std::string& name) {
  return absl::InvalidArgumentError(absl::StrCat(
      "two pairs are named '", name,
      "', and would write the same files; expected another name of a mesh"));
}

}  // namespace

absl::StatusOr<std::vector<BatchPair>> ReadBatchList(const std::string& path) {
  ISOMATCH_ASSIGN_OR_RETURN(const InputFile file,
                            ReadInput(path, "a list of pairs"));
  std::vector<BatchPair> pairs;
  std::set<std::string> names;
  int number = 0;
  for (const absl::string_view line : absl::StrSplit(file.bytes, '\n')) {
    ++number;
    const std::optional<std::vector<std::string>> words = SplitPaths(line);
    if (!words) return LineError(path, number, "expected a second \"");
    if (words->empty()) continue;
    ISOMATCH_ASSIGN_OR_RETURN(BatchPair pair, ParseLine(path, number, *words));
    if (!names.insert(pair.name).second) {
      return LineError(path, number,
                       std::string(SameName(pair.name).message()));
    }
    pairs.push_back(std::move(pair));
  }
  if (!pairs.empty()) return pairs;
  return absl::InvalidArgumentError(
      absl::StrCat("'", path, "': expected lines X Y [LANDMARKS], found none"));
}

absl::StatusOr<std::vector<BatchPair>> PairWithTemplate(
    const std::string& template_mesh, const std::vector<std::string>& targets,
    bool reverse) {
  ISOMATCH_RETURN_IF_ERROR(CheckInputFile(template_mesh, "a mesh"));
  std::vector<BatchPair> pairs;
  std::set<std::string> names;
  for (const std::string& target : targets) {
    ISOMATCH_ASSIGN_OR_RETURN(const std::vector<std::string> files,
                              Expand(target));
    for (const std::string& file : files) {
      std::error_code error;
      if (fs::equivalent(file, template_mesh, error)) continue;
      BatchPair pair;
      pair.x = reverse ? file : template_mesh;
      pair.y = reverse ? template_mesh : file;
      pair.name = PairName(pair.x, pair.y);
      if (!names.insert(pair.name).second) return SameName(pair.name);
      pairs.push_back(std::move(pair));
    }
  }
  if (!pairs.empty()) return pairs;
  return absl::InvalidArgumentError(
      "expected a mesh beside the template, found none");
}

absl::Status AddTruths(const std::string& folder,
                       std::vector<BatchPair>* pairs) {
  bool found = false;
  for (BatchPair& pair : *pairs) {
    const fs::path truth =
        fs::path(folder) / absl::StrCat("gt_", pair.name, ".txt");
    if (!IsFile(truth)) continue;
    pair.truth = truth.string();
    found = true;
  }
  if (found) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("--truth '", folder, "': expected gt_X__Y.txt for a pair, ",
                   "e.g. gt_", pairs->front().name, ".txt"));
}

}  // namespace isomatch
