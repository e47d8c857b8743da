// Figures of the verification tests: each is judged, and printed as a row of a markdown table, from which
// docs/verification.md is made:   test_chung_ooi | grep '^[|#]'
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

namespace platen::verification {

inline void heading(const char* title) {
  std::printf("\n### %s\n\n| figure | at | cases | platen | expected | difference | allowed |\n|---|---|---|---|---|---|---|\n",
              title);
}

// One figure over several cases. Every case is judged; the row shows the one that came nearest to its bound.
class Figure {
 public:
  Figure(std::string name, std::string unit) : name_(std::move(name)), unit_(std::move(unit)) {}
  Figure(const Figure&) = delete;
  Figure& operator=(const Figure&) = delete;
  ~Figure() {
    if (cases_ > 0)
      std::printf("| %s | %s | %d | %.6g | %.6g | %.2g | %.2g |\n", (name_ + (unit_.empty() ? "" : " (" + unit_ + ")")).c_str(),
                  at_.c_str(), cases_, value_, expected_, value_ - expected_, allowed_);
    std::fflush(stdout);
  }

  // Passes when |value - expected| <= allowed (absolute).
  void check(const std::string& at, double value, double expected, double allowed) {
    EXPECT_NEAR(value, expected, allowed) << name_ << " at " << at;
    const double share = std::isfinite(value) ? std::fabs(value - expected) / allowed : INFINITY;
    if (cases_++ > 0 && share < share_) return;
    at_ = at, share_ = share, value_ = value, expected_ = expected, allowed_ = allowed;
  }

  // Passes when value <= most; shown as an expected 0 with the bound as what is allowed.
  void check_below(const std::string& at, double value, double most) { check(at, value, 0.0, most); }

 private:
  std::string name_, unit_, at_;
  int cases_ = 0;
  double share_ = 0.0, value_ = 0.0, expected_ = 0.0, allowed_ = 0.0;
};

inline std::string text(const char* format, double number) {
  char line[64];
  std::snprintf(line, sizeof line, format, number);
  return line;
}

}  // namespace platen::verification
