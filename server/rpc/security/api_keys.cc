#include "server/rpc/security/api_keys.h"

#include <cassert>
#include <set>
#include <utility>

#include <openssl/crypto.h>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/rpc/security/small_file.h"

namespace isomatch {
namespace {

constexpr char kField[] = "--api-keys";
constexpr absl::Duration kCheckPeriod = absl::Seconds(1);
constexpr size_t kRandomBytes = 32;
// Tells people and scanners of leaked secrets what the text is.
constexpr char kKeyPrefix[] = "isomatch_";

absl::Status LineError(int line, absl::string_view expected) {
  return absl::InvalidArgumentError(
      absl::StrCat("line ", line, ", expected ", expected));
}

/// `max-priority=N`
std::optional<int> ParseMaxPriority(absl::string_view word) {
  int priority = 0;
  if (!absl::ConsumePrefix(&word, "max-priority=") ||
      !absl::SimpleAtoi(word, &priority) || priority < 0 ||
      priority > kMostPriority) {
    return std::nullopt;
  }
  return priority;
}

absl::StatusOr<ApiKey> ParseLine(int line,
                                 const std::vector<absl::string_view>& words,
                                 std::optional<int> max_priority) {
  constexpr size_t kLeastWords = 4;
  if (words.size() != kLeastWords && words.size() != kLeastWords + 1) {
    return LineError(line,
                     "name, tenant, role and SHA-256 of the key, then nothing "
                     "or max-priority=N");
  }
  if (!IsTenantName(words[0]) || !IsTenantName(words[1])) {
    return LineError(line,
                     "a name and a tenant of 1 to 63 of a-z, 0-9, - and _");
  }
  const std::optional<Role> role = ParseRole(words[2]);
  if (!role) return LineError(line, "a role: read, submit or admin");
  if (!IsSha256Hex(words[3])) {
    return LineError(line,
                     "as the fourth word the 64 lower-case hexadecimal digits "
                     "of the key's SHA-256, not the key");
  }
  if (words.size() > kLeastWords) max_priority = ParseMaxPriority(words[4]);
  if (!max_priority) {
    return LineError(line, "max-priority=N as the fifth word, N from 0 to 100");
  }
  return ApiKey{std::string(words[0]),
                {std::string(words[1]), *role, "", *max_priority},
                std::string(words[3])};
}

}  // namespace

absl::StatusOr<std::vector<ApiKey>> ParseApiKeys(absl::string_view text,
                                                 int max_priority) {
  std::vector<ApiKey> keys;
  std::set<std::string> names;
  std::set<std::string> hashes;
  int line = 0;
  for (absl::string_view row : absl::StrSplit(text, '\n')) {
    ++line;
    row = row.substr(0, row.find('#'));
    const std::vector<absl::string_view> words =
        absl::StrSplit(row, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (words.empty()) continue;
    ISOMATCH_ASSIGN_OR_RETURN(ApiKey key, ParseLine(line, words, max_priority));
    if (!names.insert(key.name).second || !hashes.insert(key.sha256).second) {
      return LineError(line, "a name and a key that no line before has");
    }
    keys.push_back(std::move(key));
  }
  if (keys.empty()) {
    return absl::InvalidArgumentError(
        "no key in it, expected a line `name tenant role sha256`");
  }
  return keys;
}

const ApiKey* FindApiKey(absl::Span<const ApiKey> keys, absl::string_view key) {
  const std::string sha256 = Sha256Hex(key);
  const ApiKey* found = nullptr;
  for (const ApiKey& candidate : keys) {
    const bool equal = CRYPTO_memcmp(candidate.sha256.data(), sha256.data(),
                                     sha256.size()) == 0;
    found = equal ? &candidate : found;
  }
  return found;
}

NewApiKey MakeApiKey(const std::string& name, const Caller& caller,
                     absl::string_view random_bytes) {
  assert(random_bytes.size() == kRandomBytes);
  assert(IsTenantName(name) && IsTenantName(caller.tenant));
  NewApiKey made;
  made.key = absl::StrCat(kKeyPrefix, absl::WebSafeBase64Escape(random_bytes));
  made.line = absl::StrCat(name, " ", caller.tenant, " ", RoleName(caller.role),
                           " ", Sha256Hex(made.key));
  return made;
}

ApiKeys::ApiKeys(std::string path, Clock now, OnReload on_reload,
                 int max_priority)
    : path_(std::move(path)),
      now_(std::move(now)),
      on_reload_(std::move(on_reload)),
      max_priority_(max_priority) {}

absl::StatusOr<std::unique_ptr<ApiKeys>> ApiKeys::Open(const std::string& path,
                                                       Clock now,
                                                       OnReload on_reload,
                                                       int max_priority) {
  State state = Load(path, max_priority);
  ISOMATCH_RETURN_IF_ERROR(state.keys.status());
  std::unique_ptr<ApiKeys> opened(
      new ApiKeys(path, std::move(now), std::move(on_reload), max_priority));
  const absl::Time checked = opened->now_();
  MutexLock lock(opened->mutex_);
  opened->keys_ = std::make_shared<const Keys>(*std::move(state.keys));
  opened->seen_ = std::move(state.seen);
  opened->checked_ = checked;
  return opened;
}

std::optional<Caller> ApiKeys::Find(absl::string_view key) {
  if (BeginCheck()) Check();
  std::shared_ptr<const Keys> keys;
  {
    MutexLock lock(mutex_);
    keys = keys_;
  }
  const ApiKey* found = FindApiKey(*keys, key);
  if (found == nullptr) return std::nullopt;
  return found->caller;
}

ApiKeys::State ApiKeys::Load(const std::string& path, int max_priority) {
  absl::StatusOr<std::string> text = ReadSmallFile(kField, path);
  if (!text.ok()) {
    return {std::string(text.status().message()), text.status()};
  }
  absl::StatusOr<Keys> keys = ParseApiKeys(*text, max_priority);
  if (keys.ok()) return {*std::move(text), std::move(keys)};
  return {*std::move(text),
          absl::InvalidArgumentError(absl::StrCat(kField, " = ", path, ": ",
                                                  keys.status().message()))};
}

/// True for the one caller that shall look at the file now.
bool ApiKeys::BeginCheck() {
  const absl::Time now = now_();
  MutexLock lock(mutex_);
  // The clock may have been set back.
  const bool fresh = now >= checked_ && now < checked_ + kCheckPeriod;
  if (fresh || checking_) return false;
  checked_ = now;
  checking_ = true;
  return true;
}

/// Reads the file and takes what is new. It is read whole, not only looked at:
/// two writes within one tick of the file system's clock look the same.
void ApiKeys::Check() {
  const absl::Cleanup end_check = [this] {
    MutexLock lock(mutex_);
    checking_ = false;
  };
  State state = Load(path_, max_priority_);
  const absl::Status loaded = state.keys.status();
  {
    MutexLock lock(mutex_);
    if (state.seen == seen_) return;
    seen_ = std::move(state.seen);
    if (loaded.ok()) {
      keys_ = std::make_shared<const Keys>(*std::move(state.keys));
    }
  }
  if (on_reload_) on_reload_(loaded);
}

}  // namespace isomatch
