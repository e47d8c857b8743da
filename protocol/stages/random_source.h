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
#include <stdexcept>
#include <vector>

#include "protocol/case_file.h"

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

// One radius [m]. Truncated distributions are drawn by rejection; throws std::invalid_argument where the range holds so
// little of the distribution that a million draws miss it, and where a list has no positive weight.
inline double draw_radius(const SizeDistribution& sizes, RandomSource& random) {
  using Kind = SizeDistribution::Kind;
  switch (sizes.kind) {
    case Kind::mono:
      return sizes.radius;
    case Kind::uniform:
      return sizes.min + (sizes.max - sizes.min) * random.uniform();
    case Kind::lognormal:
    case Kind::normal:
      for (int attempt = 0; attempt < 1000000; ++attempt) {
        const double deviate = sizes.sigma * random.normal();
        const double R = sizes.kind == Kind::normal ? sizes.median + deviate : sizes.median * portable_exp(deviate);
        // A largest radius of 0 stands for none.
        if (R > 0.0 && R >= sizes.min && (sizes.max <= 0.0 || R <= sizes.max)) return R;
      }
      throw std::invalid_argument("particles.sizes: almost nothing of the distribution lies between min and max");
    case Kind::list: {
      const std::size_t count = sizes.radii.size();
      if (count == 0 || (!sizes.weights.empty() && sizes.weights.size() != count))
        throw std::invalid_argument("particles.sizes: a list needs radii, and as many weights or none");
      double total = 0.0;
      for (std::size_t k = 0; k < count; ++k) total += sizes.weights.empty() ? 1.0 : sizes.weights[k];
      if (!(total > 0.0)) throw std::invalid_argument("particles.sizes: no positive weight in the list");
      double left = total * random.uniform();
      std::size_t last = 0;  // with a weight, for a remainder that rounding has left at the end
      for (std::size_t k = 0; k < count; ++k) {
        const double weight = sizes.weights.empty() ? 1.0 : sizes.weights[k];
        if (weight > 0.0) last = k;
        if (left < weight) return sizes.radii[k];
        left -= weight;
      }
      return sizes.radii[last];
    }
  }
  throw std::invalid_argument("particles.sizes: unknown kind");
}

// `count` radii [m] in order of ids; throws as draw_radius does.
inline std::vector<double> draw_radii(const SizeDistribution& sizes, std::int64_t count, RandomSource& random) {
  std::vector<double> radii(static_cast<std::size_t>(count));
  for (double& R : radii) R = draw_radius(sizes, random);
  return radii;
}

}  // namespace platen
