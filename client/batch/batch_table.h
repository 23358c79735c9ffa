#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/batch/batch_record.h"

namespace isomatch {

enum class BatchState {
  /// Not reached, as the batch was stopped before.
  kWaiting,
  kDone,
  /// Done by a run before this one.
  kKept,
  kFailed,
};

/// What is to be told about one pair of a batch.
struct BatchRow {
  std::string x;
  std::string y;
  BatchState state = BatchState::kWaiting;
  /// Why it failed.
  std::string message;

  // What follows is set only for pairs that are done.

  std::int64_t vertices_x = 0;
  std::int64_t vertices_y = 0;
  double seconds = 0;
  double geodesic_distortion = 0;
  double coverage = 0;
  double mean_confidence = 0;
  double symmetry_confidence = 0;
  double orientation_score = 0;
  /// As VerdictLabel; empty in reports of versions that did not judge.
  std::string verdict;
  std::optional<BatchError> error;
};

/// Sets the figures of `row` from a record that has a report.
void SetFigures(const BatchRecord& record, BatchRow* row);

/// A table for people, with a last line that sums it up.
std::string FormatBatchTable(const std::vector<BatchRow>& rows);

/// The same figures as comma-separated values, a line for each pair.
std::string FormatBatchCsv(const std::vector<BatchRow>& rows);

/// And as JSON, an object in a line for each pair.
std::string FormatBatchJson(const std::vector<BatchRow>& rows);

}  // namespace isomatch
