#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "server/storage/job_journal.h"

namespace isomatch {

/// A journal that survives as long as the test wants and fails when it says so.
class FakeJournal : public JobJournal {
 public:
  absl::Status Write(const std::vector<JobRecord>& records) override {
    if (during_write) during_write();
    if (!failure.ok()) return failure;
    for (const JobRecord& record : records) kept[record.id] = record;
    ++writes;
    return absl::OkStatus();
  }

  absl::Status Remove(const std::vector<std::string>& ids) override {
    if (!failure.ok()) return failure;
    if (removals_left == 0) return absl::ResourceExhaustedError("full");
    --removals_left;
    for (const std::string& id : ids) kept.erase(id);
    return absl::OkStatus();
  }

  void Settle() override { ++settled; }

  std::vector<JobRecord> Records() const {
    std::vector<JobRecord> records;
    for (const auto& [id, record] : kept) records.push_back(record);
    return records;
  }

  std::map<std::string, JobRecord> kept;
  absl::Status failure;
  /// What happens while the disk takes its time.
  std::function<void()> during_write;
  int writes = 0;
  int settled = 0;
  /// Until the disk is full for them too.
  int removals_left = 1000;
};

}  // namespace isomatch
