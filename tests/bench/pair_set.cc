#include "tests/bench/pair_set.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <set>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "core/base/nearest_columns.h"
#include "core/base/status_macros.h"
#include "tests/support/draco_file.h"

namespace isomatch::bench {
namespace {

// Of a folder with template_mirror.txt: the shape that the others come from.
constexpr char kTemplate[] = "full_m_rest";

absl::StatusOr<TriangleMesh> ReadShape(const std::string& dir,
                                       const std::string& name) {
  const std::string path = absl::StrCat(dir, "/", name);
  if (std::filesystem::exists(path + ".off")) {
    ISOMATCH_ASSIGN_OR_RETURN(LoadedMesh loaded, ReadMesh(path + ".off", name));
    return std::move(loaded.mesh);
  }
  if (std::filesystem::exists(path + ".drc")) {
    return ReadDracoFile(path + ".drc");
  }
  return absl::NotFoundError(
      absl::StrCat("there is neither '", path, ".off' nor '", path, ".drc'"));
}

/// One vertex of the template a line.
absl::StatusOr<VertexMap> ReadTemplateVertices(const std::string& path,
                                               VertexIndex vertices,
                                               VertexIndex template_vertices) {
  ISOMATCH_ASSIGN_OR_RETURN(VertexMap map,
                            ReadMap(path, template_vertices, vertices));
  if (std::find(map.begin(), map.end(), kNoVertex) != map.end()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", path, "': a line is -1, expected vertices of ", kTemplate));
  }
  return map;
}

/// The template vertex of each vertex of a shape, from NAME.idx; a shape
/// without one, and as many vertices, is numbered as the template is.
absl::StatusOr<VertexMap> TemplateFromShape(const std::string& dir,
                                            const std::string& name,
                                            VertexIndex vertices,
                                            VertexIndex template_vertices) {
  const std::string path = absl::StrCat(dir, "/", name, ".idx");
  if (std::filesystem::exists(path) || vertices != template_vertices) {
    return ReadTemplateVertices(path, vertices, template_vertices);
  }
  VertexMap same(vertices);
  std::iota(same.begin(), same.end(), 0);
  return same;
}

PointColumns Columns(const Positions& positions) {
  return positions.transpose().cast<float>();
}

/// The truth of X -> mirror -> Y over the template, for vertices of X that have
/// a truth.
absl::StatusOr<VertexMap> MirroredOverTemplate(const std::string& dir,
                                               const MeshPair& pair) {
  ISOMATCH_ASSIGN_OR_RETURN(const TriangleMesh body, ReadShape(dir, kTemplate));
  const VertexIndex n = body.num_vertices();
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap mirror,
      ReadTemplateVertices(dir + "/template_mirror.txt", n, n));
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap template_from_x,
      TemplateFromShape(dir, pair.name_x, pair.mesh_x.num_vertices(), n));
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap template_from_y,
      TemplateFromShape(dir, pair.name_y, pair.mesh_y.num_vertices(), n));
  VertexMap mirrored_x;
  for (const VertexIndex t : template_from_x) mirrored_x.push_back(mirror[t]);
  ISOMATCH_ASSIGN_OR_RETURN(
      VertexMap mirrored,
      NearestColumns(Columns(body.positions(mirrored_x, Eigen::all)),
                     Columns(body.positions(template_from_y, Eigen::all)), {}));
  for (std::size_t x = 0; x < mirrored.size(); ++x) {
    if (pair.truth.direct[x] == kNoVertex) mirrored[x] = kNoVertex;
  }
  return mirrored;
}

absl::StatusOr<GroundTruth> ReadTruth(const std::string& dir,
                                      const MeshPair& pair,
                                      bool over_template) {
  const std::string path =
      absl::StrCat(dir, "/gt_", pair.name_x, "__", pair.name_y, ".txt");
  const VertexIndex vertices_x = pair.mesh_x.num_vertices();
  const VertexIndex vertices_y = pair.mesh_y.num_vertices();
  const bool y_is_numbered_as_template =
      over_template &&
      !std::filesystem::exists(absl::StrCat(dir, "/", pair.name_y, ".idx"));
  if (std::filesystem::exists(path) || !y_is_numbered_as_template) {
    return ReadGroundTruth(path, vertices_x, vertices_y);
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      VertexMap direct,
      TemplateFromShape(dir, pair.name_x, vertices_x, vertices_y));
  return GroundTruth{std::move(direct), {}};
}

}  // namespace

absl::StatusOr<std::vector<std::pair<std::string, std::string>>> ReadPairNames(
    const std::string& path) {
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
  const bool over_template =
      std::filesystem::exists(dir + "/template_mirror.txt");
  MeshPair pair = {name_x, name_y, {}, {}, {}};
  ISOMATCH_ASSIGN_OR_RETURN(pair.mesh_x, ReadShape(dir, name_x));
  ISOMATCH_ASSIGN_OR_RETURN(pair.mesh_y, ReadShape(dir, name_y));
  ISOMATCH_ASSIGN_OR_RETURN(pair.truth, ReadTruth(dir, pair, over_template));
  if (pair.truth.mirrored.empty() && over_template) {
    ISOMATCH_ASSIGN_OR_RETURN(pair.truth.mirrored,
                              MirroredOverTemplate(dir, pair));
  }
  return pair;
}

absl::Status PackShapes(const std::string& dir, const std::string& out) {
  ISOMATCH_ASSIGN_OR_RETURN(const auto pairs,
                            ReadPairNames(dir + "/pairs.txt"));
  std::set<std::string> names;
  for (const auto& [x, y] : pairs) names.insert({x, y});
  for (const std::string& name : names) {
    ISOMATCH_ASSIGN_OR_RETURN(const TriangleMesh mesh, ReadShape(dir, name));
    ISOMATCH_RETURN_IF_ERROR(
        WriteDracoFile(absl::StrCat(out, "/", name, ".drc"), mesh));
  }
  std::printf("%zu shapes\n", names.size());
  return absl::OkStatus();
}

}  // namespace isomatch::bench
