// Where one owner's contacts end in a list and the next one's begin [kernels/views.h, PairTargets].
#pragma once

#include "kernels/real.h"
#include "kernels/views.h"

namespace platen {

PLATEN_INLINE std::int32_t last_of(const PairTargets& to) { return (to.last_and_again >> 2) & ~(record_bytes - 1); }
PLATEN_INLINE std::uint8_t again_of(const PairTargets& to) { return static_cast<std::uint8_t>(to.last_and_again); }

// Puts into the targets of `count` contacts, owned by i, ascending, where runs end. `first`: the batch's first particle;
// `spare`: place of the spare records, in bytes from the sums, below 2^29.
PLATEN_INLINE void find_owner_runs(const std::int32_t* i, std::int32_t count, std::int32_t first, std::int32_t spare, PairTargets* to) {
  for (std::int32_t k = 0; k < count; ++k) {
    const bool same = k > 0 && i[k] == i[k - 1];
    // Spare records in turn: an addition to the one used last would wait for it.
    const std::int32_t last = same || k == 0 ? spare + record_bytes * (k % spare_records) : record_bytes * (i[k - 1] - first);
    to[k].last_and_again = 4 * last | (same ? 0xff : 0);
  }
}

}  // namespace platen
