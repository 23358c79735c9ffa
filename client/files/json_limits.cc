#include "client/files/json_limits.h"

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

using LimitedJson = nlohmann::json;

// Counts what goes by, and ends it where it is too much.
class JsonCounter : public LimitedJson::json_sax_t {
 public:
  explicit JsonCounter(const JsonLimits& limits) : limits_(limits) {}

  const std::optional<JsonFault>& fault() const { return fault_; }

  bool null() override { return Count(); }
  bool boolean(bool) override { return Count(); }
  bool number_integer(number_integer_t) override { return Count(); }
  bool number_unsigned(number_unsigned_t) override { return Count(); }
  bool number_float(number_float_t, const string_t&) override {
    return Count();
  }
  bool string(string_t&) override { return Count(); }
  bool binary(binary_t&) override { return Count(); }
  bool key(string_t&) override { return true; }
  bool start_object(std::size_t) override {
    ++objects_;
    return Enter();
  }
  bool start_array(std::size_t) override { return Enter(); }
  bool end_object() override { return Leave(); }
  bool end_array() override { return Leave(); }
  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::detail::exception& error) override {
    fault_ = {position, absl::StrCat("not JSON (", error.what(), ")")};
    return false;
  }

 private:
  bool Enter() {
    ++depth_;
    return Count();
  }
  bool Leave() {
    --depth_;
    return true;
  }
  bool Count() {
    ++values_;
    if (depth_ > limits_.depth) return TooMuch("is deeper than", limits_.depth);
    if (objects_ > limits_.objects) {
      return TooMuch("has more objects than", limits_.objects);
    }
    return values_ <= limits_.values ||
           TooMuch("has more values than", limits_.values);
  }
  bool TooMuch(const char* what, std::int64_t limit) {
    fault_ = {std::nullopt, absl::StrCat("the JSON ", what, " ", limit)};
    return false;
  }

  const JsonLimits limits_;
  int depth_ = 0;
  std::int64_t values_ = 0;
  std::int64_t objects_ = 0;
  std::optional<JsonFault> fault_;
};

}  // namespace

std::optional<JsonFault> CheckJsonText(absl::string_view text,
                                       const JsonLimits& limits) {
  JsonCounter counter(limits);
  LimitedJson::sax_parse(text, &counter);
  return counter.fault();
}

}  // namespace isomatch
