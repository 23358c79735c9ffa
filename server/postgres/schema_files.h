#pragma once

namespace isomatch {

/// A file of server/postgres/schema, compiled in.
struct SchemaFile {
  const char* name;  ///< "001_jobs"
  const char* sql;
  /// How many files a program must know at least to work with the tables once
  /// this one was applied; its first line says so.
  int oldest_program;
};

/// In the order in which they are applied: by the numbers of their names.
extern const SchemaFile kSchemaFiles[];
extern const int kNumSchemaFiles;

}  // namespace isomatch
