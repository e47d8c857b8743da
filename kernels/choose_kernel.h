// Which pairs of an outer list belong into the inner one [core/contacts.cpp].
#pragma once

#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

// `width` pairs: those whose spheres are closer than their radii and margins, a bit each.
template <class I>
PLATEN_INLINE unsigned closer(const ChooseBatch& b, const std::int32_t* i, const std::int32_t* j) {
  using Real = typename I::Real;
  Real own[4], other[4];  // x y z R
  I::template fetch_rows<row_size>(b.rows, i, own);
  I::template fetch_rows<row_size>(b.rows, j, other);
  const Real dx = nearest_image<I>(own[0] - other[0], b.width, b.inverse_width), dy = nearest_image<I>(own[1] - other[1], b.depth, b.inverse_depth);
  const Real dz = own[2] - other[2], reach = (own[3] + I::gather_floats(b.margin, i)) + (other[3] + I::gather_floats(b.margin, j));
  return I::bits((dx * dx + dy * dy) + dz * dz < reach * reach);
}

template <class I>
void choose_kernel(const ChooseBatch& b) noexcept {
  std::uint64_t bits = 0;
  for (std::int64_t k = 0; k < b.count; k += I::width) {
    const std::int64_t left = b.count - k;
    if (left >= I::width) {
      bits |= std::uint64_t{closer<I>(b, b.i + k, b.j + k)} << (k % 64);
    } else {
      std::int32_t i[I::width], j[I::width];
      for (std::int64_t lane = 0; lane < I::width; ++lane) i[lane] = b.i[lane < left ? k + lane : k], j[lane] = b.j[lane < left ? k + lane : k];
      bits |= std::uint64_t{closer<I>(b, i, j) & ((1u << left) - 1u)} << (k % 64);
    }
    if ((k + I::width) % 64 == 0 || left <= I::width) b.chosen[k / 64] = bits, bits = 0;
  }
}

}  // namespace platen
