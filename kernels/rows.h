// Rows of spheres [kernels/views.h], as vectors.
#pragma once

#include "kernels/real.h"
#include "kernels/views.h"

namespace platen {

// Four numbers of the row of each of `width` spheres: part 0 x y z R, 1 vx vy vz m, 2 ux uy uz 1/R.
template <class I>
struct RowPart {
  typename I::Real of[4];
};
template <class I, int unit>
PLATEN_INLINE RowPart<I> fetch_part(const double* rows, int part, const std::int32_t* place) {
  RowPart<I> f;
  I::template fetch_rows<unit>(rows + 4 * part, place, f.of);
  return f;
}
// The same of `width` rows next to each other.
template <class I>
PLATEN_INLINE RowPart<I> fetch_next_rows(const double* rows, int part) {
  constexpr std::int32_t next[8] = {0, 1, 2, 3, 4, 5, 6, 7};
  return fetch_part<I, row_size>(rows, part, next);
}

}  // namespace platen
