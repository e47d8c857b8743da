// One pass over the pairs that a batch owns: fetch -> law -> output [docs/architecture.md, "The contact kernel"].
#pragma once

#include "kernels/active_pairs.h"
#include "kernels/ask_ahead.h"
#include "kernels/fetch_phase.h"
#include "kernels/law_phase.h"
#include "kernels/output_phase.h"
#include "kernels/staged_owners.h"

namespace platen {

// Six loops over each chunk, and after the first, unless the list is dense, the choice of pairs, instead of one with everything in it: a processor looks a few hundred instructions ahead,
// so only short bodies let the next contacts begin while the last ones wait for their results.
template <class I, SceneTraits scene, bool exact, bool guarded = true>
void contact_kernel(const PairBatch& batch, const LawConstants& constants, PairTotals& totals) noexcept {
  using Wide = typename Interleaved<I>::Type;
  const PairBatch b = with_staged_owners<I, scene>(batch);  // copies, which no store through a pointer can change
  const LawConstants c = constants;
  typename I::Record carried = I::zero_record();
  std::int32_t next = 0;  // contact after the last one whose owner's sum is carried; -1: none
  bool fine = true;
  Chunk<scene> chunk;
  GatheredPairs<Wide, scene> gathered;
  typename I::Real shortest_lever = I::set(1.0);
  ActiveVectors active;
  AskForOthers<I> others;
  for (std::int32_t start = 0; start < b.count; start += chunk_size) {
    const int count = start + chunk_size < b.count ? chunk_size : b.count - start;
    ask_ahead<scene>(b, start);
    if (b.stretches != 0) others.chunk(b.lines, b.stretches, b.lines_of_chunk);
    if (c.width > 0.0)
      for (int at = 0; at < count; at += I::width) fetch_geometry<I, scene, exact, true>(chunk, at, b, c, start + at);
    else
      for (int at = 0; at < count; at += I::width) fetch_geometry<I, scene, exact, false>(chunk, at, b, c, start + at);
    if (!b.dense)
      find_active<Wide, scene>(chunk, b, count, active);
    else if (active.pairs != count)
      take_all<Wide>(count, active);
    const bool few = !b.dense && GatheredPairs<Wide, scene>::worth(active);
    if (few) {
      gathered.take(chunk, b, start, active);
      next = 0;  // its first contact begins a run
    }
    const PairBatch seen = few ? gathered.view(b) : b;
    const std::int32_t first = few ? 0 : start;
    for (int m = 0; m < active.count; ++m)
      for (int at = active.at[m]; at < active.at[m] + Wide::width; at += I::width) {
        const auto lever = fetch_motion<I, scene>(chunk, at, seen, c, first + at);
        // Padding of the list, whose lever is no number, leaves the second operand as it is.
        if constexpr (guarded) shortest_lever = I::min(lever, shortest_lever);
      }
    fine = law_of_chunk<Wide, scene, exact, guarded>(chunk, seen, c, first, active, totals) && fine;
    // An overlap above R, the centre of one sphere deep inside the other, is no contact any more: a lever below 1/2.
    // Forces are looked at only where overlaps let them be too large [docs/decisions.md, "Guards where overlaps are deep"].
    if (guarded && I::any(shortest_lever < I::set(c.watched_lever))) {
      fine = fine && !I::any(shortest_lever < I::set(0.5)) && !too_strong<Wide, scene>(chunk, active, c.force, c.watched_lever);
      shortest_lever = I::set(1.0);
    }
    for (int m = 0; m < active.count; ++m) {
      if (first + active.at[m] != next) carried = taken_up<I>(seen, first + active.at[m]);
      for (int at = active.at[m]; at < active.at[m] + Wide::width; at += I::width)
        output_pairs<I, scene>(chunk, at, seen, c, first + at, carried);
      next = first + active.at[m] + Wide::width;
    }
    if (few) {
      next = -1;
      gathered.give_back(b);
    }
  }
  totals.out_of_range = totals.out_of_range || !fine;
}

}  // namespace platen
