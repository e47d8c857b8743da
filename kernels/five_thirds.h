// x^(5/3), which the energy of plastic overlaps takes where the exponent is 3/2, without a call for each lane.
#pragma once

#include <cstdint>
#include <cstring>

#include "kernels/real.h"

namespace platen {

// x >= 0. Error below 2^-51 of the result; 0 where that is too small for a double.
//
// x^(5/3) = x (x y) with y = x^(-1/3), for which y <- y (4 - x y^3)/3 doubles the correct digits. The first guess, within 4 %,
// divides the exponent, which stands in the upper bits, by -3.
template <class I>
PLATEN_INLINE typename I::Real five_thirds(typename I::Real x) {
  using Real = typename I::Real;
  alignas(64) double v[I::width];
  I::store(v, x);
  for (int lane = 0; lane < I::width; ++lane) {
    std::uint64_t bits;
    std::memcpy(&bits, &v[lane], sizeof bits);
    bits = 0x553ef0ff289dd796ULL - bits / 3;
    std::memcpy(&v[lane], &bits, sizeof bits);
  }
  Real y = I::load(v);
  const Real third = I::set(1.0 / 3.0), one = I::set(1.0);
  for (int pass = 0; pass < 4; ++pass) {
    const Real error = I::fnma(x * y, y * y, one);  // 1 - x y^3
    y = I::fma(y * third, error, y);
  }
  return x * (x * y);
}

}  // namespace platen
