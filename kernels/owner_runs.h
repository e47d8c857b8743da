// Where each owner's contacts begin in a list [kernels/views.h, PairTargets].
#pragma once

#include "kernels/real.h"
#include "kernels/views.h"

namespace platen {

PLATEN_INLINE std::int32_t first_of(const PairTargets& to) { return (to.first_and_again >> 2) & ~(record_bytes - 1); }
PLATEN_INLINE std::uint8_t again_of(const PairTargets& to) { return static_cast<std::uint8_t>(to.first_and_again); }

// Puts into the targets of `count` contacts, owned by i, ascending, where runs begin. `first`: the batch's first particle;
// `nothing`: place of the record that stays zero, in bytes from the sums, below 2^29.
PLATEN_INLINE void find_owner_runs(const std::int32_t* i, std::int32_t count, std::int32_t first, std::int32_t nothing, PairTargets* to) {
  for (std::int32_t k = 0; k < count; ++k) {
    const bool same = k > 0 && i[k] == i[k - 1];
    to[k].first_and_again = 4 * (same ? nothing : record_bytes * (i[k] - first)) | (same ? 0xff : 0);
  }
}

}  // namespace platen
