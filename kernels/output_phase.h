// Third phase of the contact kernel: contributions become records, records are added up.
#pragma once

#include "kernels/chunk.h"
#include "kernels/rounding.h"

namespace platen {

// Rounds the contributions, turns them into records and adds them up: the owner's by a sum carried from contact to
// contact (consecutive contacts share owners), the partner's in its place. What is carried goes to the owner's place when the
// next owner's first contact comes; before, to a spare record, since a branch would be foreseen too rarely.
template <class I, SceneTraits scene>
PLATEN_INLINE void output_pairs(const Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c,
                                std::int32_t k, typename I::Record& carried) {
  typename I::Record records[Chunk<scene>::sides][I::width];
  for (int side = 0; side < Chunk<scene>::sides; ++side) {
    typename I::Real fields[8];
    chunk.template take_fields<I>(at, side, fields);
    for (int field = 0; field < 7; ++field) fields[field] = rounded<I>(fields[field], c.force);
    I::to_records(fields, records[side]);
  }
  for (int lane = 0; lane < I::width; ++lane) {
    double* last = b.sum + b.to_last[k + lane];
    I::store_record(last, I::add(I::load_record(last), carried));
    carried = I::add_if(b.again[k + lane], carried, records[0][lane]);
    double* partner = b.sum + b.to_j[k + lane];
    I::store_record(partner, I::add_reaction(I::load_record(partner), records[Chunk<scene>::sides - 1][lane]));
  }
}

// Where output stands: contacts that follow each other in the list go on with what is carried; where some are passed over,
// it is brought home first.
template <class I>
class CarriedSum {
 public:
  PLATEN_INLINE typename I::Record& before(const PairBatch& b, std::int32_t k, int count) {
    if (k != next_) bring_home(b);
    next_ = k + count;
    owner_ = record_size * static_cast<std::int64_t>(b.i[next_ - 1] - b.first);
    return carried_;
  }
  PLATEN_INLINE void bring_home(const PairBatch& b) {
    if (next_ == 0) return;
    double* place = b.sum + owner_;
    I::store_record(place, I::add(I::load_record(place), carried_));
    carried_ = I::zero_record();
    next_ = 0;
  }

 private:
  typename I::Record carried_ = I::zero_record();
  std::int32_t next_ = 0;   // contact after the last one; 0: nothing is carried
  std::int64_t owner_ = 0;  // place of the last one's owner, in doubles from `sum`
};

}  // namespace platen
