// A small case for the tests of the case file, and the message of a case that is refused.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/case_file.h"

namespace platen::test {

// Line numbers in the tests refer to this text.
inline const std::string good_case = R"([case]
title = "small"
seed = 7
[particles]
radius = "2.5 mm"
density = "2000 kg/m3"
count = 100
[particles.law]
k1 = "5 kN/m"
k2 = "25 kN/m"
[box]
width = "30 mm"
depth = "30 mm"
height = "80 mm"
[[stage]]
kind = "fill"
[[stage]]
kind = "compress"
speed = "10 mm/s"
until = { stress = "40 kPa" }
)";

inline std::string replaced(const std::string& from, const std::string& to, std::string text = good_case) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << "the test looks for \"" << from << "\"";
  return text.replace(at, from.size(), to);
}

// All messages, or "accepted".
inline std::string errors_of(const std::string& text, const std::vector<std::string>& overrides = {},
                             const std::string& folder = ".", CaseUse use = CaseUse::run) {
  try {
    parse_case(text, "case.toml", folder, overrides, use);
    return "accepted";
  } catch (const CaseError& error) {
    return error.what();
  }
}

// The case is refused with exactly one message, which begins with `begin` and holds `part`.
inline void expect_error(const std::string& text, const std::string& begin, const std::string& part = "",
                         const std::vector<std::string>& overrides = {}) {
  const std::string said = errors_of(text, overrides);
  EXPECT_EQ(said.substr(0, begin.size()), begin);
  EXPECT_NE(said.find(part), std::string::npos) << said;
  EXPECT_EQ(said.find('\n'), std::string::npos) << "more than one message:\n" << said;
}

}  // namespace platen::test
