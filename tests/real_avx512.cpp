#include "tests/real_checks.h"

namespace platen {

void check_real_avx512(RealReport& report) { RealChecks<Avx512>(report).all(); }

}  // namespace platen
