// The owner side reads columns, one load and one permutation for eight contacts [fetch_phase.h]. Where rows alone hold the state, those of
// the batch's spheres are made first, in memory that stays in a near cache: their rows are fetched anyway, as partners.
#pragma once

#include "kernels/fetch_phase.h"

namespace platen {

// The same batch with columns in b.stage.
template <class I, SceneTraits scene>
PLATEN_INLINE PairBatch with_staged_owners(const PairBatch& b) {
  PairBatch staged = b;
  if constexpr (I::picks && scene.equal_spheres) {
    if (b.x != nullptr) return staged;
    const std::int64_t spheres = b.end - b.first, apart = stage_column(spheres);
    const auto column = [&](int number) { return b.stage + number * apart; };
    staged.x = column(0), staged.y = column(1), staged.z = column(2);
    staged.vx = column(3), staged.vy = column(4), staged.vz = column(5);
    staged.ux = column(6), staged.uy = column(7), staged.uz = column(8);
    for (std::int64_t k = 0; k < spheres; k += I::width)
      for (int part = 0; part < 3; ++part) {
        const RowPart<I> of = fetch_next_rows<I>(b.rows + row_size * (b.first + k), part);
        for (int axis = 0; axis < 3; ++axis) I::store(column(3 * part + axis) + k, of.of[axis]);
      }
  }
  return staged;
}

}  // namespace platen
