#include "core/morton_order.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace platen {

namespace {

std::uint64_t spread(std::uint64_t v) {  // 8 bits, two zeros between each
  v &= 0xff;
  v = (v | v << 8) & 0x00f00f;
  v = (v | v << 4) & 0x0c30c3;
  v = (v | v << 2) & 0x249249;
  return v;
}

// One direction of the bed, cut into equal parts.
class Cuts {
 public:
  Cuts() = default;
  Cuts(const AlignedArray<double>& x, std::int32_t count) {
    if (count == 0) return;
    const auto [low, high] = std::minmax_element(x.begin(), x.begin() + count);
    low_ = *low, extent_ = width_ = *high - *low;
    per_ = extent_ > 0.0 ? 1.0 / extent_ : 0.0;
  }
  double extent() const { return extent_; }
  double width() const { return width_; }
  int parts() const { return parts_; }
  void cut(double parts, int most) {
    parts_ = static_cast<int>(std::clamp(std::round(parts), 1.0, static_cast<double>(most)));
    width_ = extent_ / parts_, per_ = extent_ > 0.0 ? parts_ / extent_ : 0.0;
  }
  int part(double x) const { return std::min(static_cast<int>(std::max(0.0, (x - low_) * per_)), parts_ - 1); }
  double from_edge(double x, int part) const { return std::max(0.0, x - low_ - part * width_); }

 private:
  double low_ = 0.0, extent_ = 0.0;
  double width_ = 0.0, per_ = 0.0;  // of a part, and its inverse
  int parts_ = 1;
};

// Layers are numbered along one axis, and back again in every other bar.
class Sweep {
 public:
  Sweep(const Particles& p, int layer) : p_(p), axes_{Cuts(p.x, p.count), Cuts(p.y, p.count), Cuts(p.z, p.count)} {
    along_ = axes_[1].extent() > 1.01 * axes_[0].extent() ? 1 : 0;  // a square base: x, whatever the last digits say
    across_ = 1 - along_;
    Cuts &along = axes_[along_], &across = axes_[across_], &up = axes_[2];
    const double volume = along.extent() * across.extent() * up.extent();
    const double apart = std::cbrt(volume / std::max(p.count, 1));  // spheres from each other
    if (apart > 0.0) {  // else the bed is flat, and one layer
      along.cut(along.extent() / apart, most_layers);
      // Bars with a section as nearly square as can be.
      const double in_layer = static_cast<double>(p.count) / along.parts();
      const double bars = std::max(1.0, in_layer / (layer > 0 ? layer : in_layer > 3000.0 ? 1000 : 500));
      const double section = across.extent() * up.extent() / bars;
      across.cut(std::min(bars, across.extent() / std::sqrt(section)), most_bars);
      up.cut(across.width() * up.extent() / section, most_bars);
    }
    const double widest = std::max({along.width(), across.width(), up.width()});
    fine_ = widest > 0.0 ? 255.0 / widest : 0.0;
  }

  std::uint64_t key(std::size_t k) const {
    const double x[3] = {p_.x[k], p_.y[k], p_.z[k]};
    int part[3];
    std::uint64_t inside = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const Cuts& cuts = axes_[axis];
      part[axis] = cuts.part(x[axis]);
      inside |= spread(static_cast<std::uint64_t>(std::min(255.0, cuts.from_edge(x[axis], part[axis]) * fine_))) << axis;
    }
    const bool up_odd = part[2] & 1;
    const int bar = part[2] * axes_[across_].parts() + (up_odd ? axes_[across_].parts() - 1 - part[across_] : part[across_]);
    const int layer = bar & 1 ? axes_[along_].parts() - 1 - part[along_] : part[along_];
    return (static_cast<std::uint64_t>(bar) * most_layers + static_cast<std::uint64_t>(layer)) << inside_bits | inside;
  }

  static constexpr int inside_bits = 24, layer_bits = 11, bar_bits = 9;  // one more than 256 bars need, for whole digits

 private:
  static constexpr int most_layers = 1 << layer_bits, most_bars = 16;  // in each of two directions
  static_assert(most_bars * most_bars <= 1 << bar_bits);
  const Particles& p_;
  Cuts axes_[3];
  int along_ = 0, across_ = 1;
  double fine_ = 0.0;  // inverse width of the curve's cells
};

}  // namespace

std::vector<std::int32_t> morton_order(const Particles& particles, int layer, const ParallelFor& parallel) {
  const auto n = static_cast<std::size_t>(particles.count);
  const Sweep sweep(particles, layer);
  PooledVector<std::uint64_t> keys(n), other_keys(n);
  std::vector<std::int32_t> order(n), other_order(n);
  for_each_in_stretches(n, parallel, [&](std::size_t k) { keys[k] = sweep.key(k), order[k] = static_cast<std::int32_t>(k); });
  // Digit by digit from the last. Each stretch counts its own, then puts them behind those of the stretches before.
  constexpr int digit_bits = 11, digits = 1 << digit_bits, passes = (Sweep::inside_bits + Sweep::layer_bits + Sweep::bar_bits) / digit_bits;
  static_assert(passes * digit_bits == Sweep::inside_bits + Sweep::layer_bits + Sweep::bar_bits);
  const int parts = stretches_of(n);
  std::vector<std::array<std::uint32_t, digits + 16>> start(static_cast<std::size_t>(parts));  // a little more: counters of one digit in different sets of the cache
  for (int pass = 0; pass < passes; ++pass) {
    const auto digit = [&](std::uint64_t key) { return static_cast<std::size_t>(key >> (digit_bits * pass) & (digits - 1)); };
    parallel(parts, [&](int part) {
      auto& own = start[static_cast<std::size_t>(part)];
      own.fill(0);
      const IndexRange range = stretch(n, part);
      for (std::size_t k = range.first; k < range.last; ++k) ++own[digit(keys[k])];
    });
    std::uint32_t before = 0;
    for (std::size_t d = 0; d < digits; ++d)
      for (auto& of_part : start) before += std::exchange(of_part[d], before);
    parallel(parts, [&](int part) {
      auto& own = start[static_cast<std::size_t>(part)];
      const IndexRange range = stretch(n, part);
      for (std::size_t k = range.first; k < range.last; ++k) {
        const std::uint32_t to = own[digit(keys[k])]++;
        other_keys[to] = keys[k];
        other_order[to] = order[k];
      }
    });
    keys.swap(other_keys), order.swap(other_order);
  }
  return order;
}

}  // namespace platen
