// After a run of steps in which rows alone held the state: the columns are given it, and what each sphere has moved is taken off its room.
#pragma once

#include "kernels/rows.h"
#include "kernels/look_kernel.h"

namespace platen {

template <class I>
void settle_kernel(const SettleBatch& b, const LookConstants& c) noexcept {
  for (std::int32_t k = 0; k < b.count; k += I::width) {
    const double* row = b.rows + row_size * static_cast<std::int64_t>(k);
    const RowPart<I> x = fetch_next_rows<I>(row, 0), v = fetch_next_rows<I>(row, 1), u = fetch_next_rows<I>(row, 2);
    take_off_room<I>(b.inner + k, b.outer + k, way_since<I>({x.of[0], x.of[1], x.of[2]}, {I::load(b.x + k), I::load(b.y + k), I::load(b.z + k)}, c));
    I::store(b.x + k, x.of[0]), I::store(b.y + k, x.of[1]), I::store(b.z + k, x.of[2]);
    I::store(b.vx + k, v.of[0]), I::store(b.vy + k, v.of[1]), I::store(b.vz + k, v.of[2]);
    I::store(b.ux + k, u.of[0]), I::store(b.uy + k, u.of[1]), I::store(b.uz + k, u.of[2]);
  }
}

}  // namespace platen
