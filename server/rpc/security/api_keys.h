#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "absl/types/span.h"
#include "core/base/mutex.h"
#include "server/jobs/caller.h"

namespace isomatch {

/// One line of a key file. The key itself is nowhere, only its hash: whoever
/// reads the file cannot call with it. A plain SHA-256 is enough because keys
/// are 256 random bits, which nobody can guess at any speed.
struct ApiKey {
  std::string name;
  Caller caller;
  /// 64 lower-case hexadecimal digits.
  std::string sha256;
};

/// Returns the keys of a file: lines `name tenant role sha256`, and perhaps
/// `max-priority=N`, else it is `max_priority`; # starts a comment.
/// INVALID_ARGUMENT, naming the line and what was expected there, when
/// one is none, when a name or key comes twice, or when there is no key at all.
/// The message has no word of the file: one could be a key by mistake.
absl::StatusOr<std::vector<ApiKey>> ParseApiKeys(absl::string_view text,
                                                 int max_priority = 0);

/// Returns the entry of `key`, or null. Constant-time by construction: the
/// hash of `key` is compared with that of every entry, each comparison over
/// all digits (CRYPTO_memcmp), and none ends the search.
const ApiKey* FindApiKey(absl::Span<const ApiKey> keys, absl::string_view key);

/// A fresh key, and its line for the file.
struct NewApiKey {
  std::string key;
  std::string line;
};

/// Returns a key made of `random_bytes`. REQUIRES: 32 of them, from a
/// cryptographic source; `name` and caller.tenant pass IsTenantName.
NewApiKey MakeApiKey(const std::string& name, const Caller& caller,
                     absl::string_view random_bytes);

/// The keys of a file, which is read again when it has changed: at a call, at
/// most once a second. A file that is wrong or gone changes nothing: the keys
/// before stay. Thread-safe.
class ApiKeys {
 public:
  using Clock = std::function<absl::Time()>;
  /// Called once for each change of the file: OK when its keys are used now,
  /// else why the ones before are used on.
  using OnReload = std::function<void(const absl::Status&)>;

  /// INVALID_ARGUMENT: the file cannot be read or parsed.
  static absl::StatusOr<std::unique_ptr<ApiKeys>> Open(const std::string& path,
                                                       Clock now,
                                                       OnReload on_reload,
                                                       int max_priority = 0);

  /// Returns who calls with `key`; nullopt when nobody has it.
  std::optional<Caller> Find(absl::string_view key);

 private:
  using Keys = std::vector<ApiKey>;

  /// What the file was at one time.
  struct State {
    /// Its text, or why there is none; tells whether it has changed.
    std::string seen;
    absl::StatusOr<Keys> keys;
  };

  ApiKeys(std::string path, Clock now, OnReload on_reload, int max_priority);

  static State Load(const std::string& path, int max_priority);
  bool BeginCheck();
  void Check();

  const std::string path_;
  const Clock now_;
  const OnReload on_reload_;
  const int max_priority_;

  Mutex mutex_;
  std::shared_ptr<const Keys> keys_ ABSL_GUARDED_BY(mutex_);
  std::string seen_ ABSL_GUARDED_BY(mutex_);
  absl::Time checked_ ABSL_GUARDED_BY(mutex_);
  /// One thread reads the file; the others go on with the keys they know.
  bool checking_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace isomatch
