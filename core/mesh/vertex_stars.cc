#include "core/mesh/vertex_stars.h"

#include <algorithm>

namespace isomatch {
namespace {

std::vector<VertexIndex> AtEvenSteps(absl::Span<const VertexIndex> all,
                                     std::size_t most) {
  std::vector<VertexIndex> some;
  const std::size_t count = std::min(all.size(), most);
  for (std::size_t i = 0; i < count; ++i) {
    some.push_back(all[i * all.size() / count]);
  }
  return some;
}

/// Of a few values, most of which come twice, by insertion.
void SortUnique(std::vector<VertexIndex>* values) {
  constexpr std::size_t kFew = 24;
  if (values->size() > kFew) {
    std::sort(values->begin(), values->end());
    values->erase(std::unique(values->begin(), values->end()), values->end());
    return;
  }
  VertexIndex* const all = values->data();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < values->size(); ++i) {
    const VertexIndex value = all[i];
    std::size_t at = kept;
    while (at > 0 && all[at - 1] > value) --at;
    if (at > 0 && all[at - 1] == value) continue;
    for (std::size_t j = kept; j > at; --j) all[j] = all[j - 1];
    all[at] = value;
    ++kept;
  }
  values->resize(kept);
}

}  // namespace

VertexStars::VertexStars(const TriangleMesh& mesh) {
  const VertexIndex n = mesh.num_vertices();
  first_face_.assign(std::int64_t{n} + 1, 0);
  for (Eigen::Index i = 0; i < mesh.faces.size(); ++i) {
    ++first_face_[mesh.faces.data()[i] + 1];
  }
  for (VertexIndex v = 0; v < n; ++v) first_face_[v + 1] += first_face_[v];
  faces_.resize(mesh.faces.size());
  std::vector<std::int32_t> next(first_face_.begin(), first_face_.end() - 1);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      faces_[next[mesh.faces(f, corner)]++] = f;
    }
  }
  first_neighbor_.assign(1, 0);
  std::vector<VertexIndex> around;
  for (VertexIndex v = 0; v < n; ++v) {
    around.clear();
    for (const VertexIndex f : Faces(v)) {
      for (int corner = 0; corner < 3; ++corner) {
        if (mesh.faces(f, corner) != v) around.push_back(mesh.faces(f, corner));
      }
    }
    SortUnique(&around);
    neighbors_.insert(neighbors_.end(), around.begin(), around.end());
    first_neighbor_.push_back(static_cast<std::int32_t>(neighbors_.size()));
    if (std::max(Faces(v).size(), around.size()) > kSome) {
      some_of_hubs_[v] = {AtEvenSteps(Faces(v), kSome),
                          AtEvenSteps(around, kSome)};
    }
  }
}

}  // namespace isomatch
