// Three components of a vector; each is a Real of an instruction set.
#pragma once

#include "kernels/real.h"

namespace platen {

template <class I>
struct Vec3 {
  typename I::Real x, y, z;
};

template <class I>
PLATEN_INLINE Vec3<I> operator+(const Vec3<I>& a, const Vec3<I>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class I>
PLATEN_INLINE Vec3<I> operator-(const Vec3<I>& a, const Vec3<I>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class I>
PLATEN_INLINE Vec3<I> scale(typename I::Real s, const Vec3<I>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
// a + s b
template <class I>
PLATEN_INLINE Vec3<I> add_scaled(const Vec3<I>& a, typename I::Real s, const Vec3<I>& b) {
  return {I::fma(s, b.x, a.x), I::fma(s, b.y, a.y), I::fma(s, b.z, a.z)};
}
// a - s b
template <class I>
PLATEN_INLINE Vec3<I> sub_scaled(const Vec3<I>& a, typename I::Real s, const Vec3<I>& b) {
  return {I::fnma(s, b.x, a.x), I::fnma(s, b.y, a.y), I::fnma(s, b.z, a.z)};
}
template <class I>
PLATEN_INLINE typename I::Real dot(const Vec3<I>& a, const Vec3<I>& b) {
  return I::fma(a.x, b.x, I::fma(a.y, b.y, a.z * b.z));
}
// Odd in each argument to the last bit: what a pair needs so that it may be stored either way round.
template <class I>
PLATEN_INLINE Vec3<I> cross(const Vec3<I>& a, const Vec3<I>& b) {
  return {I::fms(a.y, b.z, a.z * b.y), I::fms(a.z, b.x, a.x * b.z), I::fms(a.x, b.y, a.y * b.x)};
}
// -(a x b), to the last bit
template <class I>
PLATEN_INLINE Vec3<I> minus_cross(const Vec3<I>& a, const Vec3<I>& b) {
  return {I::fnma(a.y, b.z, a.z * b.y), I::fnma(a.z, b.x, a.x * b.z), I::fnma(a.x, b.y, a.y * b.x)};
}
template <class I>
PLATEN_INLINE Vec3<I> where(typename I::Mask m, const Vec3<I>& a, const Vec3<I>& b) {
  return {I::where(m, a.x, b.x), I::where(m, a.y, b.y), I::where(m, a.z, b.z)};
}

// The image of a difference nearest to 0 along an axis of this periodic length; the difference itself where that is 0.
template <class I>
PLATEN_INLINE typename I::Real nearest_image(const typename I::Real& d, double length, double inverse) {
  return d - I::set(length) * I::round(d * I::set(inverse));
}

}  // namespace platen
