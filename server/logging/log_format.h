#pragma once

#include <memory>
#include <string>

#include <spdlog/formatter.h>
#include <spdlog/logger.h>

#include "server/logging/log.h"

namespace isomatch {

/// Returns message and fields in the one string that spdlog carries, to be
/// taken apart by the formatter of JSON.
std::string EncodeLogPayload(absl::string_view message,
                             const LogFields& fields);

/// Returns what writes lines of this format. Whatever bytes a message has, a
/// line stays one line, and a JSON line stays valid.
std::unique_ptr<spdlog::formatter> MakeLogFormatter(LogFormat format);

/// From now on Log, and spdlog itself, writes to `logger` in this format.
void InstallLogger(std::shared_ptr<spdlog::logger> logger, LogFormat format);

}  // namespace isomatch
