// Third phase of the contact kernel: contributions become records, records are added up.
#pragma once

#include "kernels/chunk.h"
#include "kernels/owner_runs.h"
#include "kernels/rounding.h"

namespace platen {

PLATEN_INLINE double* record_at(double* sum, std::uint32_t bytes) {
  return reinterpret_cast<double*>(reinterpret_cast<char*>(sum) + bytes);
}

// Rounds what the law has not rounded, turns contributions into records and adds them up: the partner's in its place, the owner's by a
// sum carried from contact to contact, since consecutive contacts share owners. A run of contacts begins with what the owner has
// got as a partner of others. What is carried is stored with every contact, since a branch would be foreseen too rarely, and not read back
// within a run, since what was just stored takes a while to read: the other contacts of a run read the record that stays zero.
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
    const std::uint32_t own = own_of(to), begin = again_of(to) != 0 ? static_cast<std::uint32_t>(b.nothing) : own;
    carried = I::add_if(again_of(to), carried, I::add(I::load_sum(record_at(b.sum, begin)), records[0][lane]));
    I::store_record(record_at(b.sum, own), carried);
    double* partner = record_at(b.sum, static_cast<std::uint32_t>(to.partner));
    I::store_record(partner, I::add_reaction(I::load_sum(partner), records[Chunk<scene>::sides - 1][lane]));
  }
}

// What is carried to contact k where it does not follow the one before: all that its owner has got.
template <class I>
PLATEN_INLINE typename I::Record taken_up(const PairBatch& b, std::int32_t k) {
  return I::load_sum(record_at(b.sum, own_of(b.to[k])));
}

}  // namespace platen
