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

// Spheres that the chunk from contact `start` on asks for: rows from first to last_row, records from first to last_record.
struct AskedFor {
  std::int32_t first, last_row, last_record;
};
// The first chunk asks for all between as well. Rows are those of any batch, records of this one alone.
PLATEN_INLINE AskedFor asked_for(const PairBatch& b, std::int32_t start) {
  const auto owner = [&](std::int32_t k) __attribute__((always_inline)) { return b.first + owner_of(b.to[k]); };
  const std::int32_t next = start + chunk_size < b.count ? owner(start + chunk_size) : b.end, last = next + b.ahead;
  return {start > 0 ? owner(start) + b.ahead : owner(start), last < b.spheres ? last : b.spheres, last < b.end ? last : b.end};
}

// With `asks_history` also for the history of contacts some chunks ahead; that of the first and the last few comes unasked.
template <SceneTraits scene>
PLATEN_INLINE void ask_ahead(const PairBatch& b, std::int32_t start) {
  if (b.ahead == 0) return;
  const AskedFor spheres = asked_for(b, start);
  constexpr std::int32_t line = 8;
  for (std::int64_t k = row_size * std::int64_t{spheres.first}; k < row_size * std::int64_t{spheres.last_row}; k += line) __builtin_prefetch(b.rows + k);
  for (std::int32_t k = spheres.first; k < spheres.last_record; ++k) __builtin_prefetch(b.sum + record_size * std::int64_t{k - b.first}, 1);
  if (!b.asks_history) return;
  constexpr std::int32_t chunks_ahead = 3;
  const std::int32_t first = start + chunks_ahead * chunk_size;
  if (first + chunk_size > b.count) return;
  for (std::int32_t k = first; k < first + chunk_size; k += line) {
    for (const double* column : {b.tx, b.ty, b.tz}) __builtin_prefetch(column + k, 1);
    if constexpr (scene.plasticity) __builtin_prefetch(b.sp + k, 1);
    if constexpr (scene.exponent != Exponent::one) __builtin_prefetch(b.k_t_last + k, 1);
  }
}

// Asks, chunk by chunk, for what tasks to come will find in no cache. Of an instruction set I, since it is not inlined: few passes ask,
// and the others are half a per cent slower with it in their loop.
template <class I>
class AskForOthers {
 public:
  // Lines one after the other from `first` on; none: nothing is left.
  struct Piece {
    const char* first;
    std::int64_t lines;
  };

  // What is asked for with one chunk: `of_chunk` lines, from where the chunk before left off.
  [[gnu::noinline]] void chunk(const AskedLines* lines, std::int32_t stretches, std::int32_t of_chunk) {
    for (std::int64_t left = of_chunk; left > 0;) {
      const Piece piece = next(lines, stretches, left);
      if (piece.lines == 0) return;
      // In no function of its own: g++ takes one that does nothing else for one that does nothing, and leaves out its calls
      // [tests/check_prefetches.cmake].
      for (std::int64_t k = 0; k < piece.lines; ++k) __builtin_prefetch(piece.first + 64 * k, 0, 2);  // into the second cache
      left -= piece.lines;
    }
  }
  // At most so many of the lines that come next.
  PLATEN_INLINE Piece next(const AskedLines* lines, std::int32_t stretches, std::int64_t most) {
    while (stretch_ < stretches && line_ == lines[stretch_].count) ++stretch_, line_ = 0;
    if (stretch_ == stretches) return {nullptr, 0};
    const AskedLines& of = lines[stretch_];
    const Piece piece{of.first + 64 * line_, most < of.count - line_ ? most : of.count - line_};
    line_ += piece.lines;
    return piece;
  }

 private:
  std::int32_t stretch_ = 0;
  std::int64_t line_ = 0;
};

}  // namespace platen
