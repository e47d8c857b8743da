// Contributions rounded so that their sums do not depend on order.
#pragma once

#include "kernels/real.h"
#include "kernels/views.h"

namespace platen {

template <class I>
PLATEN_INLINE typename I::Real rounded(typename I::Real x, const Quantum& q) {
  const typename I::Real magic = I::set(q.magic);
  return (x + magic) - magic;
}

}  // namespace platen
