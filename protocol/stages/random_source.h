// Random numbers of the set-up: specified to the bit, so that a seed means the same bed with every compiler and
// library.
//
// xoshiro256++ [Blackman2021], its state filled by splitmix64 [Steele2014]. Normal deviates by the polar method of
// Marsaglia [Marsaglia1964]. The logarithm and exponential that distributions need are series of plain IEEE arithmetic
// here, because libm's differ between its versions and between processors in the last bit. Good to about 1e-15,
// slower than libm: for the set-up only.
#pragma once

#include <cmath>
#include <cstdint>

namespace platen {

// ln x, x > 0 and normal: x = 2^e f with f in [1/sqrt 2, sqrt 2), ln f = 2 artanh((f - 1)/(f + 1)).
inline double portable_log(double x) {
  int e = 0;
  double f = std::frexp(x, &e);
  if (f < 0.70710678118654752) f *= 2.0, --e;
  const double t = (f - 1.0) / (f + 1.0), t2 = t * t;
  double sum = 0.0;
  for (int k = 25; k >= 1; k -= 2) sum = sum * t2 + 1.0 / k;  // |t| < 0.172: the first term left out is below 1e-20
  return 2.0 * t * sum + e * 0.69314718055994531;
}

// e^x, |x| < 700: x = k ln 2 + r with |r| <= 0.35, e^r by its series.
inline double portable_exp(double x) {
  const double k = std::floor(x * 1.4426950408889634 + 0.5);
  // ln 2 in two parts, of which the first has trailing zeros, so that k times it is exact.
  const double r = (x - k * 0x1.62e42fefap-1) - k * 0x1.cf79abc9e3b3ap-40;
  double sum = 1.0;
  for (int n = 16; n >= 1; --n) sum = 1.0 + sum * r / n;
  return std::ldexp(sum, static_cast<int>(k));
}

class RandomSource {
 public:
  explicit RandomSource(std::uint64_t seed) {
    for (std::uint64_t& word : state_) {  // splitmix64
      seed += 0x9e3779b97f4a7c15u;
      std::uint64_t x = seed;
      x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
      x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
      word = x ^ (x >> 31);
    }
  }

  // 64 random bits.
  std::uint64_t bits() {
    const std::uint64_t result = rotated(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = rotated(state_[3], 45);
    return result;
  }

  // Uniform in [0, 1): a multiple of 2^-53.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

  // Mean 0, standard deviation 1. The second deviate of each pair is thrown away, so that a draw leaves no state
  // behind.
  double normal() {
    for (;;) {
      const double u = 2.0 * uniform() - 1.0, v = 2.0 * uniform() - 1.0, s = u * u + v * v;
      if (s < 1.0 && s > 0.0) return u * std::sqrt(-2.0 * portable_log(s) / s);
    }
  }

 private:
  static std::uint64_t rotated(std::uint64_t x, int by) { return (x << by) | (x >> (64 - by)); }
  std::uint64_t state_[4];
};

}  // namespace platen
