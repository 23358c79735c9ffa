#pragma once

#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_split.h"
#include "server/logging/log.h"

namespace isomatch {

/// Takes the log of the process, from `level` on, while it lives.
class CapturedLog {
 public:
  explicit CapturedLog(LogFormat format,
                       spdlog::level::level_enum level = spdlog::level::debug)
      : before_(spdlog::default_logger()) {
    const auto sink = std::make_shared<spdlog::sinks::ostream_sink_mt>(out_);
    auto logger = std::make_shared<spdlog::logger>("captured", sink);
    logger->set_level(level);
    InstallLogger(std::move(logger), format);
  }
  ~CapturedLog() { InstallLogger(before_, LogFormat::kText); }

  /// REQUIRES: nobody logs at the same time.
  std::string text() const { return out_.str(); }

  /// Every line, which must be JSON.
  std::vector<nlohmann::json> lines() const {
    std::vector<nlohmann::json> parsed;
    for (const auto line : absl::StrSplit(text(), '\n', absl::SkipEmpty())) {
      parsed.push_back(nlohmann::json::parse(std::string(line)));
    }
    return parsed;
  }

 private:
  const std::shared_ptr<spdlog::logger> before_;
  std::ostringstream out_;
};

}  // namespace isomatch
