#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "client/files/polygon_soup.h"

namespace isomatch {

/// How the blocks of a VTK XML file are written.
struct VtpEncoding {
  bool is_big_endian = false;
  /// Of the numbers before a block: 4 or 8.
  std::size_t header_bytes = 4;
  bool is_zlib = false;
  /// The appended blocks are base64, else raw.
  bool is_appended_base64 = false;
  /// What follows the _ of AppendedData.
  absl::string_view appended;
};

/// Returns the bytes of one block, which begins at `text`: `expected` ones,
/// base64 or raw, packed by zlib or not. Memory is taken for no more than the
/// text can hold. On a fault `where` is empty.
std::optional<MeshFault> DecodeVtpBlock(absl::string_view text, bool is_base64,
                                        const VtpEncoding& encoding,
                                        std::size_t expected,
                                        std::string* bytes);

}  // namespace isomatch
