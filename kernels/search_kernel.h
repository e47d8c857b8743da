// Which spheres of a few runs of cells lie near one sphere [core/neighbours.cpp].
#pragma once

#include "kernels/real.h"
#include "kernels/views.h"

namespace platen {

// Writes to `found` those members of `count` ranges that are nearer to the sphere than both reaches together, and that
// come after it or before its batch; returns how many. Up to a vector's width of places behind them are written too.
template <class I>
int search_kernel(const SearchMembers& m, const SearchRange* ranges, int count, const SearchedSphere& sphere, std::int32_t* found) noexcept {
  using Real = typename I::Real;
  const Real reach = I::set(sphere.reach), number = I::set(sphere.particle), first = I::set(sphere.first_of_batch);
  const bool images = m.width > 0.0 || m.depth > 0.0;
  int kept = 0;
  for (int r = 0; r < count; ++r) {
    const SearchRange range = ranges[r];
    const Real x = I::set(range.x), y = I::set(range.y), z = I::set(range.z);
    for (std::int32_t k = range.first; k < range.last; k += I::width) {
      Real dx = x - I::load(m.x + k), dy = y - I::load(m.y + k);
      const Real dz = z - I::load(m.z + k);
      if (images) {
        dx = I::fnma(I::set(m.width), I::round(dx * I::set(m.inverse_width)), dx);
        dy = I::fnma(I::set(m.depth), I::round(dy * I::set(m.inverse_depth)), dy);
      }
      const Real both = reach + I::load(m.reach + k), other = I::load(m.number + k);
      const auto near = I::both((dx * dx + dy * dy) + dz * dz < both * both, I::either(number < other, other < first));
      const std::int32_t left = range.last - k;
      const unsigned lanes = (1u << (left < I::width ? left : I::width)) - 1u;
      kept += I::pack(I::bits(near) & lanes, m.particle + k, found + kept);
    }
  }
  return kept;
}

}  // namespace platen
