#include "protocol/report/page_parts.h"

// The assembler reads the files as they are: no copy in source form, no limit on the length of a literal. Their paths come
// from CMakeLists.txt, which also makes this file depend on them.
#define PLATEN_FILE(name, path)                                                             \
  __asm__(".pushsection .rodata\n" #name "_begin: .incbin \"" path "\"\n" #name "_end: .byte 0\n.popsection\n"); \
  extern "C" const char name##_begin[], name##_end[];

PLATEN_FILE(platen_page_html, PLATEN_PAGE_HTML)
PLATEN_FILE(platen_page_css, PLATEN_PAGE_CSS)
PLATEN_FILE(platen_page_script, PLATEN_PAGE_SCRIPT)
PLATEN_FILE(platen_page_chart, PLATEN_PAGE_CHART)
PLATEN_FILE(platen_page_three, PLATEN_PAGE_THREE)
PLATEN_FILE(platen_page_controls, PLATEN_PAGE_CONTROLS)

namespace platen::page_parts {

#define PLATEN_VIEW(name) {name##_begin, static_cast<std::size_t>(name##_end - name##_begin)}

const std::string_view html PLATEN_VIEW(platen_page_html), css PLATEN_VIEW(platen_page_css), script PLATEN_VIEW(platen_page_script);
const std::string_view chart PLATEN_VIEW(platen_page_chart), three PLATEN_VIEW(platen_page_three), controls PLATEN_VIEW(platen_page_controls);

}  // namespace platen::page_parts
