// What the contacts of a chunk to come will fetch is asked for now.
//
// The curve goes through the bed layer by layer, so a sphere's partners are close to it on the curve, or one layer ahead, in no
// order that a processor foresees. But those that nobody has met yet lie in a row:
//
//     the curve   ... | met by those before | this chunk's owners | ... | a layer ahead: their partners | asked for now | ...
//                                           i                                                           i + ahead
#pragma once

#include "kernels/output_phase.h"

namespace platen {

// Rows and records; the first chunk asks for all between. With `asks_history` also for the history of contacts some chunks ahead.
template <SceneTraits scene>
PLATEN_INLINE void ask_ahead(const PairBatch& b, std::int32_t start) {
  if (b.ahead == 0) return;
  const std::int32_t next = start + chunk_size < b.count ? b.i[start + chunk_size] : b.end;
  const std::int32_t from = start > 0 ? b.i[start] + b.ahead : b.i[start], to = next + b.ahead;
  const std::int32_t last_row = to < b.spheres ? to : b.spheres, last_record = to < b.end ? to : b.end;
  constexpr std::int32_t line = 8;
  for (std::int64_t k = row_size * std::int64_t{from}; k < row_size * std::int64_t{last_row}; k += line) __builtin_prefetch(b.rows + k);
  for (std::int32_t k = from; k < last_record; ++k) __builtin_prefetch(b.sum + record_size * std::int64_t{k - b.first}, 1);
  if (!b.asks_history) return;
  constexpr std::int32_t chunks_ahead = 3;
  const std::int32_t first = start + chunks_ahead * chunk_size;
  if (first + chunk_size > b.count) return;
  for (std::int32_t k = first; k < first + chunk_size; k += line) {
    for (const double* column : {b.tx, b.ty, b.tz}) __builtin_prefetch(column + k, 1);
    if constexpr (scene.plasticity) __builtin_prefetch(b.sp + k, 1);
  }
}

}  // namespace platen
