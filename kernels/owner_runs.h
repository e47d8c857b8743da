// Whose each contact is, where that owner's sum is, and where its contacts begin in a list [kernels/views.h, PairTargets].
#pragma once

#include "kernels/real.h"
#include "kernels/views.h"

namespace platen {

PLATEN_INLINE std::uint32_t own_of(const PairTargets& to) { return to.own_and_again >> 8; }
PLATEN_INLINE std::uint8_t again_of(const PairTargets& to) { return static_cast<std::uint8_t>(to.own_and_again); }
// The owner itself, counted from the batch's first particle.
PLATEN_INLINE std::int32_t owner_of(const PairTargets& to) { return static_cast<std::int32_t>(to.own_and_again >> 14); }
// Its row, in doubles from that of the batch's first particle: 12 times the owner, in as many instructions as if a list had named it.
PLATEN_INLINE std::int32_t owner_row(const PairTargets& to) {
  static_assert(row_size == 3 * 4 && record_bytes == 64);
  return static_cast<std::int32_t>(3 * (to.own_and_again >> 12));
}

// Puts that into the targets of `count` contacts, owned by i, ascending. `first`: the batch's first particle, less than
// most_spheres_of_batch before any of them.
PLATEN_INLINE void find_owner_runs(const std::int32_t* i, std::int32_t count, std::int32_t first, PairTargets* to) {
  for (std::int32_t k = 0; k < count; ++k) {
    const bool same = k > 0 && i[k] == i[k - 1];
    to[k].own_and_again = static_cast<std::uint32_t>(record_bytes * (i[k] - first)) << 8 | (same ? 0xffu : 0u);
  }
}

// The owners of each eight of `count` contacts, a multiple of eight, in a batch of the particles first to end - 1, at least eight.
PLATEN_INLINE void find_owners(const std::int32_t* i, std::int32_t count, std::int32_t first, std::int32_t end, OwnersOfEight* owners) {
  for (std::int32_t k = 0; k < count; k += 8) {
    OwnersOfEight& of = owners[k / 8];
    const std::int32_t from = i[k] < end - 8 ? i[k] : end - 8;  // all eight places are the batch's own
    of.first = from >= first && i[k + 7] - from < 8 ? from - first : -1;
    for (std::int32_t lane = 0; lane < 8; ++lane) of.place[lane] = static_cast<std::uint8_t>(i[k + lane] - from);
  }
}

}  // namespace platen
