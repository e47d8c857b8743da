#include "protocol/sphere_facts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "core/particles.h"
#include "protocol/stages/draw_radii.h"

namespace platen {
namespace {

constexpr std::int64_t most_sorted = 10000000;

std::array<double, 3> volume_radii_of(std::vector<double> radii) {
  std::ranges::sort(radii);
  double all = 0.0, below = 0.0;
  for (const double R : radii) all += R * R * R;
  std::array<double, 3> found{};
  std::size_t next = 0;
  for (const double R : radii) {
    below += R * R * R;
    for (; next < 3 && below >= std::array{0.1, 0.5, 0.9}[next] * all; ++next) found[next] = R;
  }
  return found;
}

}  // namespace

SphereFacts sphere_facts(const Case& c) {
  const ParticleSpec& p = c.particles;
  SphereFacts f;
  f.mass_min = f.radius_min = std::numeric_limits<double>::infinity();
  double radius_sum = 0.0;
  std::vector<double> radii;
  const auto add = [&](double R, double rho, double times) {
    const double m = sphere_mass(R, rho);
    f.radius_min = std::min(f.radius_min, R), f.radius_max = std::max(f.radius_max, R);
    f.mass_min = std::min(f.mass_min, m), f.mass_max = std::max(f.mass_max, m);
    radius_sum += times * R, f.mass_total += times * m, f.solid_volume += times * sphere_mass(R, 1.0);
  };
  f.count = p.table ? static_cast<std::int64_t>(p.table->size()) : p.count;
  const bool sorted = f.count <= most_sorted;
  if (p.table) {
    if (sorted) radii = p.table->radius;
    for (std::size_t k = 0; k < p.table->size(); ++k) add(p.table->radius[k], p.table->density[k], 1.0);
  } else if (p.sizes.kind == SizeDistribution::Kind::mono) {
    add(p.sizes.radius, p.density, static_cast<double>(p.count));
  } else {
    // One at a time, as the fill draws them; a billion of them need no memory here.
    RandomSource random(c.seed);
    for (std::int64_t k = 0; k < p.count; ++k) {
      const double R = draw_radius(p.sizes, random);
      add(R, p.density, 1.0);
      if (sorted) radii.push_back(R);
    }
  }
  f.radius_mean = radius_sum / static_cast<double>(f.count);
  f.density = f.mass_total / f.solid_volume;
  f.equal = f.radius_min == f.radius_max && f.mass_min == f.mass_max;
  if (f.radius_min != f.radius_max && !radii.empty()) f.volume_radii = volume_radii_of(std::move(radii));
  return f;
}

double solid_volume(const Case& c) {
  const ParticleSpec& p = c.particles;
  if (p.sizes.kind == SizeDistribution::Kind::mono) return sphere_mass(p.sizes.radius, 1.0) * static_cast<double>(p.count);
  RandomSource random(c.seed);
  double sum = 0.0;
  for (std::int64_t k = 0; k < p.count; ++k) sum += sphere_mass(draw_radius(p.sizes, random), 1.0);
  return sum;
}

std::optional<double> bond_number(const Case& c, const SphereFacts& spheres) {
  const double mean_mass = spheres.mass_total / static_cast<double>(spheres.count);
  if (!(c.gravity > 0.0)) return std::nullopt;
  return std::fabs(c.particles.law.f0) / (mean_mass * c.gravity);
}

}  // namespace platen
