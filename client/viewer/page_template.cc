#include <cstddef>

#include "client/viewer/folder_page.h"
#include "client/viewer/page.h"

// A megabyte that the assembler copies faster than the compiler parses.
asm(".section .rodata\n"
    ".global isomatch_page_template\n"
    ".global isomatch_page_template_end\n"
    "isomatch_page_template:\n"
    ".incbin \"" ISOMATCH_PAGE_TEMPLATE
    "\"\n"
    "isomatch_page_template_end:\n"
    ".global isomatch_folder_template\n"
    ".global isomatch_folder_template_end\n"
    "isomatch_folder_template:\n"
    ".incbin \"" ISOMATCH_FOLDER_TEMPLATE
    "\"\n"
    "isomatch_folder_template_end:\n"
    ".previous\n");

extern "C" {
extern const char isomatch_page_template[];
extern const char isomatch_page_template_end[];
extern const char isomatch_folder_template[];
extern const char isomatch_folder_template_end[];
}

namespace isomatch {

absl::string_view PageTemplate() {
  return {isomatch_page_template,
          static_cast<std::size_t>(isomatch_page_template_end -
                                   isomatch_page_template)};
}

absl::string_view FolderTemplate() {
  return {isomatch_folder_template,
          static_cast<std::size_t>(isomatch_folder_template_end -
                                   isomatch_folder_template)};
}

}  // namespace isomatch
