#pragma once

#include <atomic>
#include <cstdint>

#include "absl/status/statusor.h"

namespace isomatch {

/// Shares a fixed number of bytes among those who reserve them first.
///
///   1. reserved_bytes() never exceeds total_bytes().
///   2. A reservation gives back exactly what it took, once, when it goes.
///   3. What is reserved of a part of a budget is reserved of the whole too.
///
/// Thread-safe, without a lock. Must outlive its reservations.
class MemoryBudget {
 public:
  /// Bytes taken from a budget until this object goes. Movable.
  class Reservation {
   public:
    Reservation() = default;
    Reservation(Reservation&& other) noexcept;
    Reservation& operator=(Reservation&& other) noexcept;
    ~Reservation();

    std::int64_t bytes() const { return bytes_; }

    /// Gives back what is above `bytes`; nothing when that is all or more.
    void ShrinkTo(std::int64_t bytes);

    /// Takes over what `other` holds. REQUIRES: both are of one budget.
    void Merge(Reservation other);

   private:
    friend class MemoryBudget;
    Reservation(MemoryBudget* budget, std::int64_t bytes)
        : budget_(budget), bytes_(bytes) {}

    MemoryBudget* budget_ = nullptr;
    std::int64_t bytes_ = 0;
  };

  /// A part of `whole`, unless that is null. REQUIRES: total_bytes >= 0.
  explicit MemoryBudget(std::int64_t total_bytes, MemoryBudget* whole = nullptr)
      : total_bytes_(total_bytes), whole_(whole) {}

  /// Returns the reservation. RESOURCE_EXHAUSTED: not now, others have too
  /// much; FAILED_PRECONDITION: never, it is more than the whole budget.
  /// REQUIRES: bytes >= 0.
  absl::StatusOr<Reservation> Reserve(std::int64_t bytes);

  std::int64_t total_bytes() const { return total_bytes_; }
  std::int64_t reserved_bytes() const { return reserved_bytes_; }

 private:
  /// False when there is no room.
  bool Take(std::int64_t bytes);
  void GiveBack(std::int64_t bytes);

  const std::int64_t total_bytes_;
  MemoryBudget* const whole_;
  std::atomic<std::int64_t> reserved_bytes_ = 0;
};

}  // namespace isomatch
