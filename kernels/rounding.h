// Contributions rounded so that their sums do not depend on order.
#pragma once

#include "kernels/twice.h"
#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

template <class I>
PLATEN_INLINE typename I::Real rounded(typename I::Real x, const Quantum& q) {
  const typename I::Real magic = I::set(q.magic);
  return (x + magic) - magic;
}

template <class I>
PLATEN_INLINE Vec3<I> rounded(const Vec3<I>& a, const Quantum& q) {
  return {rounded<I>(a.x, q), rounded<I>(a.y, q), rounded<I>(a.z, q)};
}

// Forces and torques are rounded by the law where that works on two vectors at once: its multiplications leave the units idle that
// add, which the output phase keeps busy. Elsewhere the output phase does it [docs/decisions.md, "Who rounds"].
template <class I>
PLATEN_INLINE Vec3<I> rounded_by_law(const Vec3<I>& a, const Quantum& q) {
  if constexpr (interleaved<I>)
    return rounded<I>(a, q);
  else
    return a;
}

}  // namespace platen
