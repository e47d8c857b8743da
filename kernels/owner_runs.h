// Where one owner's contacts end in a list and the next one's begin [kernels/views.h, PairBatch].
#pragma once

#include "kernels/real.h"
#include "kernels/views.h"

namespace platen {

// Fills `again` and `to_last` of `count` contacts that are owned by i, ascending. `first`: the batch's first particle;
// `spare`: place of the spare records, in bytes from the sums.
PLATEN_INLINE void find_owner_runs(const std::int32_t* i, std::int32_t count, std::int32_t first, std::int32_t spare,
                                   std::uint8_t* again, std::int32_t* to_last) {
  for (std::int32_t k = 0; k < count; ++k) {
    const bool same = k > 0 && i[k] == i[k - 1];
    again[k] = same ? 0xff : 0;
    // Spare records in turn: an addition to the one used last would wait for it.
    to_last[k] = same || k == 0 ? spare + record_bytes * (k % spare_records) : record_bytes * (i[k - 1] - first);
  }
}

}  // namespace platen
