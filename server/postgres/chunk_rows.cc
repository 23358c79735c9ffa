#include "server/postgres/chunk_rows.h"

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

/// Returns the value of a lower-case hexadecimal digit.
unsigned ValueOf(char digit) {
  return static_cast<unsigned char>(digit <= '9' ? digit - '0'
                                                 : digit - 'a' + 10);
}

void AppendHex(absl::string_view digits, std::string& bytes) {
  size_t at = bytes.size();
  bytes.resize(at + digits.size() / 2);
  for (size_t i = 0; i + 1 < digits.size(); i += 2) {
    bytes[at++] =
        static_cast<char>(ValueOf(digits[i]) * 16 + ValueOf(digits[i + 1]));
  }
}

}  // namespace

int CountChunks(std::int64_t bytes) {
  return static_cast<int>((bytes + kChunkBytes - 1) / kChunkBytes);
}

void InsertChunks(pqxx::work& transaction, const char* table,
                  const BlobKey& key, absl::string_view bytes,
                  std::size_t begin) {
  constexpr size_t kPiece = size_t{kChunkBytes} * kChunksAtOnce;
  for (; begin < bytes.size(); begin += kPiece) {
    const absl::string_view piece = bytes.substr(begin, kPiece);
    transaction.exec_params(
        absl::StrCat(
            "INSERT INTO ", table,
            " (tenant, sha256, index, content) SELECT $1, $2, $3::int + i, "
            "substr($4::bytea, i * $5::int + 1, $5::int) "
            "FROM generate_series(0, $6::int - 1) AS i"),
        key.tenant, key.sha256, static_cast<int>(begin / kChunkBytes),
        pqxx::binarystring(piece.data(), piece.size()), kChunkBytes,
        CountChunks(static_cast<std::int64_t>(piece.size())));
  }
}

void AppendChunks(pqxx::transaction_base& transaction, const char* table,
                  const BlobKey& key, int first, std::string& bytes) {
  // Hexadecimal digits whatever the database's bytea_output is: libpqxx cannot
  // ask for binary results.
  const pqxx::result rows = transaction.exec_params(
      absl::StrCat("SELECT encode(content, 'hex') FROM ", table,
                   " WHERE tenant = $1 AND sha256 = $2 AND index >= $3 "
                   "AND index < $4 ORDER BY index"),
      key.tenant, key.sha256, first, first + kChunksAtOnce);
  for (const pqxx::row& row : rows) {
    AppendHex({row[0].c_str(), row[0].size()}, bytes);
  }
}

}  // namespace isomatch
