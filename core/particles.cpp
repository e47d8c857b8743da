#include "core/particles.h"

#include <algorithm>
#include <cstring>

#include "kernels/views.h"

namespace platen {

double sphere_mass(double R, double rho) { return 4.0 / 3.0 * 3.14159265358979323846 * (R * R * R) * rho; }

void Particles::resize(std::int32_t n, bool equal_spheres) {
  count = n;
  padded = (n + padding - 1) / padding * padding;
  equal = equal_spheres;
  const auto size = static_cast<std::size_t>(padded);
  for (auto* column : {&x, &y, &z, &vx, &vy, &vz, &ux, &uy, &uz}) column->assign(size, 0.0);
  for (auto* column : {&radius, &inverse_radius, &mass, &inverse_mass}) column->assign(equal ? 0 : size, 1.0);
  rows.assign(size * row_size, 0.0);
  rank.assign(size, -1);
  image.assign(2 * size, 0);
  crossed.assign(2 * size, 0);
}

std::vector<std::int32_t> Particles::places() const {
  std::vector<std::int32_t> place(static_cast<std::size_t>(count));
  for (std::int32_t k = 0; k < count; ++k) place[static_cast<std::size_t>(rank[static_cast<std::size_t>(k)])] = k;
  return place;
}

void Particles::keep_crossings(std::int32_t first, std::int32_t spheres) {
  constexpr std::size_t at_once = sizeof(std::uint64_t);
  static_assert(2 * padding % at_once == 0);  // batches are whole vectors
  const auto end = 2 * static_cast<std::size_t>(first + spheres);
  for (auto k = 2 * static_cast<std::size_t>(first); k < end; k += at_once) {
    std::uint64_t eight;
    std::memcpy(&eight, crossed.data() + k, at_once);
    if (eight == 0) continue;  // nearly always
    for (std::size_t m = k; m < k + at_once; ++m) image[m] += crossed[m];
    std::memset(crossed.data() + k, 0, at_once);
  }
}

void Particles::permute(const std::vector<std::int32_t>& order, const ParallelFor& parallel) {
  const std::size_t n = order.size();
  AlignedArray<double> scratch;
  scratch.assign(static_cast<std::size_t>(padded), 0.0);
  const auto reorder = [&](AlignedArray<double>& column) {
    for_each_in_stretches(n, parallel, [&](std::size_t k) { scratch[k] = column[static_cast<std::size_t>(order[k])]; });
    std::copy(column.begin() + static_cast<std::ptrdiff_t>(n), column.end(), scratch.begin() + static_cast<std::ptrdiff_t>(n));
    column.swap(scratch);
  };
  for (auto* column : {&x, &y, &z, &vx, &vy, &vz, &ux, &uy, &uz}) reorder(*column);
  if (!equal)
    for (auto* column : {&radius, &inverse_radius, &mass, &inverse_mass}) reorder(*column);
  PooledVector<std::int32_t> ranks(n), images(2 * n);
  for_each_in_stretches(n, parallel, [&](std::size_t k) {
    const auto from = static_cast<std::size_t>(order[k]);
    ranks[k] = rank[from];
    images[2 * k] = boxes(from, 0);
    images[2 * k + 1] = boxes(from, 1);
  });
  for_each_in_stretches(n, parallel, [&](std::size_t k) {
    rank[k] = ranks[k];
    image[2 * k] = images[2 * k];
    image[2 * k + 1] = images[2 * k + 1];
  });
  std::fill(crossed.begin(), crossed.end(), std::int8_t{0});
  write_rows(parallel);
}

void Particles::write_rows(const ParallelFor& parallel) {
  for_each_in_stretches(static_cast<std::size_t>(padded), parallel, [this](std::size_t k) {
    double* row = rows.data() + row_size * k;
    const double R = equal ? common_radius : radius[k];
    row[0] = x[k], row[1] = y[k], row[2] = z[k], row[3] = R;
    row[4] = vx[k], row[5] = vy[k], row[6] = vz[k], row[7] = equal ? common_mass : mass[k];
    row[8] = ux[k], row[9] = uy[k], row[10] = uz[k], row[11] = 1.0 / R;
  });
}

}  // namespace platen
