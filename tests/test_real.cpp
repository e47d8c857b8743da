// Every function of every instruction set that this machine has, against plain doubles.
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "kernels/kernel_table.h"
#include "tests/real_checks.h"

namespace platen {

void check_real_scalar(RealReport& report) { RealChecks<Scalar>(report).all(); }

namespace {

void fail(void*, const char* what, double got, double wanted) {
  ADD_FAILURE() << what << ": " << got << ", wanted " << wanted;
}

TEST(Real, EveryFunctionOfEveryInstructionSet) {
  for (const InstructionSet set : available_instruction_sets()) {
    SCOPED_TRACE(to_string(set));
    RealReport report{&fail, nullptr};
    switch (set) {
      case InstructionSet::scalar: check_real_scalar(report); break;
      case InstructionSet::avx2: check_real_avx2(report); break;
      case InstructionSet::avx512: check_real_avx512(report); break;
    }
    EXPECT_GT(report.compared, 10000);
  }
}

TEST(Real, ChecksNoticeAWrongFunction) {
  struct Wrong : Scalar {
    static double max(double a, double b) { return a > b ? a : (b > a ? b : a); }  // the first where a NaN is met
    static Record add_reaction(const Record& a, const Record& b) {
      Record r = add(a, b);
      for (int k = 0; k < 4; ++k) r.v[k] = a.v[k] - b.v[k];
      return r;
    }
  };
  std::set<std::string> noticed;
  RealReport report{[](void* context, const char* what, double, double) { static_cast<std::set<std::string>*>(context)->insert(what); },
                    &noticed};
  RealChecks<Wrong>(report).all();
  EXPECT_EQ(noticed, (std::set<std::string>{"add_reaction", "max"}));
}

}  // namespace
}  // namespace platen
