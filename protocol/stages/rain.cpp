#include "protocol/stages/rain.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace platen {

namespace {

// Spheres so far, found by place: cells at least as wide as the largest diameter, so that a sphere can only touch
// those in the 27 cells around its own. Cells grow upwards as the rain does.
class Gas {
 public:
  Gas(const std::vector<double>& radii, double largest, double width, double depth, bool periodic, double floor)
      : radii_(radii),
        width_(width),
        depth_(depth),
        periodic_(periodic),
        floor_(floor),
        edge_z_(2.0 * largest),
        nx_(cells(width, edge_z_)),
        ny_(cells(depth, edge_z_)),
        next_(radii.size(), -1) {
    position_.reserve(3 * radii.size());
  }

  bool is_free(double x, double y, double z, double R) const {
    const int cx = column(x, width_, nx_), cy = column(y, depth_, ny_), cz = layer(z);
    for (int k = std::max(cz - 1, 0); k <= std::min(cz + 1, nz_ - 1); ++k)
      for (int b = first(cy, ny_); b <= last(cy, ny_); ++b)
        for (int a = first(cx, nx_); a <= last(cx, nx_); ++a)
          for (int s = head_[index(wrap(a, nx_), wrap(b, ny_), k)]; s >= 0; s = next_[static_cast<std::size_t>(s)]) {
            const auto other = static_cast<std::size_t>(s);
            const double dx = across(x - position_[3 * other], width_),
                         dy = across(y - position_[3 * other + 1], depth_), dz = z - position_[3 * other + 2];
            const double reach = (R + radii_[other]) * (1.0 + 1e-6);  // no touch by rounding
            if (dx * dx + dy * dy + dz * dz < reach * reach) return false;
          }
    return true;
  }

  void add(double x, double y, double z) {
    const int cz = layer(z);
    if (cz >= nz_) {
      nz_ = cz + 1;
      head_.resize(static_cast<std::size_t>(nx_) * static_cast<std::size_t>(ny_) * static_cast<std::size_t>(nz_), -1);
    }
    const std::size_t sphere = position_.size() / 3;
    int& head = head_[index(column(x, width_, nx_), column(y, depth_, ny_), cz)];
    next_[sphere] = head;
    head = static_cast<int>(sphere);
    position_.insert(position_.end(), {x, y, z});
  }

  std::vector<double> take() { return std::move(position_); }

 private:
  static int cells(double length, double edge) {
    return static_cast<int>(std::clamp(std::floor(length / edge), 1.0, 4096.0));
  }
  static int column(double x, double length, int count) {
    return std::clamp(static_cast<int>(x / length * count), 0, count - 1);
  }
  int layer(double z) const { return std::max(0, static_cast<int>((z - floor_) / edge_z_)); }
  // Cells to look through along x or y: a row of fewer than three periodic cells is looked through once.
  int first(int c, int count) const { return periodic_ ? (count < 3 ? 0 : c - 1) : std::max(c - 1, 0); }
  int last(int c, int count) const { return periodic_ ? (count < 3 ? count - 1 : c + 1) : std::min(c + 1, count - 1); }
  static int wrap(int c, int count) { return c < 0 ? c + count : (c >= count ? c - count : c); }
  double across(double d, double length) const {
    if (!periodic_) return d;
    return d > 0.5 * length ? d - length : (d < -0.5 * length ? d + length : d);
  }
  std::size_t index(int a, int b, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(ny_) + static_cast<std::size_t>(b)) *
               static_cast<std::size_t>(nx_) +
           static_cast<std::size_t>(a);
  }

  const std::vector<double>& radii_;
  double width_, depth_;
  bool periodic_;
  double floor_, edge_z_;
  int nx_, ny_, nz_ = 0;
  std::vector<int> head_, next_;  // first sphere of a cell; the sphere after one in its cell; -1 ends
  std::vector<double> position_;  // N x 3
};

}  // namespace

std::vector<double> rain_positions(const std::vector<double>& radii, double width, double depth, bool periodic,
                                   double z_floor, double solid_fraction, RandomSource& random, double z_ceiling) {
  if (radii.empty()) return {};
  const double largest = *std::max_element(radii.begin(), radii.end());
  if (!(*std::min_element(radii.begin(), radii.end()) > 0.0 && std::isfinite(largest)))
    throw std::invalid_argument("rain: radii must be positive");
  if (!(2.0 * largest <= width && 2.0 * largest <= depth))
    throw std::invalid_argument("rain: the box is narrower than the largest sphere");
  if (!(solid_fraction > 0.0 && solid_fraction <= 0.34))
    throw std::invalid_argument("rain: the solid fraction must be between 0 and 0.34");

  // Where nothing is free any more for so many tries, the layer is as good as full.
  constexpr int tries = 2000;
  const double layer_height = 6.0 * largest;
  const double layer_solid = solid_fraction * width * depth * layer_height;
  Gas gas(radii, largest, width, depth, periodic, z_floor);
  double low = z_floor, solid = 0.0;
  for (const double R : radii) {
    const double volume = 4.0 / 3.0 * std::numbers::pi * R * R * R;
    // Half a sphere too much is as good as half a sphere too little.
    while (solid > 0.0 && solid + 0.5 * volume > layer_solid) low += layer_height, solid -= layer_solid;
    const double x0 = periodic ? 0.0 : R, x1 = periodic ? width : width - R;
    const double y0 = periodic ? 0.0 : R, y1 = periodic ? depth : depth - R;
    for (int attempt = 0;; ++attempt) {
      if (attempt == tries) low += layer_height, solid = 0.0, attempt = 0;
      const double z0 = std::max(low, z_floor + 1.05 * R);
      const double z1 = z0 < z_ceiling ? std::min(low + layer_height, z_ceiling) : low + layer_height;
      const double x = x0 + (x1 - x0) * random.uniform(), y = y0 + (y1 - y0) * random.uniform(),
                   z = z0 + (z1 - z0) * random.uniform();
      if (!gas.is_free(x, y, z, R)) continue;
      gas.add(x, y, z);
      solid += volume;
      break;
    }
  }
  return gas.take();
}

}  // namespace platen
