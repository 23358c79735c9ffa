#pragma once

#include "absl/strings/string_view.h"

namespace isomatch {

/// Returns what a figure of a page means, in a sentence or two, by the label
/// that it has in a FigureTable ("verdict" among them). Empty for a label that
/// explains itself, such as the stages of a run.
absl::string_view Explanation(absl::string_view label);

}  // namespace isomatch
