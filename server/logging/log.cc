#include "server/logging/log.h"

#include <atomic>
#include <memory>
#include <utility>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "server/logging/log_format.h"

namespace isomatch {
namespace {

/// Whether the formatter of the default logger takes fields out of a payload.
std::atomic<bool> has_fields = false;

spdlog::level::level_enum ToSpdlog(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarning:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
  }
  return spdlog::level::err;
}

}  // namespace

void InstallLogger(std::shared_ptr<spdlog::logger> logger, LogFormat format) {
  logger->set_formatter(MakeLogFormatter(format));
  has_fields = format == LogFormat::kJson;
  spdlog::set_default_logger(std::move(logger));
}

bool ShouldLog(LogLevel level) { return spdlog::should_log(ToSpdlog(level)); }

void Log(LogLevel level, absl::string_view message, const LogFields& fields) {
  if (!ShouldLog(level)) return;
  spdlog::default_logger_raw()->log(
      ToSpdlog(level),
      has_fields ? EncodeLogPayload(message, fields) : std::string(message));
}

void SetUpLog(const std::string& level, LogFormat format) {
  auto logger = spdlog::stderr_color_mt("isomatch-server");
  logger->set_level(spdlog::level::from_str(level));
  InstallLogger(std::move(logger), format);
}

}  // namespace isomatch
