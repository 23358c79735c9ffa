#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "absl/strings/string_view.h"

namespace spdlog {
class logger;
}

namespace isomatch {

enum class LogLevel {
  kDebug,    ///< every call; for those who look for a fault
  kInfo,     ///< what the operator of a healthy server wants to see
  kWarning,  ///< something failed, the server goes on
  kError,    ///< the server does not do what it should
};

/// A value that machines read beside the message. Names are lower-case words
/// joined by "_"; "time", "level" and "message" are taken.
struct LogField {
  absl::string_view name;
  std::variant<std::string, std::int64_t, double> value;
};
using LogFields = std::vector<LogField>;

/// True when lines of this level are written.
bool ShouldLog(LogLevel level);

/// Writes one line. `message` tells people all that matters; `fields` are in
/// the line when it is JSON. Neither may hold keys or the content of meshes.
/// Whatever bytes they have, a line stays one line, and a JSON line stays
/// valid. Thread-safe.
void Log(LogLevel level, absl::string_view message,
         const LogFields& fields = {});

/// What the lines look like.
enum class LogFormat {
  kText,  ///< time, level, message, for a person
  kJson,  ///< one object a line: time (UTC), level, message, fields
};

/// From now on lines go to `logger`, from its level on. For the whole process.
void InstallLogger(std::shared_ptr<spdlog::logger> logger, LogFormat format);

/// From now on the log goes to standard error, from `level` on: a name that
/// ServerConfig::log_level may have. For the whole process.
void SetUpLog(const std::string& level, LogFormat format);

}  // namespace isomatch
