// x^p for the exponents that have no short form. One out-of-line function built for the baseline, called lane by lane
// from every instruction set, so that all of them get the same bits.
#pragma once

namespace platen {

double power(double x, double p) noexcept;  // x >= 0

}  // namespace platen
