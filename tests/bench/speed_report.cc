#include "tests/bench/speed_report.h"

#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch::bench {
namespace {

constexpr const char* kFigures[] = {"wall_seconds", "cpu_seconds",
                                    "prepared_wall_seconds"};

constexpr const char* kSettings[] = {"profile", "threads", "instruction_set"};

std::string NameOf(const nlohmann::json& pair) {
  return absl::StrCat(pair.at("pair").get<std::string>(), ", ",
                      pair.at("vertices").get<int>());
}

/// The figures of both runs for a pair, or the mean.
std::string FiguresLine(const std::string& name, const nlohmann::json& now,
                        const nlohmann::json& before) {
  std::string line = absl::StrFormat("%-36s", name);
  for (const char* figure : kFigures) {
    const double a = now.at(figure);
    const double b = before.at(figure);
    absl::StrAppendFormat(&line, " %7.3f %7.3f %5.2f", a, b, a / b);
  }
  return line + "\n";
}

/// The pairs that both have, from each.
std::pair<nlohmann::json, nlohmann::json> CommonPairs(
    const nlohmann::json& now, const nlohmann::json& before) {
  std::map<std::string, nlohmann::json> earlier;
  for (const nlohmann::json& pair : before.at("pairs")) {
    earlier[NameOf(pair)] = pair;
  }
  auto common = std::pair(nlohmann::json::array(), nlohmann::json::array());
  for (const nlohmann::json& pair : now.at("pairs")) {
    const auto found = earlier.find(NameOf(pair));
    if (found == earlier.end()) continue;
    common.first.push_back(pair);
    common.second.push_back(found->second);
  }
  return common;
}

bool IsReport(const nlohmann::json& report) {
  if (!report.is_object() || !report.contains("pairs")) return false;
  for (const char* setting : kSettings) {
    if (!report.contains(setting)) return false;
  }
  for (const nlohmann::json& pair : report["pairs"]) {
    if (!pair.is_object() || !pair.contains("pair") ||
        !pair.contains("vertices") || !pair.contains("stages")) {
      return false;
    }
    for (const char* figure : kFigures) {
      if (!pair.contains(figure)) return false;
    }
  }
  return true;
}

}  // namespace

absl::StatusOr<nlohmann::json> ReadSpeedReport(const std::string& path) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string text,
                            ReadFile(path, "the kept run"));
  nlohmann::json report = nlohmann::json::parse(text, nullptr, false);
  if (!IsReport(report)) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": expected what `speed --out` writes, found something else"));
  }
  return report;
}

nlohmann::json MeanOfPairs(const nlohmann::json& pairs) {
  nlohmann::json mean;
  const auto count = static_cast<double>(pairs.size());
  const auto add = [&](double value, nlohmann::json* sum) {
    *sum = sum->is_null() ? value / count : sum->get<double>() + value / count;
  };
  for (const nlohmann::json& pair : pairs) {
    for (const char* figure : kFigures) add(pair.at(figure), &mean[figure]);
    for (const auto& [stage, figures] : pair.at("stages").items()) {
      for (const char* figure : {"wall_seconds", "cpu_seconds"}) {
        add(figures.at(figure), &mean["stages"][stage][figure]);
      }
    }
  }
  return mean;
}

std::string ComparisonText(const nlohmann::json& now,
                           const nlohmann::json& before) {
  std::string text;
  for (const char* setting : kSettings) {
    if (now.at(setting) == before.at(setting)) continue;
    absl::StrAppend(&text, "not alike: ", setting, " ", now.at(setting).dump(),
                    ", before ", before.at(setting).dump(), "\n");
  }
  const auto [pairs, earlier] = CommonPairs(now, before);
  if (pairs.empty()) return text + "the kept run has none of these pairs\n";
  absl::StrAppendFormat(&text, "%-36s %-21s %-21s %-21s\n%-36s", "", " wall s",
                        " processor s", " prepared s", "pair");
  for (int i = 0; i < 3; ++i) {
    absl::StrAppendFormat(&text, " %7s %7s %5s", "now", "before", "x");
  }
  text += "\n";
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    text += FiguresLine(NameOf(pairs[i]), pairs[i], earlier[i]);
  }
  const nlohmann::json mean = MeanOfPairs(pairs);
  const nlohmann::json mean_before = MeanOfPairs(earlier);
  text +=
      FiguresLine(absl::StrCat("mean of ", pairs.size()), mean, mean_before);
  for (const auto& [stage, figures] : mean["stages"].items()) {
    if (!mean_before["stages"].contains(stage)) continue;
    absl::StrAppendFormat(&text, "  %-34s", stage);
    for (const char* figure : {"wall_seconds", "cpu_seconds"}) {
      const double a = figures.at(figure);
      const double b = mean_before["stages"][stage].at(figure);
      absl::StrAppendFormat(&text, " %7.3f %7.3f %5.2f", a, b, a / b);
    }
    text += "\n";
  }
  return text;
}

}  // namespace isomatch::bench
