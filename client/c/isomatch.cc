#include "client/c/isomatch.h"

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include "client/c/arguments.h"
#include "client/c/deadline_timer.h"
#include "client/c/objects.h"
#include "client/c/report.h"
#include "core/base/status_macros.h"
#include "core/base/version.h"
#include "core/io/draco_mesh.h"
#include "core/io/face_order.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/joined_progress.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"

using isomatch::CopyOf;
using isomatch::Correspondence;
using isomatch::DeadlineTimer;
using isomatch::Guarded;
using isomatch::Invalid;
using isomatch::kMostElements;
using isomatch::Landmark;
using isomatch::MatchControl;
using isomatch::MatchOptions;
using isomatch::PreparedShape;
using isomatch::ShapeSource;
using isomatch::SharedMesh;
using isomatch::TriangleMesh;

namespace {

MatchOptions OptionsOf(const isomatch_options* options) {
  return options == nullptr ? MatchOptions() : options->options;
}

/// In milliseconds; 0 for none.
absl::StatusOr<std::int64_t> DeadlineOf(const isomatch_options* options) {
  const std::int64_t found =
      options == nullptr ? 0 : options->deadline_milliseconds;
  if (found > 0 && options->options.profile == isomatch::Profile::kPaper) {
    return Invalid("options.deadline_milliseconds",
                   absl::StrCat(found,
                                ", expected 0 with the profile paper: the "
                                "default one alone has maps before the last"));
  }
  return found;
}

/// What a server would get, so that its map is the same.
void SetAsSent(TriangleMesh& mesh) {
  const Eigen::RowVector3d origin = isomatch::SentOriginOf(mesh);
  mesh.positions =
      (mesh.positions.rowwise() - origin).cast<float>().cast<double>().eval();
  isomatch::SortFaces(mesh.num_vertices(), mesh.faces);
}

absl::StatusOr<TriangleMesh> MeshOf(const isomatch_mesh* mesh,
                                    const std::string& field) {
  ISOMATCH_ASSIGN_OR_RETURN(TriangleMesh own, CopyOf(mesh, field));
  SetAsSent(own);
  return own;
}

/// A mesh of the caller's, or a shape.
absl::StatusOr<ShapeSource> SourceOf(const isomatch_mesh* mesh,
                                     const isomatch_shape* shape,
                                     const char* side) {
  if (mesh != nullptr && shape != nullptr) {
    return Invalid(absl::StrCat("shape_", side),
                   absl::StrCat("expected NULL beside mesh_", side));
  }
  if (shape != nullptr) return ShapeSource(shape->shape);
  ISOMATCH_ASSIGN_OR_RETURN(TriangleMesh own,
                            MeshOf(mesh, absl::StrCat("mesh_", side)));
  return ShapeSource(SharedMesh(std::move(own)));
}

/// Of what SourceOf has taken.
isomatch::MeshSize SizeOf(const isomatch_mesh* mesh,
                          const isomatch_shape* shape) {
  if (shape != nullptr) return shape->size;
  return {mesh->num_vertices, mesh->num_faces};
}

absl::StatusOr<std::vector<Landmark>> LandmarksOf(const isomatch_pair& pair) {
  const std::int64_t count = pair.num_landmarks;
  if (count < 0) {
    return Invalid("num_landmarks",
                   absl::StrCat(count, ", expected 0 or more"));
  }
  if (count > 0 && pair.landmarks == nullptr) {
    return Invalid("landmarks", absl::StrCat("NULL, expected ", count));
  }
  std::vector<Landmark> own;
  own.reserve(static_cast<std::size_t>(count));
  for (std::int64_t i = 0; i < count; ++i) {
    own.push_back({pair.landmarks[i].x, pair.landmarks[i].y});
  }
  return own;
}

/// A caller's control for the length of a call.
class Control {
 public:
  explicit Control(const isomatch_control* control,
                   std::int64_t deadline_milliseconds = 0) {
    if (deadline_milliseconds > 0) {
      deadline_.emplace(std::chrono::milliseconds(deadline_milliseconds));
      control_.hurry = deadline_->passed();
    }
    control_.stop = stop_.get_token();
    if (control == nullptr) return;
    if (control->cancel != nullptr) control->cancel->has_map = false;
    control_.progress = [this, control](const isomatch::Progress& progress) {
      if (control->cancel != nullptr) {
        control->cancel->has_map = progress.has_map;
      }
      if (control->progress == nullptr) return;
      const int ends =
          control->progress(control->user, isomatch::StageName(progress.stage),
                            progress.stage_fraction, progress.total_fraction);
      if (ends != 0) stop_.request_stop();
    };
    if (control->cancel != nullptr) {
      passes_on_.emplace(control->cancel->stop.get_token(),
                         [this] { stop_.request_stop(); });
    }
  }
  Control(const Control&) = delete;
  Control& operator=(const Control&) = delete;

  const MatchControl& get() const { return control_; }

 private:
  std::stop_source stop_;
  MatchControl control_;
  std::optional<DeadlineTimer> deadline_;
  std::optional<std::stop_callback<std::function<void()>>> passes_on_;
};

/// Of meshes both at once, as Match does, which plans for a memory limit.
absl::StatusOr<Correspondence> Match(ShapeSource x, ShapeSource y,
                                     const std::vector<Landmark>& landmarks,
                                     const MatchOptions& options,
                                     const Control& control) {
  const auto* const mesh_x = std::get_if<SharedMesh>(&x);
  const auto* const mesh_y = std::get_if<SharedMesh>(&y);
  if (mesh_x != nullptr && mesh_y != nullptr) {
    return isomatch::Match(**mesh_x, **mesh_y, landmarks, options,
                           control.get());
  }
  isomatch::JoinedProgress joined(control.get().progress);
  ISOMATCH_ASSIGN_OR_RETURN(
      isomatch::PreparedPair pair,
      isomatch::PrepareBoth(std::move(x), std::move(y), options,
                            control.get().With(joined.OfPreparation())));
  return isomatch::MatchPrepared(std::move(pair.x), std::move(pair.y),
                                 landmarks, options,
                                 control.get().With(joined.OfMatching()));
}

std::unique_ptr<isomatch_result> ResultOf(Correspondence found,
                                          const isomatch::Matched& matched,
                                          const MatchOptions& options) {
  auto result = std::make_unique<isomatch_result>();
  result->report = isomatch::FormatReport(found, matched, options);
  for (const isomatch::PrecisePoint& point : found.precise) {
    result->precise_vertices.insert(result->precise_vertices.end(),
                                    point.vertices.begin(),
                                    point.vertices.end());
    result->precise_weights.insert(result->precise_weights.end(),
                                   point.weights.begin(), point.weights.end());
  }
  const Eigen::MatrixXd& matrix = found.functional_map;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
      result->functional_map.push_back(matrix(row, column));
    }
  }
  const auto add = [&](const char* of,
                       const std::vector<std::string>& warnings) {
    for (const std::string& text : warnings) {
      result->warnings.push_back(absl::StrCat(of, text));
    }
  };
  add("mesh_x: ", found.warnings_x);
  add("mesh_y: ", found.warnings_y);
  add("", found.warnings);
  result->found = std::move(found);
  return result;
}

absl::Status SetInteger(isomatch_options& all, absl::string_view name,
                        std::int64_t value) {
  MatchOptions& options = all.options;
  const auto within = [&](std::int64_t least, std::int64_t most) {
    if (value >= least && value <= most) return absl::OkStatus();
    return Invalid(absl::StrCat("options.", name),
                   absl::StrCat(value, ", expected ", least, " to ", most));
  };
  constexpr std::int64_t kAny = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t kMostMilliseconds = std::int64_t{30} * 24 * 3600000;
  constexpr std::int64_t kInt = std::numeric_limits<int>::max();
  if (name == "random_seed") {
    ISOMATCH_RETURN_IF_ERROR(within(0, kAny));
    options.random_seed = static_cast<std::uint64_t>(value);
  } else if (name == "threads") {
    ISOMATCH_RETURN_IF_ERROR(within(0, kInt));
    options.threads = static_cast<int>(value);
  } else if (name == "memory_limit_bytes") {
    ISOMATCH_RETURN_IF_ERROR(within(0, kAny));
    options.memory_limit_bytes = value;
  } else if (name == "solved_vertices") {
    ISOMATCH_RETURN_IF_ERROR(within(0, kInt));
    options.solved_vertices = static_cast<int>(value);
  } else if (name == "deadline_milliseconds") {
    ISOMATCH_RETURN_IF_ERROR(within(0, kMostMilliseconds));
    all.deadline_milliseconds = value;
  } else if (name == "match_components") {
    ISOMATCH_RETURN_IF_ERROR(within(0, 1));
    options.match_components = value != 0;
  } else if (name == "landmarks_exact") {
    ISOMATCH_RETURN_IF_ERROR(within(0, 1));
    options.landmarks_exact = value != 0;
  } else if (name == "keep_functional_map") {
    ISOMATCH_RETURN_IF_ERROR(within(0, 1));
    options.keep_functional_map = value != 0;
  } else {
    return Invalid(absl::StrCat("options.", name),
                   "there is no such whole number, expected random_seed, "
                   "threads, memory_limit_bytes, solved_vertices, "
                   "deadline_milliseconds, "
                   "match_components, landmarks_exact or keep_functional_map");
  }
  return options.Validate();
}

/// The profile's own constants; what else was set stays.
absl::Status SetProfile(MatchOptions& options, absl::string_view value) {
  if (value != "default" && value != "paper") {
    return Invalid("options.profile", absl::StrCat("'", value,
                                                   "', expected default or "
                                                   "paper"));
  }
  const MatchOptions old = options;
  options =
      MatchOptions::ForProfile(value == "paper" ? isomatch::Profile::kPaper
                                                : isomatch::Profile::kDefault);
  options.random_seed = old.random_seed;
  options.threads = old.threads;
  options.memory_limit_bytes = old.memory_limit_bytes;
  options.landmarks_exact = old.landmarks_exact;
  options.keep_functional_map = old.keep_functional_map;
  options.relation = old.relation;
  options.scale = old.scale;
  return absl::OkStatus();
}

/// "a, b or c". REQUIRES: at least one.
std::string AnyOf(const std::vector<std::string>& names) {
  if (names.size() == 1) return names.front();
  return absl::StrCat(absl::StrJoin(names.begin(), names.end() - 1, ", "),
                      " or ", names.back());
}

/// Sets `member` to `found`, what `name` is the name of, if it is one of
/// `known`.
template <typename Value>
absl::Status SetNamed(absl::string_view field, absl::string_view name,
                      std::optional<Value> found,
                      const std::vector<std::string>& known, Value& member) {
  if (!found) {
    return Invalid(absl::StrCat("options.", field),
                   absl::StrCat("'", name, "', expected ", AnyOf(known)));
  }
  member = *found;
  return absl::OkStatus();
}

/// Whether relation and scale go together is checked where they are used, so
/// that their order does not matter.
absl::Status SetText(MatchOptions& options, absl::string_view name,
                     absl::string_view value) {
  if (name == "profile") return SetProfile(options, value);
  if (name == "relation") {
    return SetNamed(name, value, isomatch::RelationOf(value),
                    isomatch::RelationNames(), options.relation);
  }
  if (name == "scale") {
    return SetNamed(name, value, isomatch::LengthScaleOf(value),
                    isomatch::LengthScaleNames(), options.scale);
  }
  return Invalid(absl::StrCat("options.", name),
                 "there is no such text, expected profile, relation or scale");
}

}  // namespace

const char* isomatch_version() { return isomatch::kVersion; }

isomatch_status isomatch_error_status(const isomatch_error* error) {
  return error == nullptr ? ISOMATCH_OK : error->status;
}

const char* isomatch_error_message(const isomatch_error* error) {
  // A call that had no memory for an error leaves none.
  return error == nullptr ? "out of memory" : error->message.c_str();
}

const char* isomatch_error_field(const isomatch_error* error) {
  return error == nullptr ? "" : error->field.c_str();
}

void isomatch_error_free(isomatch_error* error) { delete error; }

isomatch_options* isomatch_options_new() {
  try {
    return new isomatch_options;
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}

isomatch_status isomatch_options_set_integer(isomatch_options* options,
                                             const char* name,
                                             std::int64_t value,
                                             isomatch_error** error) {
  return Guarded(error, [&]() -> absl::Status {
    isomatch_options changed = *options;
    ISOMATCH_RETURN_IF_ERROR(SetInteger(changed, name, value));
    *options = std::move(changed);
    return absl::OkStatus();
  });
}

isomatch_status isomatch_options_set_text(isomatch_options* options,
                                          const char* name, const char* value,
                                          isomatch_error** error) {
  return Guarded(error, [&]() -> absl::Status {
    MatchOptions changed = options->options;
    ISOMATCH_RETURN_IF_ERROR(SetText(changed, name, value));
    options->options = std::move(changed);
    return absl::OkStatus();
  });
}

void isomatch_options_free(isomatch_options* options) { delete options; }

isomatch_cancel* isomatch_cancel_new() {
  try {
    return new isomatch_cancel;
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}

void isomatch_cancel_request(isomatch_cancel* cancel) {
  cancel->stop.request_stop();
}

int isomatch_cancel_has_map(const isomatch_cancel* cancel) {
  return cancel->has_map ? 1 : 0;
}

void isomatch_cancel_free(isomatch_cancel* cancel) { delete cancel; }

isomatch_status isomatch_estimate_bytes(const isomatch_sizes* sizes,
                                        const isomatch_options* options,
                                        std::int64_t* bytes,
                                        isomatch_error** error) {
  return Guarded(error, [&]() -> absl::Status {
    for (const auto& [count, name] :
         {std::pair(sizes->vertices_x, "vertices_x"),
          std::pair(sizes->faces_x, "faces_x"),
          std::pair(sizes->vertices_y, "vertices_y"),
          std::pair(sizes->faces_y, "faces_y")}) {
      if (count < 0 || count > kMostElements) {
        return Invalid(name,
                       absl::StrCat(count, ", expected 0 to ", kMostElements));
      }
    }
    *bytes =
        isomatch::EstimateMemoryBytes({sizes->vertices_x, sizes->faces_x},
                                      {sizes->vertices_y, sizes->faces_y},
                                      /*num_landmarks=*/0, OptionsOf(options));
    return absl::OkStatus();
  });
}

isomatch_status isomatch_prepare(const isomatch_mesh* mesh,
                                 const isomatch_options* options,
                                 const isomatch_control* control,
                                 isomatch_shape** shape,
                                 isomatch_error** error) {
  *shape = nullptr;
  return Guarded(error, [&]() -> absl::Status {
    const Control follow(control);
    ISOMATCH_ASSIGN_OR_RETURN(TriangleMesh own, MeshOf(mesh, "mesh"));
    const isomatch::MeshSize size = isomatch::SizeOf(own);
    ISOMATCH_ASSIGN_OR_RETURN(
        PreparedShape prepared,
        isomatch::Prepare(std::move(own), OptionsOf(options), follow.get()));
    *shape = new isomatch_shape{std::move(prepared), size};
    return absl::OkStatus();
  });
}

void isomatch_shape_free(isomatch_shape* shape) { delete shape; }

isomatch_status isomatch_match(const isomatch_pair* pair,
                               const isomatch_options* options,
                               const isomatch_control* control,
                               isomatch_result** result,
                               isomatch_error** error) {
  *result = nullptr;
  return Guarded(error, [&]() -> absl::Status {
    ISOMATCH_ASSIGN_OR_RETURN(const std::int64_t deadline, DeadlineOf(options));
    const Control follow(control, deadline);
    ISOMATCH_ASSIGN_OR_RETURN(ShapeSource x,
                              SourceOf(pair->mesh_x, pair->shape_x, "x"));
    ISOMATCH_ASSIGN_OR_RETURN(ShapeSource y,
                              SourceOf(pair->mesh_y, pair->shape_y, "y"));
    ISOMATCH_ASSIGN_OR_RETURN(const std::vector<Landmark> known,
                              LandmarksOf(*pair));
    const isomatch::Matched matched = {SizeOf(pair->mesh_x, pair->shape_x),
                                       SizeOf(pair->mesh_y, pair->shape_y),
                                       known};
    ISOMATCH_ASSIGN_OR_RETURN(
        Correspondence found,
        Match(std::move(x), std::move(y), known, OptionsOf(options), follow));
    *result = ResultOf(std::move(found), matched, OptionsOf(options)).release();
    return absl::OkStatus();
  });
}
