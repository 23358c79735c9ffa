#include "tests/bench/pair_set.h"

#include <filesystem>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "core/base/nearest_columns.h"
#include "core/base/status_macros.h"

namespace isomatch::bench {
namespace {

absl::StatusOr<TriangleMesh> ReadOff(const std::string& dir,
                                     const std::string& name) {
  ISOMATCH_ASSIGN_OR_RETURN(
      LoadedMesh loaded, ReadMesh(absl::StrCat(dir, "/", name, ".off"), name));
  return std::move(loaded.mesh);
}

/// One number a line.
absl::StatusOr<VertexMap> ReadColumn(const std::string& path) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, "a column"));
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<NumberLine> lines,
                            ParseNumberLines(path, text));
  VertexMap column;
  for (const NumberLine& line : lines) {
    column.push_back(static_cast<VertexIndex>(line.numbers.at(0)));
  }
  return column;
}

PointColumns Columns(const Positions& positions) {
  return positions.transpose().cast<float>();
}

/// The truth of X -> mirror -> Y over the template, for vertices of X that have
/// a truth.
absl::StatusOr<VertexMap> MirroredOverTemplate(const std::string& dir,
                                               const std::string& name_x,
                                               const std::string& name_y,
                                               const VertexMap& direct) {
  ISOMATCH_ASSIGN_OR_RETURN(const TriangleMesh body,
                            ReadOff(dir, "full_m_rest"));
  ISOMATCH_ASSIGN_OR_RETURN(const VertexMap mirror,
                            ReadColumn(dir + "/template_mirror.txt"));
  ISOMATCH_ASSIGN_OR_RETURN(const VertexMap template_from_x,
                            ReadColumn(absl::StrCat(dir, "/", name_x, ".idx")));
  ISOMATCH_ASSIGN_OR_RETURN(const VertexMap template_from_y,
                            ReadColumn(absl::StrCat(dir, "/", name_y, ".idx")));
  VertexMap mirrored_x;
  for (const VertexIndex t : template_from_x) mirrored_x.push_back(mirror[t]);
  ISOMATCH_ASSIGN_OR_RETURN(
      VertexMap mirrored,
      NearestColumns(Columns(body.positions(mirrored_x, Eigen::all)),
                     Columns(body.positions(template_from_y, Eigen::all)), {}));
  for (std::size_t x = 0; x < direct.size(); ++x) {
    if (direct[x] == kNoVertex) mirrored[x] = kNoVertex;
  }
  return mirrored;
}

}  // namespace

absl::StatusOr<std::vector<std::pair<std::string, std::string>>> ReadPairNames(
    const std::string& dir) {
  const std::string path = dir + "/pairs.txt";
  ISOMATCH_ASSIGN_OR_RETURN(const std::string text,
                            ReadFile(path, "pairs of mesh names"));
  std::vector<std::pair<std::string, std::string>> pairs;
  std::istringstream stream(text);
  std::string x;
  std::string y;
  while (stream >> x >> y) pairs.emplace_back(x, y);
  return pairs;
}

absl::StatusOr<MeshPair> ReadPair(const std::string& dir,
                                  const std::string& name_x,
                                  const std::string& name_y) {
  MeshPair pair = {name_x, name_y, {}, {}, {}};
  ISOMATCH_ASSIGN_OR_RETURN(pair.mesh_x, ReadOff(dir, name_x));
  ISOMATCH_ASSIGN_OR_RETURN(pair.mesh_y, ReadOff(dir, name_y));
  ISOMATCH_ASSIGN_OR_RETURN(
      pair.truth,
      ReadGroundTruth(absl::StrCat(dir, "/gt_", name_x, "__", name_y, ".txt"),
                      pair.mesh_x.num_vertices(), pair.mesh_y.num_vertices()));
  if (pair.truth.mirrored.empty() &&
      std::filesystem::exists(dir + "/template_mirror.txt")) {
    ISOMATCH_ASSIGN_OR_RETURN(
        pair.truth.mirrored,
        MirroredOverTemplate(dir, name_x, name_y, pair.truth.direct));
  }
  return pair;
}

}  // namespace isomatch::bench
