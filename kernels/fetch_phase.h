// First phase of the contact kernel: where both spheres of each pair are, then how they move. Two loops, with the choice of
// pairs that have anything to say between them (active_pairs.h): most pairs of a rain are looked at no further.
#pragma once

#include "kernels/chunk.h"
#include "kernels/owner_runs.h"
#include "kernels/rows.h"

namespace platen {

// The owner side. Consecutive contacts share owners, and owners follow each other along the curve: eight contacts mostly
// have theirs within eight places, which one load and one permutation per field bring.
template <class I, SceneTraits scene, int parts>
PLATEN_INLINE void fetch_owners(const PairBatch& b, int first_part, std::int32_t k, RowPart<I> (&f)[parts]) {
  if constexpr (I::picks && scene.equal_spheres) {
    static_assert(I::width == 8);
    const OwnersOfEight& owners = b.owners[k / 8];
    if (const std::int64_t base = owners.first; base >= 0) {
      const auto where = I::places(owners.place);
      const double* const columns[3][3] = {{b.x, b.y, b.z}, {b.vx, b.vy, b.vz}, {b.ux, b.uy, b.uz}};
      for (int part = 0; part < parts; ++part) {
        for (int axis = 0; axis < 3; ++axis) f[part].of[axis] = I::pick(columns[first_part + part][axis] + base, where);
        f[part].of[3] = I::set(0.0);
      }
      return;
    }
  }
  std::int32_t owners[I::width];  // no list names them: it would be one more to follow
  for (int lane = 0; lane < I::width; ++lane) owners[lane] = owner_row(b.to[k + lane]);
  for (int part = 0; part < parts; ++part) f[part] = fetch_part<I, 1>(b.own_rows, first_part + part, owners);
}

// Distance, normal and overlap of `width` pairs from `k` on.
template <class I, SceneTraits scene, bool exact, bool periodic>
PLATEN_INLINE void fetch_geometry(Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c, std::int32_t k) {
  using Real = typename I::Real;
  RowPart<I> i[1];
  fetch_owners<I, scene>(b, 0, k, i);
  const RowPart<I> j = fetch_part<I, 1>(b.rows, 0, b.row_j + k);
  // Nearest image: an odd function that changes no bit of a pair inside the box.
  Vec3<I> d = {i[0].of[0] - j.of[0], i[0].of[1] - j.of[1], i[0].of[2] - j.of[2]};
  if constexpr (periodic) {
    d.x = I::fnma(I::set(c.width), I::round(d.x * I::set(c.inverse_width)), d.x);
    d.y = I::fnma(I::set(c.depth), I::round(d.y * I::set(c.inverse_depth)), d.y);
  }
  const Real distance2 = dot(d, d);
  const Real inverse = inverse_sqrt<I, exact>(distance2);
  Real reach;
  if constexpr (scene.equal_spheres) {
    reach = I::set(c.radius + c.radius);
  } else {
    reach = i[0].of[3] + j.of[3];
    I::store(chunk.R[0] + at, i[0].of[3]), I::store(chunk.R[1] + at, j.of[3]);
  }
  I::store(chunk.delta + at, reach - distance2 * inverse);
  I::store(chunk.inverse + at, inverse);
  chunk.template put<I>(chunk.n, at, scale<I>(inverse, d));
}

// Relative motion of `width` pairs, whose geometry is in the chunk; the shorter lever of each.
template <class I, SceneTraits scene>
PLATEN_INLINE typename I::Real fetch_motion(Chunk<scene>& chunk, int at, const PairBatch& b, const LawConstants& c, std::int32_t k) {
  using Real = typename I::Real;
  RowPart<I> i[2];  // velocity and mass, spin and 1/R
  fetch_owners<I, scene>(b, 1, k, i);
  const RowPart<I> j[2] = {fetch_part<I, 1>(b.rows, 1, b.row_j + k), fetch_part<I, 1>(b.rows, 2, b.row_j + k)};
  const Vec3<I> n = chunk.template take<I>(chunk.n, at);
  const Real half = I::set(0.5) * I::load(chunk.delta + at);
  Real inverse_R_i, inverse_R_j;
  if constexpr (scene.equal_spheres) {
    inverse_R_i = inverse_R_j = I::set(c.inverse_radius);
  } else {
    inverse_R_i = i[1].of[3], inverse_R_j = j[1].of[3];
    I::store(chunk.m[0] + at, i[0].of[3]), I::store(chunk.m[1] + at, j[0].of[3]);
  }
  const Real lever_i = I::set(1.0) - half * inverse_R_i;
  const Real lever_j = scene.equal_spheres ? lever_i : I::set(1.0) - half * inverse_R_j;
  I::store(chunk.lever[0] + at, lever_i);
  if constexpr (!scene.equal_spheres) I::store(chunk.lever[1] + at, lever_j);
  const Vec3<I> v = {i[0].of[0] - j[0].of[0], i[0].of[1] - j[0].of[1], i[0].of[2] - j[0].of[2]};
  // Written per side in every scene, and symmetric in i and j to the last bit.
  const Vec3<I> u_i = {i[1].of[0], i[1].of[1], i[1].of[2]}, u_j = {j[1].of[0], j[1].of[1], j[1].of[2]};
  const Vec3<I> spin = scale<I>(lever_i, u_i) + scale<I>(lever_j, u_j);
  const Real v_n = dot(v, n);
  I::store(chunk.v_n + at, v_n);
  // Velocities are half a step old, and so is the normal that spins act around. What that changes in the tangent plane comes
  // from the spin about n alone [docs/laws.md, "Pairs"].
  const Real lag = (I::set(0.5 * c.dt) * I::load(chunk.inverse + at)) * dot(spin, n);
  chunk.template put<I>(chunk.v_t, at, sub_scaled<I>(v, v_n, n) + cross(n, add_scaled<I>(spin, lag, v)));
  if constexpr (scene.rolling == Rolling::relative)
    chunk.template put<I>(chunk.w, at, scale<I>(inverse_R_i, u_i) - scale<I>(inverse_R_j, u_j));
  return scene.equal_spheres ? lever_i : I::min(lever_i, lever_j);
}

}  // namespace platen
