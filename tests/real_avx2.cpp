#include "tests/real_checks.h"

namespace platen {

void check_real_avx2(RealReport& report) { RealChecks<Avx2>(report).all(); }

}  // namespace platen
