#include "client/batch/batch_runner.h"

#include <algorithm>
#include <exception>
#include <filesystem>
#include <numeric>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "client/api/rpc_status.h"
#include "client/files/input_file.h"
#include "client/files/map_file.h"
#include "client/files/mesh_input.h"
#include "client/files/text_file.h"
#include "client/job/map_errors.h"
#include "client/job/match_files.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

// Everything beside the files that decides what a map is.
std::string MapOptions(const JobOptions& job) {
  return absl::StrCat(
      job.profile, "\n", job.random_seed, "\n", job.landmarks_exact, "\n",
      job.solved_vertices ? absl::StrCat(*job.solved_vertices) : "default",
      job.memory_limit_bytes > 0 ? absl::StrCat("\n", job.memory_limit_bytes)
                                 : "",
      job.deadline < absl::InfiniteDuration()
          ? absl::StrCat("\ndeadline ", absl::FormatDuration(job.deadline))
          : "",
      job.relation == "whole"
          ? ""
          : absl::StrCat("\n", job.relation, " ", job.scale),
      job.weld.empty() ? "" : absl::StrCat("\nweld ", job.weld));
}

// The server has no room for another job now, but will have.
bool IsFull(const absl::Status& status) {
  const std::string reason = ErrorReason(status);
  return reason == "QUEUE_FULL" || reason == "TENANT_QUOTA";
}

// What other pairs of this batch need is in the way.
bool IsInTheWay(const absl::Status& status) {
  const std::string reason = ErrorReason(status);
  return reason == "STORAGE_QUOTA" || reason == "UPLOAD_QUOTA" ||
         reason == "MESH_MISSING";
}

// No other pair would do better.
bool EndsTheBatch(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsUnauthenticated(status) ||
         absl::IsPermissionDenied(status);
}

absl::StatusOr<BatchError> MeasureError(const BatchPair& pair,
                                        const std::string& weld,
                                        const BatchRecord& record,
                                        const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const LoadedMesh y,
                            LoadMeshFile(pair.y, "Y", weld));
  ISOMATCH_ASSIGN_OR_RETURN(const VertexMap found,
                            ReadMap(record.map_path(), y.mesh.num_vertices()));
  ISOMATCH_ASSIGN_OR_RETURN(
      const MapErrors errors,
      MeasureAgainstTruth({found}, y.mesh, pair.truth, stop));
  const double direct = errors.direct.mean_over_diameter;
  BatchError error = {direct, direct};
  if (errors.mirrored) {
    error.best = std::min(direct, errors.mirrored->mean_over_diameter);
  }
  return error;
}

std::string Stem(const std::string& path) {
  return std::filesystem::path(WithoutGz(path)).stem().string();
}

}  // namespace

std::vector<BatchRow> BatchRunner::Run(const std::vector<BatchPair>& pairs,
                                       const std::stop_token& stop) {
  rows_.clear();
  for (const BatchPair& pair : pairs) {
    BatchRow row;
    row.x = Stem(pair.x);
    row.y = Stem(pair.y);
    rows_.push_back(std::move(row));
  }
  fractions_.assign(pairs.size(), 0);
  next_ = 0;
  is_over_ = false;
  summary_status_ = absl::OkStatus();
  progress_ = {};
  progress_.total = static_cast<int>(pairs.size());
  {
    std::vector<std::jthread> threads;
    threads.reserve(static_cast<std::size_t>(options_.parallel));
    for (int i = 0; i < options_.parallel; ++i) {
      threads.emplace_back([&] { RunLoop(pairs, stop); });
    }
  }
  return rows_;
}

void BatchRunner::RunLoop(const std::vector<BatchPair>& pairs,
                          const std::stop_token& stop) {
  while (true) {
    std::size_t index = 0;
    BatchRow row;
    {
      const std::lock_guard lock(mutex_);
      if (is_over_ || stop.stop_requested() || next_ == pairs.size()) return;
      index = next_++;
      row = rows_[index];
      ++progress_.running;
    }
    absl::Status status;
    try {
      status = RunPair(pairs[index], index, &row, stop);
    } catch (const std::exception& error) {  // a report that somebody changed
      status = absl::InternalError(error.what());
    }
    SetEnded(index, std::move(row), status, stop);
  }
}

absl::Status BatchRunner::RunPair(const BatchPair& pair, std::size_t index,
                                  BatchRow* row, const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(
      BatchRecord record,
      BatchRecord::Make(options_.folder, pair, MapOptions(options_.job),
                        options_.parts));
  const bool is_kept = !options_.force && record.Load();
  if (!is_kept) {
    ISOMATCH_RETURN_IF_ERROR(Match(pair, index, &record, stop));
  }
  if (!pair.truth.empty() && !record.error()) {
    ISOMATCH_ASSIGN_OR_RETURN(
        const BatchError error,
        MeasureError(pair, options_.job.weld, record, stop));
    ISOMATCH_RETURN_IF_ERROR(record.SaveError(error));
  }
  row->state = is_kept ? BatchState::kKept : BatchState::kDone;
  SetFigures(record, row);
  return absl::OkStatus();
}

absl::Status BatchRunner::Match(const BatchPair& pair, std::size_t index,
                                BatchRecord* record,
                                const std::stop_token& stop) {
  MatchRequest request;
  std::vector<std::string> warnings;
  ISOMATCH_ASSIGN_OR_RETURN(
      const FileOfY file_y,
      ReadMatchFiles({pair.x,
                      pair.y,
                      {pair.landmarks, pair.points_x, pair.points_y},
                      options_.job.weld},
                     &request, &warnings));
  SetJobOptions(options_.job, &request);
  if (options_.parts.precise) {
    request.parts.push_back(v1::RESULT_PART_PRECISE_MAP);
  }
  if (options_.parts.confidence) {
    request.parts.push_back(v1::RESULT_PART_CONFIDENCE);
  }
  if (options_.parts.mask_y) request.parts.push_back(v1::RESULT_PART_MASK_Y);
  const auto on_change = [&](const v1::Job& job) {
    const std::lock_guard lock(mutex_);
    fractions_[index] = job.progress().total_fraction();
    Tell();
  };
  Backoff backoff(stop, absl::InfiniteDuration());
  absl::StatusOr<MatchResult> result;
  bool others_run = false;
  do {
    others_run = OthersRun();  // before: they may end while this is refused
    result = client_->Match(request, on_change, stop);
  } while ((IsFull(result.status()) ||
            (IsInTheWay(result.status()) && others_run)) &&
           Wait(&backoff));
  if (!result.ok() && stop.stop_requested()) return Stopped();
  if (!result.ok()) return InFlagWords(result.status());
  return record->Save(*result, file_y.MeshIn(request), warnings);
}

bool BatchRunner::Wait(Backoff* backoff) {
  const auto count = [this](int change) {
    const std::lock_guard lock(mutex_);
    waiting_ += change;
  };
  count(1);
  const bool again = backoff->Again(absl::UnavailableError("no room"));
  count(-1);
  return again;
}

bool BatchRunner::OthersRun() {
  const std::lock_guard lock(mutex_);
  return progress_.running - waiting_ > 1;
}

void BatchRunner::SetEnded(std::size_t index, BatchRow row,
                           const absl::Status& status,
                           const std::stop_token& stop) {
  const std::lock_guard lock(mutex_);
  --progress_.running;
  if (absl::IsCancelled(status) && stop.stop_requested()) {
    fractions_[index] = 0;  // it waits for another run
    return Tell();
  }
  if (!status.ok()) {
    row.state = BatchState::kFailed;
    row.message = std::string(status.message());
    ++progress_.failed;
    is_over_ = is_over_ || EndsTheBatch(status);
  }
  rows_[index] = std::move(row);
  ++progress_.ended;
  fractions_[index] = 1;
  summary_status_.Update(WriteFileAtomically(
      absl::StrCat(options_.folder, "/summary.csv"), FormatBatchCsv(rows_)));
  // A full disk: the maps to come would not be written either.
  is_over_ = is_over_ || !summary_status_.ok();
  Tell();
}

void BatchRunner::Tell() {
  progress_.fraction =
      std::accumulate(fractions_.begin(), fractions_.end(), 0.0) /
      static_cast<double>(fractions_.size());
  on_progress_(progress_);
}

}  // namespace isomatch
