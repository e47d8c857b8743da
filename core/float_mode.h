// Rounding to nearest, denormals flushed to zero, for as long as the object lives: the same on every thread that works on
// the state, and put back for whoever uses the library.
#pragma once

#include <xmmintrin.h>

namespace platen {

class FloatMode {
 public:
  FloatMode() : before_(_mm_getcsr()) { _mm_setcsr(0x1f80 | 0x8040); }  // all masked; FTZ and DAZ
  ~FloatMode() { _mm_setcsr(before_); }
  FloatMode(const FloatMode&) = delete;
  FloatMode& operator=(const FloatMode&) = delete;

 private:
  unsigned before_;
};

}  // namespace platen
