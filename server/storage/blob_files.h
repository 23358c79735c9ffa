#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// The file of a blob.
struct FoundBlob {
  BlobKey key;
  std::int64_t bytes = 0;
  std::filesystem::file_time_type written;
};

using OnUnreadable =
    std::function<void(const std::string& folder, const std::string& why)>;

/// Returns the blobs in the files FOLDER/TENANT/AB/SHA256, those written first
/// before others; what else is there is left alone. Told once of each folder
/// below that cannot be read: its blobs are left out. UNAVAILABLE: the folder
/// itself cannot be.
absl::StatusOr<std::vector<FoundBlob>> FindBlobs(
    const std::string& folder, const OnUnreadable& on_unreadable);

}  // namespace isomatch
