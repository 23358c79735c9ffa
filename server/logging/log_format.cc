#include "server/logging/log_format.h"

#include <algorithm>
#include <utility>

#include <spdlog/common.h>
#include <spdlog/details/log_msg.h>
#include <spdlog/pattern_formatter.h>
#include <nlohmann/json.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/time.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

/// Between the message and the JSON object of the fields: "unit separator".
constexpr char kSeparator = '\x1f';
constexpr char kTextPattern[] = "%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v";

/// Bytes that are no UTF-8 become U+FFFD instead of an exception.
std::string Dump(const Json& json) {
  return json.dump(/*indent=*/-1, ' ', /*ensure_ascii=*/false,
                   Json::error_handler_t::replace);
}

std::string OneLine(absl::string_view text) {
  std::string line(text);
  std::replace_if(line.begin(), line.end(), absl::ascii_iscntrl, ' ');
  return line;
}

absl::string_view ToView(spdlog::string_view_t view) {
  return {view.data(), view.size()};
}

class TextFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& line,
              spdlog::memory_buf_t& out) override {
    const std::string message = OneLine(ToView(line.payload));
    spdlog::details::log_msg text = line;
    text.payload = message;
    pattern_.format(text, out);
    line.color_range_start = text.color_range_start;
    line.color_range_end = text.color_range_end;
  }

  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<TextFormatter>();
  }

 private:
  spdlog::pattern_formatter pattern_{kTextPattern};
};

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& line,
              spdlog::memory_buf_t& out) override {
    const std::pair<absl::string_view, absl::string_view> payload =
        absl::StrSplit(ToView(line.payload), absl::MaxSplits(kSeparator, 1));
    Json head;
    head["time"] =
        absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", absl::FromChrono(line.time),
                         absl::UTCTimeZone());
    head["level"] = ToView(spdlog::level::to_string_view(line.level));
    head["message"] = OneLine(payload.first);
    std::string text = Dump(head);
    if (payload.second.size() > 2 && Json::accept(payload.second)) {
      text.back() = ',';
      absl::StrAppend(&text, payload.second.substr(1));
    }
    text += '\n';
    out.append(text.data(), text.data() + text.size());
  }

  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<JsonFormatter>();
  }
};

}  // namespace

std::string EncodeLogPayload(absl::string_view message,
                             const LogFields& fields) {
  Json json = Json::object();
  for (const LogField& field : fields) {
    std::visit(
        [&](const auto& value) { json[std::string(field.name)] = value; },
        field.value);
  }
  return absl::StrCat(OneLine(message), std::string(1, kSeparator), Dump(json));
}

std::unique_ptr<spdlog::formatter> MakeLogFormatter(LogFormat format) {
  if (format == LogFormat::kJson) return std::make_unique<JsonFormatter>();
  return std::make_unique<TextFormatter>();
}

}  // namespace isomatch
