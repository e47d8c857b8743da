#include "kernels/power.h"

#include <cmath>

namespace platen {

double power(double x, double p) noexcept { return std::pow(x, p); }

}  // namespace platen
