#pragma once

// Early return on errors, as everyone who uses absl::Status writes them; the
// packaged abseil has none.

#define ISOMATCH_RETURN_IF_ERROR(expression)                  \
  do {                                                        \
    if (absl::Status status_ = (expression); !status_.ok()) { \
      return status_;                                         \
    }                                                         \
  } while (false)

#define ISOMATCH_ASSIGN_OR_RETURN(declaration, expression)           \
  ISOMATCH_ASSIGN_OR_RETURN_(ISOMATCH_CONCAT_(status_or_, __LINE__), \
                             declaration, expression)

#define ISOMATCH_ASSIGN_OR_RETURN_(result, declaration, expression) \
  auto result = (expression);                          /* NOLINT */ \
  if (!result.ok()) return std::move(result).status(); /* NOLINT */ \
  declaration = *std::move(result)                     /* NOLINT: declares */

#define ISOMATCH_CONCAT_(a, b) ISOMATCH_CONCAT_INNER_(a, b)
#define ISOMATCH_CONCAT_INNER_(a, b) a##b
