#include "protocol/stages/draw_radii.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace platen {
namespace {

using Kind = SizeDistribution::Kind;

bool by_volume(const SizeDistribution& sizes) { return sizes.basis == SizeDistribution::Basis::volume; }

// Spheres in a unit of volume, but for a constant.
double number_in_volume(double R) { return 1.0 / (R * R * R); }

// Standard deviations beyond which nothing is found: below 1e-12.
constexpr double far_out = 7.2;

// Between a and b: equally many in equal stretches of R, or equally much volume, so p_0(R) ~ R^-3, whose integral is
// (a^-2 - R^-2) / 2.
double draw_between(double a, double b, bool volume, RandomSource& random) {
  const double u = random.uniform();
  if (!volume) return a + (b - a) * u;
  const double from = 1.0 / (a * a), to = 1.0 / (b * b);
  return std::clamp(1.0 / std::sqrt(from - u * (from - to)), a, b);
}

// Spheres in a unit of volume that lies evenly between a and b: the mean of R^-3 there.
double number_in_volume_between(double a, double b) { return 0.5 * (a + b) / (a * a * b * b); }

// A (log)normal deviate between min and max. Of volume: one of volume is drawn, and made the more rarely the larger it is.
double draw_normal(const SizeDistribution& sizes, RandomSource& random) {
  const bool log = sizes.kind == Kind::lognormal, volume = by_volume(sizes);
  double median = sizes.median, smallest = sizes.min;
  bool thinned = volume;
  if (volume && !log) {
    smallest = std::max(smallest, median - far_out * sizes.sigma);
  } else if (volume) {
    // A lognormal distribution of volume is one of numbers with the same sigma and a smaller median [Hatch1929]; drawn like that
    // where the range holds enough of it.
    const double shift = 3.0 * sizes.sigma * sizes.sigma;
    if (sizes.min <= 0.0 || portable_log(sizes.min / median) + shift <= 3.0 * sizes.sigma) median *= portable_exp(-shift), thinned = false;
  }
  for (int attempt = 0; attempt < 1000000; ++attempt) {
    const double deviate = sizes.sigma * random.normal();
    const double R = log ? median * portable_exp(deviate) : median + deviate;
    // A largest radius of 0 stands for none.
    if (!(R > 0.0 && R >= sizes.min && (sizes.max <= 0.0 || R <= sizes.max))) continue;
    if (thinned && !(random.uniform() < number_in_volume(R / smallest))) continue;
    return R;
  }
  throw std::invalid_argument("particles.sizes: almost nothing of the distribution lies between min and max");
}

// The index of one of `count` weights, drawn by them; throws std::invalid_argument where none is positive.
template <class Weight>
std::size_t draw_index(std::size_t count, const Weight& weight_of, RandomSource& random) {
  double total = 0.0;
  for (std::size_t k = 0; k < count; ++k) total += weight_of(k);
  if (!(total > 0.0)) throw std::invalid_argument("particles.sizes: no positive weight in the list");
  double left = total * random.uniform();
  std::size_t last = 0;  // with a weight, for a remainder that rounding has left at the end
  for (std::size_t k = 0; k < count; ++k) {
    const double weight = weight_of(k);
    if (weight > 0.0) last = k;
    if (left < weight) return k;
    left -= weight;
  }
  return last;
}

double draw_of_list(const SizeDistribution& sizes, RandomSource& random) {
  const std::size_t count = sizes.radii.size();
  if (count == 0 || (!sizes.weights.empty() && sizes.weights.size() != count))
    throw std::invalid_argument("particles.sizes: a list needs radii, and as many weights or none");
  const auto weight_of = [&](std::size_t k) {
    const double weight = sizes.weights.empty() ? 1.0 : sizes.weights[k];
    // In units of the first radius, which leaves weights numbers of a usual size.
    return by_volume(sizes) ? weight * number_in_volume(sizes.radii[k] / sizes.radii[0]) : weight;
  };
  return sizes.radii[draw_index(count, weight_of, random)];
}

double draw_cumulative(const SizeDistribution& sizes, RandomSource& random) {
  const std::vector<double>&R = sizes.radii, &below = sizes.below;
  if (R.size() < 2 || below.size() != R.size())
    throw std::invalid_argument("particles.sizes: a cumulative distribution needs two radii or more, and as many parts below them");
  const auto weight_of = [&](std::size_t k) {
    const double part = below[k + 1] - below[k];
    return by_volume(sizes) ? part * number_in_volume_between(R[k] / R[0], R[k + 1] / R[0]) : part;
  };
  const std::size_t k = draw_index(R.size() - 1, weight_of, random);
  return draw_between(R[k], R[k + 1], by_volume(sizes), random);
}

}  // namespace

double draw_radius(const SizeDistribution& sizes, RandomSource& random) {
  switch (sizes.kind) {
    case Kind::mono:
      return sizes.radius;
    case Kind::uniform:
      return draw_between(sizes.min, sizes.max, by_volume(sizes), random);
    case Kind::lognormal:
    case Kind::normal:
      return draw_normal(sizes, random);
    case Kind::list:
      return draw_of_list(sizes, random);
    case Kind::cumulative:
      return draw_cumulative(sizes, random);
  }
  throw std::invalid_argument("particles.sizes: unknown kind");
}

std::vector<double> draw_radii(const SizeDistribution& sizes, std::int64_t count, RandomSource& random) {
  std::vector<double> radii(static_cast<std::size_t>(count));
  for (double& R : radii) R = draw_radius(sizes, random);
  return radii;
}

}  // namespace platen
