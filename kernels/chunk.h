// What the phases of the contact kernel hand on.
#pragma once

#include <cstddef>

#include "kernels/scene.h"
#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

// What the phases hand on, for one chunk: small enough to stay in the first cache. The normal points from j to i, v_n is
// positive when the spheres part, v_t is at the contact point, a lever is a/R.
//
//   fetch geometry   delta n 1/distance (R)
//   active pairs       |
//   fetch motion       |  v_n v_t lever (m w)
//   law: springs       |   |   turned limit (k_t) f_n (beta_n)                  S
//   law: slips         `---`---`------`------`---------`-------> spring beta_t  |
//   law: forces        `---`----------------------`----`---------`------`-------`-> F T
//   output                                                                      `---`-`-->
template <SceneTraits scene>
struct Chunk {
  static constexpr int sides = scene.equal_spheres ? 1 : 2;  // of unequal spheres, each has its own
  using Column = double[chunk_size];
  alignas(64) Column delta;     // overlap [m]
  alignas(64) Column n[3];
  alignas(64) Column inverse;   // 1/distance [1/m]
  alignas(64) Column v_n;       // [m/s]
  alignas(64) Column v_t[3];
  alignas(64) Column lever[sides];
  alignas(64) Column R[2], m[2], w[3];
  alignas(64) Column turned[3];    // tangential spring, turned with the normal [N]
  alignas(64) Column limit, f_n;   // of the tangential force; normal force [N]
  alignas(64) Column beta_n, k_t;  // of each pair: unequal spheres; exponent other than 1
  alignas(64) Column beta_t;       // tangential dashpot, 0 where the contact slides [kg/s]
  alignas(64) Column F[3];
  alignas(64) Column T[sides][3];
  alignas(64) Column S[sides];     // |f_hys| lever; relative rolling: |f_hys|, for the last third of the law [N]

  template <class I>
  static PLATEN_INLINE void put(Column (&to)[3], int at, const Vec3<I>& a) {
    I::store(to[0] + at, a.x), I::store(to[1] + at, a.y), I::store(to[2] + at, a.z);
  }
  template <class I>
  static PLATEN_INLINE Vec3<I> take(const Column (&from)[3], int at) {
    return {I::load(from[0] + at), I::load(from[1] + at), I::load(from[2] + at)};
  }

  // Geometry of one pair, to another place of the chunk.
  PLATEN_INLINE void move(int to, int from) {
    delta[to] = delta[from], inverse[to] = inverse[from];
    for (int axis = 0; axis < 3; ++axis) n[axis][to] = n[axis][from];
    if constexpr (!scene.equal_spheres)
      for (int side = 0; side < 2; ++side) R[side][to] = R[side][from];
  }
  // Fields of the records of one side, in their order.
  template <class I>
  PLATEN_INLINE void take_fields(int at, int side, typename I::Real (&fields)[8]) const {
    for (int axis = 0; axis < 3; ++axis) fields[axis] = I::load(F[axis] + at), fields[4 + axis] = I::load(T[side][axis] + at);
    fields[3] = scene.rolling == Rolling::absolute ? I::load(S[side] + at) : I::set(0.0);
    fields[7] = I::set(0.0);
  }
};

// `width` pairs of a chunk from one position on, read at each call.
//
// A law needs some of a pair's numbers twice, at its start and at its end. Kept in between they find no register, and a
// compiler saves them on the stack, which costs a store (of 64 bytes two cycles on Zen 4) where reading again what the
// chunk still holds costs a load. So the address goes through an empty statement that a compiler cannot look into. It may
// still join two reads with no store between them that could change the chunk; here there are such stores.
template <class I, SceneTraits scene>
class PairsOfChunk {
 public:
  PLATEN_INLINE PairsOfChunk(const Chunk<scene>& chunk, int first)
      : place_(reinterpret_cast<const char*>(&chunk) + static_cast<std::size_t>(first) * sizeof(double)) {}

  using Real = typename I::Real;
  PLATEN_INLINE Real delta() const { return read(offsetof(Columns, delta)); }
  PLATEN_INLINE Vec3<I> n() const { return read3(offsetof(Columns, n)); }
  PLATEN_INLINE Real v_n() const { return read(offsetof(Columns, v_n)); }
  PLATEN_INLINE Vec3<I> v_t() const { return read3(offsetof(Columns, v_t)); }
  PLATEN_INLINE Real lever(int side) const { return read(offsetof(Columns, lever) + side * column); }
  PLATEN_INLINE Real R(int side) const { return read(offsetof(Columns, R) + side * column); }
  PLATEN_INLINE Real m(int side) const { return read(offsetof(Columns, m) + side * column); }
  PLATEN_INLINE Vec3<I> w() const { return read3(offsetof(Columns, w)); }
  PLATEN_INLINE Vec3<I> turned() const { return read3(offsetof(Columns, turned)); }
  PLATEN_INLINE Real limit() const { return read(offsetof(Columns, limit)); }
  PLATEN_INLINE Real f_n() const { return read(offsetof(Columns, f_n)); }
  PLATEN_INLINE Real k_t() const { return read(offsetof(Columns, k_t)); }
  PLATEN_INLINE Real beta_n() const { return read(offsetof(Columns, beta_n)); }

 private:
  using Columns = Chunk<scene>;
  static constexpr std::size_t column = sizeof(typename Columns::Column);
  PLATEN_INLINE const double* at(std::size_t offset) const {
    const char* p = place_;
    asm("" : "+r"(p));
    return reinterpret_cast<const double*>(p + offset);
  }
  PLATEN_INLINE Real read(std::size_t offset) const { return I::load(at(offset)); }
  PLATEN_INLINE Vec3<I> read3(std::size_t offset) const {
    const double* p = at(offset);
    return {I::load(p), I::load(p + chunk_size), I::load(p + 2 * chunk_size)};
  }

  const char* place_;  // of these pairs in the first column; in the others they are as many bytes behind as columns are apart
};

}  // namespace platen
