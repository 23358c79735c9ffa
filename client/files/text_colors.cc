#include "client/files/text_colors.h"

#include <algorithm>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "client/files/word_cursor.h"

namespace isomatch {

void TextColors::Add(absl::Span<const absl::string_view> words, int line) {
  if (soup_->color_fault) return;
  if (words.size() < 3) {
    ++without_;
    return;
  }
  std::array<double, 3>& color = soup_->colors.emplace_back();
  for (std::size_t channel = 0; channel < color.size(); ++channel) {
    const absl::string_view word = words[channel];
    if (!ReadFinite(word, &color[channel]) || color[channel] < 0) {
      soup_->color_fault = {absl::StrCat("line ", line),
                            absl::StrCat("a vertex's color is ", Quoted(word),
                                         ", expected a number of 0 or more")};
      return;
    }
    largest_ = std::max(largest_, color[channel]);
    has_fractions_ |= word.find_first_of(".eE") != absl::string_view::npos;
  }
}

void TextColors::Finish(double unit) {
  const std::size_t colored = soup_->colors.size();
  if (colored == 0 || soup_->color_fault) return;
  if (without_ > 0) {
    soup_->color_fault = {
        "", absl::StrCat(without_, " of ", without_ + colored,
                         " vertices have no color, expected all or none")};
  }
  for (std::array<double, 3>& color : soup_->colors) {
    for (double& channel : color) channel /= unit;
  }
}

}  // namespace isomatch
