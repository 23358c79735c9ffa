#include "server/jobs/memory_budget.h"

#include <cassert>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/jobs/errors.h"

namespace isomatch {

MemoryBudget::Reservation::Reservation(Reservation&& other) noexcept
    : budget_(std::exchange(other.budget_, nullptr)),
      bytes_(std::exchange(other.bytes_, 0)) {}

MemoryBudget::Reservation& MemoryBudget::Reservation::operator=(
    Reservation&& other) noexcept {
  std::swap(budget_, other.budget_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

MemoryBudget::Reservation::~Reservation() {
  if (budget_ != nullptr) budget_->GiveBack(bytes_);
}

void MemoryBudget::Reservation::ShrinkTo(std::int64_t bytes) {
  assert(bytes >= 0);
  if (bytes >= bytes_) return;
  budget_->GiveBack(bytes_ - bytes);
  bytes_ = bytes;
}

void MemoryBudget::Reservation::Merge(Reservation other) {
  assert(budget_ == nullptr || other.budget_ == nullptr ||
         budget_ == other.budget_);
  if (budget_ == nullptr) budget_ = other.budget_;
  bytes_ += std::exchange(other.bytes_, 0);
}

absl::StatusOr<MemoryBudget::Reservation> MemoryBudget::Reserve(
    std::int64_t bytes) {
  assert(bytes >= 0);
  if (bytes > total_bytes_) {
    return JobNeedsMoreMemoryThanBudget(bytes, total_bytes_);
  }
  if (!Take(bytes)) {
    return absl::ResourceExhaustedError(
        absl::StrCat(bytes, " bytes do not fit beside the ", reserved_bytes(),
                     " reserved of ", total_bytes_));
  }
  return Reservation(this, bytes);
}

bool MemoryBudget::Take(std::int64_t bytes) {
  std::int64_t reserved = reserved_bytes_;
  do {
    if (bytes > total_bytes_ - reserved) return false;
  } while (!reserved_bytes_.compare_exchange_weak(reserved, reserved + bytes));
  if (whole_ == nullptr || whole_->Take(bytes)) return true;
  reserved_bytes_ -= bytes;
  return false;
}

void MemoryBudget::GiveBack(std::int64_t bytes) {
  reserved_bytes_ -= bytes;
  if (whole_ != nullptr) whole_->GiveBack(bytes);
}

}  // namespace isomatch
