// What a batch will meet for the first time some chunks from now is asked for now. Partners lie a layer or two ahead on the
// curve, or in other batches: where no cache at hand holds the bed no processor foresees it, and the contacts would wait.
#pragma once

#include "kernels/output_phase.h"

namespace platen {

// Two lines of each newcomer's row, and its record where the list is dense, so that most records will be needed.
PLATEN_INLINE void ask_ahead(const PairBatch& b, std::int32_t start) {
  if (b.newcomers == nullptr) return;
  const std::int32_t* before = b.newcomers_before + start / chunk_size + chunks_ahead;
  const std::int32_t end = before[1];
  for (std::int32_t k = before[0]; k < end; k += newcomer_padding)
    for (int m = 0; m < newcomer_padding; ++m) {
      const Newcomer& newcomer = b.newcomers[k + m];
      const double* row = b.rows + newcomer.row;
      __builtin_prefetch(row), __builtin_prefetch(row + record_size);
      if (b.dense) __builtin_prefetch(record_at(b.sum, newcomer.record), 1);
    }
}

}  // namespace platen
