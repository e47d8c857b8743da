// Third phase of the contact kernel: contributions become records, records are added up.
#pragma once

#include "kernels/chunk.h"
#include "kernels/rounding.h"

namespace platen {

// Rounds the contributions, turns them into records and adds them up: the owner's by a sum carried from contact to
// contact (consecutive contacts share owners), the partner's into its slot. No partner of a run of contacts is their
// owner, so what is carried misses nothing.
template <class I, SceneTraits scene>
PLATEN_INLINE void output_pairs(const Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c,
                                std::int32_t k, const double* nothing, typename I::Record& carried, std::int32_t& owner) {
  typename I::Record records[Chunk<scene>::sides][I::width];
  for (int side = 0; side < Chunk<scene>::sides; ++side) {
    typename I::Real fields[8];
    chunk.template take_fields<I>(at, side, fields);
    for (int field = 0; field < 7; ++field) fields[field] = rounded<I>(fields[field], c.force);
    I::to_records(fields, records[side]);
  }
  for (int lane = 0; lane < I::width; ++lane) {
    const std::int32_t i = b.i[k + lane];
    double* own = b.sum + record_size * static_cast<std::int64_t>(i - b.first);
    // Of a new owner the sum so far is loaded. Of the old one it must not be, even in vain: it would wait for the last
    // store to the same place.
    const bool again = i == owner;
    const auto place = reinterpret_cast<std::uintptr_t>(own), none = reinterpret_cast<std::uintptr_t>(nothing);
    const auto* so_far = reinterpret_cast<const double*>(place ^ ((place ^ none) & (std::uintptr_t{0} - again)));
    carried = I::add(I::select(again, carried, I::load_record(so_far)), records[0][lane]);
    owner = i;
    I::store_record(own, carried);
    double* slot = b.sum + record_size * static_cast<std::int64_t>(b.slot_j[k + lane]);
    I::store_record(slot, I::add_reaction(I::load_record(slot), records[Chunk<scene>::sides - 1][lane]));
  }
}

}  // namespace platen
