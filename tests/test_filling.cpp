// Random numbers, sizes, and the two ways to place spheres before a run.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include <gtest/gtest.h>

#include "protocol/stages/grow.h"
#include "protocol/stages/rain.h"
#include "protocol/stages/draw_radii.h"

namespace platen {
namespace {

using Kind = SizeDistribution::Kind;

double solid_volume(const std::vector<double>& radii) {
  double cubes = 0.0;
  for (const double R : radii) cubes += R * R * R;
  return 4.0 / 3.0 * std::numbers::pi * cubes;
}

// The largest overlap of any two spheres over the smaller radius; 0 when none overlap. All pairs near in height are
// looked at, image by image, without the cells of the code under test.
double largest_overlap(const std::vector<double>& x, const std::vector<double>& radii, double width, double depth,
                       bool periodic) {
  const double largest = *std::max_element(radii.begin(), radii.end());
  std::vector<std::size_t> order(radii.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return x[3 * a + 2] < x[3 * b + 2]; });
  const int images = periodic ? 1 : 0;
  double worst = 0.0;
  for (std::size_t a = 0; a < order.size(); ++a)
    for (std::size_t b = a + 1; b < order.size(); ++b) {
      const std::size_t i = order[a], j = order[b];
      const double dz = x[3 * j + 2] - x[3 * i + 2], reach = radii[i] + radii[j];
      if (dz > 2.0 * largest) break;
      for (int p = -images; p <= images; ++p)
        for (int q = -images; q <= images; ++q) {
          const double dx = x[3 * j] - x[3 * i] + p * width, dy = x[3 * j + 1] - x[3 * i + 1] + q * depth;
          const double distance2 = dx * dx + dy * dy + dz * dz;
          if (distance2 < reach * reach)
            worst = std::max(worst, (reach - std::sqrt(distance2)) / std::min(radii[i], radii[j]));
        }
    }
  return worst;
}

// Whether every sphere is where it may be in x and y.
bool inside(const std::vector<double>& x, const std::vector<double>& radii, double width, double depth, bool periodic,
            double slack) {
  for (std::size_t s = 0; s < radii.size(); ++s) {
    const double margin = periodic ? 0.0 : radii[s] * (1.0 - slack);
    if (!(x[3 * s] >= margin && x[3 * s + 1] >= margin)) return false;
    if (periodic ? !(x[3 * s] < width && x[3 * s + 1] < depth)
                 : !(x[3 * s] <= width - margin && x[3 * s + 1] <= depth - margin))
      return false;
  }
  return true;
}

TEST(RandomSource, IsThePublishedGenerator) {
  // xoshiro256++ from the splitmix64 sequence of seed 1234567 (6457827717110365317, 3203168211198807973, ...), worked
  // out with a separate implementation that was checked against the published outputs of both.
  RandomSource random(1234567);
  EXPECT_EQ(random.bits(), 437095814655224680u);
  EXPECT_EQ(random.bits(), 8127161015984454572u);
  EXPECT_EQ(random.bits(), 18128670339019551454u);
  EXPECT_EQ(random.bits(), 254746599813523466u);
  RandomSource again(1234567), other(1234568);
  EXPECT_EQ(again.uniform(), static_cast<double>(437095814655224680u >> 11) * 0x1p-53);
  EXPECT_NE(other.bits(), 437095814655224680u);
}

TEST(RandomSource, LogAndExpAreGoodToRounding) {
  RandomSource random(5);
  for (int k = 0; k < 20000; ++k) {
    const double x = portable_exp(1200.0 * (random.uniform() - 0.5));
    // e^x: reduction and 16 terms, a few roundings; ln: relative away from 1, absolute near it.
    EXPECT_NEAR(portable_log(x), std::log(x), 1e-15 * std::abs(std::log(x)) + 1e-15);
    const double y = 40.0 * (random.uniform() - 0.5);
    EXPECT_NEAR(portable_exp(y) / std::exp(y), 1.0, 2e-15);
  }
  EXPECT_EQ(portable_log(1.0), 0.0);
  EXPECT_EQ(portable_exp(0.0), 1.0);
}

// Means of N independent draws scatter with sigma/sqrt(N); five times that is passed by chance once in two million.
TEST(RandomSource, UniformMoments) {
  RandomSource random(11);
  const int N = 200000;
  double mean = 0.0, square = 0.0, neighbours = 0.0, before = 0.5;
  for (int k = 0; k < N; ++k) {
    const double u = random.uniform();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    mean += u / N, square += u * u / N, neighbours += (u - 0.5) * (before - 0.5) / N;
    before = u;
  }
  EXPECT_NEAR(mean, 0.5, 5.0 * std::sqrt(1.0 / 12.0 / N));
  EXPECT_NEAR(square, 1.0 / 3.0, 5.0 * std::sqrt(4.0 / 45.0 / N));
  EXPECT_NEAR(neighbours, 0.0, 5.0 / 12.0 / std::sqrt(N));
}

TEST(RandomSource, NormalMoments) {
  RandomSource random(12);
  const int N = 200000;
  double moment[5] = {};
  for (int k = 0; k < N; ++k) {
    double power = 1.0;
    const double u = random.normal();
    for (double& m : moment) m += power / N, power *= u;
  }
  // Variances of u, u^2, u^3, u^4: 1, 2, 15, 96.
  EXPECT_NEAR(moment[1], 0.0, 5.0 * std::sqrt(1.0 / N));
  EXPECT_NEAR(moment[2], 1.0, 5.0 * std::sqrt(2.0 / N));
  EXPECT_NEAR(moment[3], 0.0, 5.0 * std::sqrt(15.0 / N));
  EXPECT_NEAR(moment[4], 3.0, 5.0 * std::sqrt(96.0 / N));
}

TEST(Radii, MonoAndUniform) {
  RandomSource random(1);
  SizeDistribution mono;
  mono.radius = 2.5e-3;
  EXPECT_EQ(draw_radii(mono, 3, random), (std::vector<double>{2.5e-3, 2.5e-3, 2.5e-3}));
  EXPECT_TRUE(draw_radii(mono, 0, random).empty());

  SizeDistribution uniform;
  uniform.kind = Kind::uniform;
  uniform.min = 1e-3;
  uniform.max = 3e-3;
  const int N = 50000;
  const auto radii = draw_radii(uniform, N, random);
  double mean = 0.0;
  for (const double R : radii) mean += R / N;
  EXPECT_GE(*std::min_element(radii.begin(), radii.end()), uniform.min);
  EXPECT_LE(*std::max_element(radii.begin(), radii.end()), uniform.max);
  EXPECT_NEAR(mean, 2e-3, 5.0 * 2e-3 / std::sqrt(12.0 * N));
}

TEST(Radii, NormalAndLognormalWithinTheirRange) {
  const int N = 50000;
  for (const Kind kind : {Kind::normal, Kind::lognormal}) {
    RandomSource random(2);
    SizeDistribution sizes;
    sizes.kind = kind;
    sizes.median = 2e-3;
    sizes.sigma = kind == Kind::normal ? 0.4e-3 : 0.2;
    // Symmetric about the median, two standard deviations: of R, or of ln R.
    sizes.min = kind == Kind::normal ? 1.2e-3 : 2e-3 * std::exp(-0.4);
    sizes.max = kind == Kind::normal ? 2.8e-3 : 2e-3 * std::exp(0.4);
    double mean = 0.0, square = 0.0;
    for (const double R : draw_radii(sizes, N, random)) {
      ASSERT_GE(R, sizes.min);
      ASSERT_LE(R, sizes.max);
      const double u = kind == Kind::normal ? (R - 2e-3) / sizes.sigma : std::log(R / 2e-3) / sizes.sigma;
      mean += u / N, square += u * u / N;
    }
    // Variance of a normal deviate cut at +-2: 1 - 2*2*phi(2)/(2 Phi(2) - 1) = 0.7737; that of its square is below 1.
    const double phi = std::exp(-2.0) / std::sqrt(2.0 * std::numbers::pi), within = std::erf(std::sqrt(2.0));
    EXPECT_NEAR(mean, 0.0, 5.0 * std::sqrt(0.7737 / N));
    EXPECT_NEAR(square, 1.0 - 4.0 * phi / within, 5.0 / std::sqrt(N));
  }
}

TEST(Radii, ListByWeight) {
  RandomSource random(3);
  SizeDistribution sizes;
  sizes.kind = Kind::list;
  sizes.radii = {1e-3, 2e-3, 3e-3, 4e-3};
  sizes.weights = {1.0, 0.0, 2.0, 5.0};
  const int N = 40000;
  int count[4] = {};
  for (const double R : draw_radii(sizes, N, random))
    ++count[std::find(sizes.radii.begin(), sizes.radii.end(), R) - sizes.radii.begin()];
  for (int k = 0; k < 4; ++k) {
    const double p = sizes.weights[static_cast<std::size_t>(k)] / 8.0;
    EXPECT_NEAR(count[k], N * p, 5.0 * std::sqrt(N * p * (1.0 - p))) << k;
  }
  sizes.weights.clear();  // equal
  int first = 0;
  for (const double R : draw_radii(sizes, N, random)) first += R == 1e-3;
  EXPECT_NEAR(first, N / 4.0, 5.0 * std::sqrt(N * 0.1875));
}

// Part of the solid in spheres below R, of N drawn.
double volume_below(const std::vector<double>& radii, double R) {
  double below = 0.0, all = 0.0;
  for (const double r : radii) all += r * r * r, below += r <= R ? r * r * r : 0.0;
  return below / all;
}

TEST(Radii, DistributionsOfVolume) {
  const int N = 400000;
  const auto drawn = [&](const SizeDistribution& sizes) {
    RandomSource random(5);
    return draw_radii(sizes, N, random);
  };
  SizeDistribution sizes;
  sizes.basis = SizeDistribution::Basis::volume;
  sizes.kind = Kind::uniform;
  sizes.min = 1e-3, sizes.max = 3e-3;
  std::vector<double> radii = drawn(sizes);
  EXPECT_GE(*std::min_element(radii.begin(), radii.end()), sizes.min);
  EXPECT_LE(*std::max_element(radii.begin(), radii.end()), sizes.max);
  for (const double R : {1.2e-3, 1.6e-3, 2e-3, 2.6e-3}) EXPECT_NEAR(volume_below(radii, R), (R - 1e-3) / 2e-3, 5e-3) << R;
  // p_0 ~ R^-3: of the number (1 - 1/4)/(1 - 1/9) is below 2 mm
  EXPECT_NEAR(std::ranges::count_if(radii, [](double R) { return R < 2e-3; }) / double(N), 27.0 / 32.0, 3e-3);

  // Cut at one deviation on both sides: symmetric in ln R, or in R, by volume.
  const auto below = [](double z) { return 0.5 + 0.5 * std::erf(z / std::sqrt(2.0)) / std::erf(1.0 / std::sqrt(2.0)); };
  sizes.kind = Kind::lognormal;
  sizes.median = 2e-3, sizes.sigma = 0.4;
  sizes.min = 2e-3 * std::exp(-0.4), sizes.max = 2e-3 * std::exp(0.4);
  radii = drawn(sizes);
  for (const double z : {-0.5, 0.0, 0.5}) EXPECT_NEAR(volume_below(radii, 2e-3 * std::exp(0.4 * z)), below(z), 5e-3) << z;
  sizes.kind = Kind::normal;
  sizes.sigma = 0.8e-3;
  sizes.min = 1.2e-3, sizes.max = 2.8e-3;
  radii = drawn(sizes);
  for (const double z : {-0.5, 0.0, 0.5}) EXPECT_NEAR(volume_below(radii, 2e-3 + 0.8e-3 * z), below(z), 5e-3) << z;

  // A range far wider than what there is, and a broad distribution cut to a narrow range.
  sizes.sigma = 0.1e-3;
  sizes.min = 1e-5, sizes.max = 2.5e-3;
  radii = drawn(sizes);
  for (const double z : {-1.0, 0.0, 1.0}) EXPECT_NEAR(volume_below(radii, 2e-3 + 0.1e-3 * z), 0.5 + 0.5 * std::erf(z / std::sqrt(2.0)), 5e-3) << z;
  sizes.kind = Kind::lognormal;
  sizes.sigma = 1.6;
  sizes.min = 1.5e-3, sizes.max = 2.5e-3;
  radii = drawn(sizes);
  const auto wide = [](double R) { return std::erf(std::log(R / 2e-3) / 1.6 / std::sqrt(2.0)); };
  for (const double R : {1.7e-3, 2e-3, 2.3e-3}) EXPECT_NEAR(volume_below(radii, R), (wide(R) - wide(1.5e-3)) / (wide(2.5e-3) - wide(1.5e-3)), 5e-3) << R;

  sizes.kind = Kind::list;
  sizes.radii = {1e-3, 2e-3, 4e-3};
  sizes.weights = {1.0, 2.0, 1.0};
  radii = drawn(sizes);
  EXPECT_NEAR(volume_below(radii, 1e-3), 0.25, 5e-3);
  EXPECT_NEAR(volume_below(radii, 2e-3), 0.75, 5e-3);
  EXPECT_NEAR(std::ranges::count(radii, 1e-3) / double(N), 1.0 / (1.0 + 2.0 / 8.0 + 1.0 / 64.0), 3e-3);
}

TEST(Radii, CumulativeDistributions) {
  const int N = 400000;
  SizeDistribution sizes;
  sizes.kind = Kind::cumulative;
  sizes.radii = {0.5e-3, 1e-3, 2e-3, 2.5e-3, 4e-3, 5e-3};
  sizes.below = {0.2, 0.2, 0.5, 0.7, 1.0, 1.0};  // what is below the first is not made: 0 to 1 of the rest is (b - 0.2) / 0.8
  EXPECT_EQ(sizes.smallest(), 1e-3);
  EXPECT_EQ(sizes.largest(), 4e-3);
  for (const auto basis : {SizeDistribution::Basis::number, SizeDistribution::Basis::volume}) {
    sizes.basis = basis;
    RandomSource random(6);
    const std::vector<double> radii = draw_radii(sizes, N, random);
    EXPECT_GE(*std::min_element(radii.begin(), radii.end()), 1e-3);
    EXPECT_LE(*std::max_element(radii.begin(), radii.end()), 4e-3);
    for (const auto& [R, expected] : {std::pair{1.5e-3, 0.1875}, {2e-3, 0.375}, {2.5e-3, 0.625}, {3.25e-3, 0.8125}}) {
      const double number = std::ranges::count_if(radii, [&](double r) { return r <= R; }) / double(N);
      EXPECT_NEAR(basis == SizeDistribution::Basis::number ? number : volume_below(radii, R), expected, 5e-3) << R;
    }
  }
  RandomSource random(7);
  sizes.below.pop_back();
  EXPECT_THROW(draw_radii(sizes, 1, random), std::invalid_argument);
}

TEST(Radii, RefuseWhatCannotBeDrawn) {
  RandomSource random(4);
  SizeDistribution sizes;
  sizes.kind = Kind::normal;
  sizes.median = 1e-3;
  sizes.sigma = 1e-5;
  sizes.min = 2e-3;
  sizes.max = 3e-3;
  EXPECT_THROW(draw_radii(sizes, 1, random), std::invalid_argument);
  sizes.kind = Kind::list;
  EXPECT_THROW(draw_radii(sizes, 1, random), std::invalid_argument);
  sizes.radii = {1e-3};
  sizes.weights = {0.0};
  EXPECT_THROW(draw_radii(sizes, 1, random), std::invalid_argument);
}

std::vector<double> radii_of(std::int64_t count, bool equal, std::uint64_t seed) {
  RandomSource random(seed);
  SizeDistribution sizes;
  sizes.kind = equal ? Kind::mono : Kind::lognormal;
  sizes.radius = sizes.median = 2.5e-3;
  sizes.sigma = 0.25;
  sizes.min = 1.5e-3;
  sizes.max = 4e-3;
  return draw_radii(sizes, count, random);
}

TEST(Rain, SpheresAreApartInsideAndAboveTheFloor) {
  for (const bool equal : {true, false})
    for (const bool periodic : {true, false})
      // A box of many diameters, one of three, and one of little more than one.
      for (const double depth : {50e-3, 16e-3, 9e-3}) {
        SCOPED_TRACE(depth);
        const auto radii = radii_of(1500, equal, 1);
        RandomSource random(7);
        const double width = 60e-3, floor = 0.3;
        const auto x = rain_positions(radii, width, depth, periodic, floor, rain_solid_fraction, random);
        ASSERT_EQ(x.size(), 3 * radii.size());
        EXPECT_EQ(largest_overlap(x, radii, width, depth, periodic), 0.0);
        EXPECT_TRUE(inside(x, radii, width, depth, periodic, 0.0));
        for (std::size_t s = 0; s < radii.size(); ++s) ASSERT_GE(x[3 * s + 2], floor + 1.05 * radii[s]);
      }
}

TEST(Rain, FillsToTheFractionAskedFor) {
  const double width = 150e-3, depth = 50e-3;
  for (const double fraction : {0.1, 0.25, 0.3}) {
    const auto radii = radii_of(20000, true, 2);
    RandomSource random(8);
    const auto x = rain_positions(radii, width, depth, true, 0.0, fraction, random);
    EXPECT_EQ(largest_overlap(x, radii, width, depth, true), 0.0);
    double top = 0.0;
    for (std::size_t s = 0; s < radii.size(); ++s) top = std::max(top, x[3 * s + 2] + radii[s]);
    // One layer (6 R) may be begun and not full; the rest is on target.
    EXPECT_LT(solid_volume(radii) / (width * depth * top), fraction);
    EXPECT_GT(solid_volume(radii) / (width * depth * (top - 8.0 * 2.5e-3)), fraction);
  }
}

TEST(Rain, SameSeedSameBits) {
  const auto radii = radii_of(3000, false, 3);
  const auto positions = [&](std::uint64_t seed) {
    RandomSource random(seed);
    return rain_positions(radii, 80e-3, 50e-3, true, 0.0, 0.25, random);
  };
  EXPECT_EQ(positions(1), positions(1));
  EXPECT_NE(positions(1), positions(2));
}

TEST(Rain, RefusesWhatDoesNotFit) {
  RandomSource random(1);
  EXPECT_THROW(rain_positions({1.0}, 1.9, 5.0, true, 0.0, 0.25, random), std::invalid_argument);
  EXPECT_THROW(rain_positions({1.0}, 5.0, 1.9, false, 0.0, 0.25, random), std::invalid_argument);
  EXPECT_THROW(rain_positions({1.0}, 5.0, 5.0, true, 0.0, 0.5, random), std::invalid_argument);
  EXPECT_THROW(rain_positions({1.0, -1.0}, 5.0, 5.0, true, 0.0, 0.25, random), std::invalid_argument);
  EXPECT_TRUE(rain_positions({}, 5.0, 5.0, true, 0.0, 0.25, random).empty());
}

void expect_bed(const GrownBed& bed, const std::vector<double>& radii, double width, double depth, bool periodic,
                double porosity) {
  ASSERT_EQ(bed.position.size(), 3 * radii.size());
  EXPECT_NEAR(1.0 - solid_volume(radii) / (width * depth * bed.height), porosity, 1e-12);
  EXPECT_TRUE(bed.reached);
  EXPECT_LE(bed.largest_overlap, 1e-3);
  double worst = largest_overlap(bed.position, radii, width, depth, periodic);
  for (std::size_t s = 0; s < radii.size(); ++s) {
    const double R = radii[s], z = bed.position[3 * s + 2];
    worst = std::max(worst, std::max(R - z, z + R - bed.height) / R);
  }
  // What it says of itself is true; sphere pairs and plates by other code, to rounding (walls: `inside`).
  EXPECT_LE(worst, bed.largest_overlap + 1e-12);
  EXPECT_TRUE(inside(bed.position, radii, width, depth, periodic, 1e-3));
}

TEST(Grow, ReachesPorositiesFromLooseToDense) {
  for (const bool equal : {true, false})
    for (const bool periodic : {true, false})
      for (const double porosity : {0.7, 0.5, 0.45}) {
        SCOPED_TRACE(porosity);
        const auto radii = radii_of(800, equal, 4);
        RandomSource random(9);
        expect_bed(grow_bed(radii, 60e-3, 50e-3, periodic, porosity, random), radii, 60e-3, 50e-3, periodic, porosity);
      }
}

TEST(Grow, DensePeriodicBedOfManySpheres) {
  for (const bool equal : {true, false}) {
    const auto radii = radii_of(4000, equal, 5);
    RandomSource random(10);
    expect_bed(grow_bed(radii, 100e-3, 50e-3, true, 0.42, random), radii, 100e-3, 50e-3, true, 0.42);
  }
}

TEST(Grow, NarrowBoxes) {
  // Little more than two, three and four diameters deep: cells meet their own images there.
  for (const double depth : {11e-3, 16e-3, 21e-3}) {
    SCOPED_TRACE(depth);
    const auto radii = radii_of(200, true, 6);
    RandomSource random(11);
    expect_bed(grow_bed(radii, 40e-3, depth, true, 0.65, random), radii, 40e-3, depth, true, 0.65);
  }
}

TEST(Grow, SaysWhenItCannot) {
  const auto radii = radii_of(500, true, 7);
  RandomSource random(12);
  const GrownBed bed = grow_bed(radii, 40e-3, 40e-3, true, 0.3, random);
  EXPECT_FALSE(bed.reached);
  // Denser than equal spheres can be packed at random: overlaps of several per cent, and it says how large.
  EXPECT_GT(bed.largest_overlap, 0.02);
  EXPECT_GE(bed.largest_overlap, largest_overlap(bed.position, radii, 40e-3, 40e-3, true) - 1e-12);
  EXPECT_NEAR(1.0 - solid_volume(radii) / (40e-3 * 40e-3 * bed.height), 0.3, 1e-12);
}

TEST(Grow, SameSeedSameBits) {
  const auto radii = radii_of(400, false, 8);
  const auto bed = [&](std::uint64_t seed) {
    RandomSource random(seed);
    return grow_bed(radii, 40e-3, 40e-3, true, 0.5, random).position;
  };
  EXPECT_EQ(bed(1), bed(1));
  EXPECT_NE(bed(1), bed(2));
}

TEST(Grow, RefusesImpossibleBeds) {
  RandomSource random(1);
  EXPECT_THROW(grow_bed({1.0}, 5.0, 5.0, true, 0.0, random), std::invalid_argument);
  EXPECT_THROW(grow_bed({1.0}, 5.0, 5.0, true, 1.0, random), std::invalid_argument);
  EXPECT_THROW(grow_bed({1.0}, 3.9, 5.0, true, 0.5, random), std::invalid_argument);
  EXPECT_THROW(grow_bed({1.0}, 5.0, 1.9, false, 0.5, random), std::invalid_argument);
  EXPECT_THROW(grow_bed({1.0}, 50.0, 50.0, true, 0.5, random), std::invalid_argument);  // lower than one diameter
  EXPECT_THROW(grow_bed({1.0, 0.0}, 5.0, 5.0, true, 0.5, random), std::invalid_argument);
  EXPECT_TRUE(grow_bed({}, 5.0, 5.0, true, 0.5, random).reached);
}

}  // namespace
}  // namespace platen
