// Between the two halves of the fetch: which pairs of a chunk have anything to say.
#pragma once

#include "kernels/chunk.h"
#include "kernels/owner_runs.h"
#include "kernels/twice.h"

namespace platen {

// The vectors of a chunk in which something is to be found: where a pair touches, or may have touched at the last step, in
// which case it may have a history to forget and energy to account for. In a bed these are all of them and nearly all their
// pairs, in a rain a pair here and there.
struct ActiveVectors {
  int at[chunk_size];
  unsigned lanes[chunk_size];  // of each, a bit for each pair with something to it; all set where most have
  int count = 0;
  int pairs = 0;               // bits set
};

// Which these are. No pair can have parted farther in the last step than `leap`, so one that is farther apart did not touch
// then, and its history was cleared in the step in which it parted. A pair whose place is no number counts, and so
// does padding, which has no distance: law and output mask it.
template <class I, SceneTraits scene>
PLATEN_INLINE void find_active(const Chunk<scene>& chunk, const PairBatch& b, int count, ActiveVectors& active) {
  constexpr unsigned all = I::width < 32 ? (1u << I::width) - 1u : ~0u;
  active.count = active.pairs = 0;
  for (int at = 0; at < count; at += I::width) {
    unsigned lanes = I::bits(I::negate(I::load(chunk.delta + at) < I::set(-b.leap)));
    if (2 * __builtin_popcount(lanes) > I::width) lanes = all;
    active.at[active.count] = at;
    active.lanes[active.count] = lanes;
    active.count += lanes != 0;
    active.pairs += __builtin_popcount(lanes);
  }
}

// All vectors of a chunk of `count` pairs; not their `lanes`, which only who draws pairs together reads.
template <class I>
PLATEN_INLINE void take_all(int count, ActiveVectors& active) {
  active.count = 0, active.pairs = count;
  for (int at = 0; at < count; at += I::width) active.at[active.count++] = at;
}

// The active pairs of a chunk drawn together, where they would fill half as many vectors or fewer: columns move to the
// front of the chunk, history and indices into arrays of their own, which `view` shows to law and output. What is left
// out is apart, was apart and has no history, so it has no force and stays as it is.
//
//   pairs of the chunk  . a . . . b . . . . c . . d . .        a b c d - - - -        in the chunk, and in `view`
//                                                              (-: padding, apart)
template <class I, SceneTraits scene>
class GatheredPairs {
 public:
  static constexpr bool worth(const ActiveVectors& active) {
    return I::width > 1 && active.count > 0 && 2 * ((active.pairs + I::width - 1) / I::width) <= active.count;
  }

  // Gathers; `active` then describes what is gathered, but for its `lanes`.
  void take(Chunk<scene>& chunk, const PairBatch& b, std::int32_t start, ActiveVectors& active) {
    int n = 0;
    for (int m = 0; m < active.count; ++m)
      for (unsigned lanes = active.lanes[m]; lanes != 0; lanes &= lanes - 1) {
        const int at = active.at[m] + __builtin_ctz(lanes);
        const std::int32_t k = start + at;
        chunk.move(n, at);
        from_[n] = k, i_[n] = b.first + owner_of(b.to[k]), row_j_[n] = b.row_j[k], to_[n].partner = b.to[k].partner;
        tx_[n] = b.tx[k], ty_[n] = b.ty[k], tz_[n] = b.tz[k];
        if constexpr (scene.plasticity) sp_[n] = b.sp[k];
        if constexpr (scene.exponent != Exponent::one) k_t_last_[n] = b.k_t_last[k];
        ++n;
      }
    count_ = n;
    active.count = 0, active.pairs = n;
    for (int at = 0; at < n; at += I::width) active.at[active.count++] = at;
    for (; n % I::width != 0; ++n) {  // never entered with n = 0, so that n - 1 is a pair
      chunk.move(n, n - 1);
      chunk.delta[n] = -1.0;
      i_[n] = i_[n - 1], row_j_[n] = row_size * i_[n], to_[n].partner = record_bytes * (i_[n] - b.first);
      tx_[n] = ty_[n] = tz_[n] = sp_[n] = k_t_last_[n] = 0.0;
    }
    find_owner_runs(i_, n, b.first, to_);
    if constexpr (SingleOf<I>::Type::picks) find_owners(i_, n, b.first, b.end, owners_);
  }

  PairBatch view(const PairBatch& b) {
    PairBatch v = b;
    v.row_j = row_j_, v.to = to_, v.owners = owners_;
    v.tx = tx_, v.ty = ty_, v.tz = tz_, v.sp = sp_, v.k_t_last = k_t_last_;
    return v;
  }

  void give_back(const PairBatch& b) const {
    for (int n = 0; n < count_; ++n) {
      const std::int32_t k = from_[n];
      b.tx[k] = tx_[n], b.ty[k] = ty_[n], b.tz[k] = tz_[n];
      if constexpr (scene.plasticity) b.sp[k] = sp_[n];
      if constexpr (scene.exponent != Exponent::one) b.k_t_last[k] = k_t_last_[n];
    }
  }

 private:
  using Column = typename Chunk<scene>::Column;
  alignas(64) Column tx_, ty_, tz_, sp_, k_t_last_;
  alignas(64) std::int32_t from_[chunk_size], i_[chunk_size], row_j_[chunk_size];
  alignas(64) PairTargets to_[chunk_size];
  OwnersOfEight owners_[chunk_size / 8];
  int count_ = 0;
};

}  // namespace platen
