#include "server/logging/log.h"

#include <algorithm>
#include <atomic>
#include <utility>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "absl/strings/ascii.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace isomatch {
namespace {

std::atomic<LogFormat> log_format = LogFormat::kText;

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

std::string OneLine(absl::string_view text) {
  std::string line(text);
  std::replace_if(line.begin(), line.end(), absl::ascii_iscntrl, ' ');
  return line;
}

std::string JsonLine(LogLevel level, absl::string_view message,
                     const LogFields& fields) {
  nlohmann::ordered_json line;
  line["time"] = absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::Now(),
                                  absl::UTCTimeZone());
  const auto name = spdlog::level::to_string_view(ToSpdlog(level));
  line["level"] = std::string(name.data(), name.size());
  line["message"] = OneLine(message);
  for (const LogField& field : fields) {
    std::visit(
        [&](const auto& value) {
          line.emplace(std::string(field.name), value);
        },
        field.value);
  }
  // Bytes that are no UTF-8 become U+FFFD instead of an exception.
  return line.dump(/*indent=*/-1, ' ', /*ensure_ascii=*/false,
                   nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace

bool ShouldLog(LogLevel level) { return spdlog::should_log(ToSpdlog(level)); }

void Log(LogLevel level, absl::string_view message, const LogFields& fields) {
  if (!ShouldLog(level)) return;
  const bool is_json = log_format == LogFormat::kJson;
  const std::string line =
      is_json ? JsonLine(level, message, fields) : OneLine(message);
  spdlog::default_logger_raw()->log(ToSpdlog(level), line);
}

void InstallLogger(std::shared_ptr<spdlog::logger> logger, LogFormat format) {
  const bool is_json = format == LogFormat::kJson;
  logger->set_pattern(is_json ? "%v" : "%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
  log_format = format;
  spdlog::set_default_logger(std::move(logger));
}

void SetUpLog(const std::string& level, LogFormat format) {
  auto logger = spdlog::stderr_color_mt("isomatch-server");
  logger->set_level(spdlog::level::from_str(level));
  InstallLogger(std::move(logger), format);
}

}  // namespace isomatch
