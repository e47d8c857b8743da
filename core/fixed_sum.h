// A sum that does not depend on the order of its terms: each is rounded to a multiple of a power-of-two unit and added
// as an integer of 128 bits.
#pragma once

#include <cmath>

namespace platen {

__extension__ using Int128 = __int128;

class FixedSum {
 public:
  explicit FixedSum(double unit) : unit_(unit), inverse_(1.0 / unit) {}
  void add(double x) { sum_ += static_cast<Int128>(std::nearbyint(x * inverse_)); }
  void add(const FixedSum& other) { sum_ += other.sum_; }
  double value() const { return static_cast<double>(sum_) * unit_; }

 private:
  double unit_, inverse_;
  Int128 sum_ = 0;
};

// The smallest power of two that is not below x > 0.
inline double power_of_two_above(double x) {
  int exponent = 0;
  const double mantissa = std::frexp(x, &exponent);
  return std::ldexp(1.0, mantissa == 0.5 ? exponent - 1 : exponent);
}

}  // namespace platen
