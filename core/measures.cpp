#include "core/measures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace platen {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// Row of a particle in fields sorted by id; -1 when there is none.
std::ptrdiff_t row_of(const std::vector<std::int64_t>& ids, std::int64_t id) {
  const auto found = std::lower_bound(ids.begin(), ids.end(), id);
  return found != ids.end() && *found == id ? found - ids.begin() : -1;
}

// Touching sphere pairs of each particle, in the order of the fields.
std::vector<int> contacts_of_each(const Snapshot& snapshot) {
  const auto& ids = snapshot.particles.id;
  std::vector<int> contacts(ids.size(), 0);
  for (const std::int64_t id : snapshot.contacts.pair) {
    const std::ptrdiff_t row = row_of(ids, id);
    if (row >= 0) ++contacts[static_cast<std::size_t>(row)];
  }
  return contacts;
}

}  // namespace

// Integral of pi (R^2 - t^2) over the height t above the centre: (t1 - t0) pi (R^2 - (t1^2 + t1 t0 + t0^2)/3).
double sphere_segment_volume(double R, double z, double a, double b) {
  const double t0 = std::clamp(a - z, -R, R), t1 = std::clamp(b - z, -R, R);
  if (!(t1 > t0)) return 0.0;
  return std::numbers::pi * (t1 - t0) * (R * R - (t1 * t1 + t1 * t0 + t0 * t0) / 3.0);
}

Profile profile(const Snapshot& snapshot, double area, int slabs) {
  Profile result;
  const double z_bottom = snapshot.z_bottom, height = snapshot.z_top - z_bottom;
  if (slabs <= 0) return result;
  const auto count = static_cast<std::size_t>(slabs);
  result.z.assign(count, nan);
  result.porosity.assign(count, nan);
  result.coordination_number.assign(count, nan);
  if (!(height > 0.0)) return result;

  const auto edge = [&](std::size_t k) { return z_bottom + height * static_cast<double>(k) / slabs; };
  const auto slab_at = [&](double z) {  // of a height; clamped, so that the top edge belongs to the last slab
    const double slab = std::floor((z - z_bottom) / height * slabs);
    return static_cast<std::size_t>(std::clamp(slab, 0.0, static_cast<double>(slabs - 1)));
  };

  const ParticleFields& particles = snapshot.particles;
  const std::vector<int> contacts = contacts_of_each(snapshot);
  std::vector<double> solid(count, 0.0), ends(count, 0.0), centres(count, 0.0);
  for (std::size_t p = 0; p < particles.size(); ++p) {
    const double R = particles.radius[p], z = particles.position[3 * p + 2];
    // Where rounding chooses a neighbouring slab, the share that is missed is itself of the size of rounding.
    const std::size_t lowest = slab_at(z - R), highest = slab_at(z + R);
    for (std::size_t k = lowest; k <= highest; ++k) solid[k] += sphere_segment_volume(R, z, edge(k), edge(k + 1));
    if (z < z_bottom || z > snapshot.z_top) continue;
    const std::size_t own = slab_at(z);
    ends[own] += contacts[p];
    centres[own] += 1.0;
  }
  const double slab_volume = area * height / slabs;
  for (std::size_t k = 0; k < count; ++k) {
    result.z[k] = z_bottom + height * (static_cast<double>(k) + 0.5) / slabs;
    if (area > 0.0) result.porosity[k] = 1.0 - solid[k] / slab_volume;
    if (centres[k] > 0.0) result.coordination_number[k] = ends[k] / centres[k];
  }
  return result;
}

double bulk_porosity(const ParticleFields& particles, double area, double z_bottom, double z_top) {
  const double volume = area * (z_top - z_bottom);
  if (!(volume > 0.0)) return nan;
  double cubes = 0.0;
  for (const double R : particles.radius) cubes += R * R * R;
  return 1.0 - 4.0 / 3.0 * std::numbers::pi * cubes / volume;
}

}  // namespace platen
