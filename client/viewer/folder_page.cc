#include "client/viewer/folder_page.h"

#include <cstddef>

#include <nlohmann/json.hpp>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "client/viewer/page.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

Json EntryJson(const FolderEntry& entry) {
  Json figures = Json::object();
  for (const auto& [name, value] : entry.figures) figures[name] = value;
  return {{"name", entry.name},
          {"x", entry.x},
          {"y", entry.y},
          {"verdict", entry.verdict},
          {"reason", entry.reason},
          {"figures", std::move(figures)},
          {"failure", entry.failure},
          {"png", absl::Base64Escape(entry.png)},
          {"here", !entry.data.empty()},
          {"page", entry.page}};
}

/// In a script element: file names need not be UTF-8, and end no element.
std::string InScript(const Json& json) {
  return absl::StrReplaceAll(
      json.dump(-1, ' ', /*ensure_ascii=*/true, Json::error_handler_t::replace),
      {{"<", "\\u003c"}});
}

std::string DataElement(absl::string_view id, absl::string_view json) {
  return absl::StrCat("<script type=\"application/json\" id=\"", id, "\">",
                      json, "</script>\n");
}

}  // namespace

std::string FormatFolderPage(absl::string_view title,
                             const std::vector<FolderEntry>& entries) {
  Json pairs = Json::array();
  std::string data;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    pairs.push_back(EntryJson(entries[i]));
    if (entries[i].data.empty()) continue;
    absl::StrAppend(&data,
                    DataElement(absl::StrCat("data-", i), entries[i].data));
  }
  // What is shown of a pair is its page, put together when it is opened.
  if (!data.empty()) {
    absl::StrAppend(&data, DataElement("template", InScript(PageTemplate())));
  }
  const std::string head = InScript({{"title", title}, {"pairs", pairs}});
  return absl::StrReplaceAll(FolderTemplate(),
                             {{"<!--FOLDER-->", EscapeHtml(title)},
                              {"<!--LIST-->", head},
                              {"<!--DATA-->", data}});
}

}  // namespace isomatch
