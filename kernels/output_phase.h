// Third phase of the contact kernel: contributions become records, records are added up.
#pragma once

#include "kernels/chunk.h"
#include "kernels/owner_runs.h"
#include "kernels/rounding.h"

namespace platen {

PLATEN_INLINE double* record_at(double* sum, std::int32_t bytes) {
  return reinterpret_cast<double*>(reinterpret_cast<char*>(sum) + bytes);
}

// Rounds what the law has not rounded, turns contributions into records and adds them up: the owner's by a sum carried from contact to
// contact (consecutive contacts share owners), the partner's in its place. What is carried goes to the owner's place when the
// next owner's first contact comes; before, to a spare record, since a branch would be foreseen too rarely.
template <class I, SceneTraits scene>
PLATEN_INLINE void output_pairs(const Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c,
                                std::int32_t k, typename I::Record& carried) {
  typename I::Record records[Chunk<scene>::sides][I::width];
  for (int side = 0; side < Chunk<scene>::sides; ++side) {
    typename I::Real fields[8];
    chunk.template take_fields<I>(at, side, fields);
    for (int field = 0; field < 7; ++field)
      if (!interleaved<I> || field == 3) fields[field] = rounded<I>(fields[field], c.force);  // the others: rounded_by_law
    I::to_records(fields, records[side]);
  }
  for (int lane = 0; lane < I::width; ++lane) {
    const PairTargets to = b.to[k + lane];
    double* last = record_at(b.sum, last_of(to));
    I::store_record(last, I::add(I::load_record(last), carried));
    carried = I::add_if(again_of(to), carried, records[0][lane]);
    double* partner = record_at(b.sum, to.partner);
    I::store_record(partner, I::add_reaction(I::load_record(partner), records[Chunk<scene>::sides - 1][lane]));
  }
}

// Adds what is carried to the owner of the contact before `next`; 0: nothing is carried. Contacts that follow each other in
// the list go on with what is carried; where some are passed over, it is brought home first.
template <class I>
PLATEN_INLINE void bring_home(const PairBatch& b, std::int32_t next, typename I::Record& carried) {
  if (next == 0) return;
  double* place = b.sum + record_size * static_cast<std::int64_t>(b.i[next - 1] - b.first);
  I::store_record(place, I::add(I::load_record(place), carried));
  carried = I::zero_record();
}

}  // namespace platen
