#pragma once

#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// Gathers the colors of the vertices of a text: numbers after the coordinates
/// of a vertex, of all vertices or of none. What is wrong becomes the soup's
/// `color_fault`.
class TextColors {
 public:
  explicit TextColors(PolygonSoup* soup) : soup_(soup) {}

  /// Takes the color of the next vertex, the first three of the words that
  /// follow its coordinates on a line; with fewer it has none.
  void Add(absl::Span<const absl::string_view> words, int line);

  /// The largest number so far, and whether one was written as a fraction.
  double largest() const { return largest_; }
  bool has_fractions() const { return has_fractions_; }

  /// After the last vertex: `unit` is what the text writes for 1.
  void Finish(double unit);

 private:
  PolygonSoup* const soup_;
  VertexIndex without_ = 0;
  double largest_ = 0;
  bool has_fractions_ = false;
};

}  // namespace isomatch
