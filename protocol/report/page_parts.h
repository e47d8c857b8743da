// The files that a page is made of, put into the program when it is built (page_parts.cpp).
#pragma once

#include <string_view>

namespace platen::page_parts {

extern const std::string_view html, css, script;        // our own, protocol/report/page/
extern const std::string_view chart, three, controls;   // Chart.js, three.js, its OrbitControls: Debian's packages

}  // namespace platen::page_parts
