// Two vectors worked on side by side: the same names as an instruction set of real.h, twice as wide.
//
// A contact is one long chain of dependent operations (an inverse root, the limit of friction, forces), so that a
// loop over single vectors waits for results most of the time. Two independent chains, operation by operation in turn,
// fill these waits. Each half does what it would do alone, so no bit changes.
#pragma once

#include <type_traits>

#include "kernels/real.h"

namespace platen {

// The bare register of a batch of numbers or of flags. g++ 12 copies structures of xsimd's classes through the stack.
template <class T>
struct Plain {
  using Type = T;
};
template <class T>
  requires requires { typename T::register_type; }
struct Plain<T> {
  using Type = typename T::register_type;
};

template <class I>
struct Twice {
  struct Mask {
    typename Plain<typename I::Mask>::Type a, b;
  };
  using One = typename I::Real;
  struct Real {
    typename Plain<typename I::Real>::Type a, b;
    friend PLATEN_INLINE Real operator+(const Real& x, const Real& y) { return {One(x.a) + One(y.a), One(x.b) + One(y.b)}; }
    friend PLATEN_INLINE Real operator-(const Real& x, const Real& y) { return {One(x.a) - One(y.a), One(x.b) - One(y.b)}; }
    friend PLATEN_INLINE Real operator*(const Real& x, const Real& y) { return {One(x.a) * One(y.a), One(x.b) * One(y.b)}; }
    friend PLATEN_INLINE Real operator/(const Real& x, const Real& y) { return {One(x.a) / One(y.a), One(x.b) / One(y.b)}; }
    friend PLATEN_INLINE Real operator-(const Real& x) { return {-One(x.a), -One(x.b)}; }
    friend PLATEN_INLINE Mask operator<(const Real& x, const Real& y) { return {One(x.a) < One(y.a), One(x.b) < One(y.b)}; }
    friend PLATEN_INLINE Mask operator>(const Real& x, const Real& y) { return {One(x.a) > One(y.a), One(x.b) > One(y.b)}; }
    friend PLATEN_INLINE Mask operator>=(const Real& x, const Real& y) { return {One(x.a) >= One(y.a), One(x.b) >= One(y.b)}; }
  };
  static constexpr int half = I::width;
  static constexpr int width = 2 * half;

  static PLATEN_INLINE Real set(double x) { return {I::set(x), I::set(x)}; }
  static PLATEN_INLINE Real load(const double* p) { return {I::load(p), I::load(p + half)}; }
  static PLATEN_INLINE void store(double* p, const Real& x) { I::store(p, x.a), I::store(p + half, x.b); }
  static PLATEN_INLINE Real fma(const Real& x, const Real& y, const Real& z) {
    return {I::fma(x.a, y.a, z.a), I::fma(x.b, y.b, z.b)};
  }
  static PLATEN_INLINE Real fms(const Real& x, const Real& y, const Real& z) {
    return {I::fms(x.a, y.a, z.a), I::fms(x.b, y.b, z.b)};
  }
  static PLATEN_INLINE Real fnma(const Real& x, const Real& y, const Real& z) {
    return {I::fnma(x.a, y.a, z.a), I::fnma(x.b, y.b, z.b)};
  }
  static PLATEN_INLINE Real sqrt(const Real& x) { return {I::sqrt(x.a), I::sqrt(x.b)}; }
  static PLATEN_INLINE Real abs(const Real& x) { return {I::abs(x.a), I::abs(x.b)}; }
  static PLATEN_INLINE Real min(const Real& x, const Real& y) { return {I::min(x.a, y.a), I::min(x.b, y.b)}; }
  static PLATEN_INLINE Real max(const Real& x, const Real& y) { return {I::max(x.a, y.a), I::max(x.b, y.b)}; }
  static PLATEN_INLINE Real round(const Real& x) { return {I::round(x.a), I::round(x.b)}; }
  static PLATEN_INLINE Real where(const Mask& m, const Real& x, const Real& y) {
    return {I::where(m.a, x.a, y.a), I::where(m.b, x.b, y.b)};
  }
  static PLATEN_INLINE bool any(const Mask& m) { return I::any(I::either(m.a, m.b)); }
  static PLATEN_INLINE int count(const Mask& m) { return I::count(m.a) + I::count(m.b); }
  static PLATEN_INLINE unsigned bits(const Mask& m) { return I::bits(m.a) | I::bits(m.b) << half; }
  static PLATEN_INLINE Mask both(const Mask& x, const Mask& y) { return {I::both(x.a, y.a), I::both(x.b, y.b)}; }
  static PLATEN_INLINE Mask either(const Mask& x, const Mask& y) { return {I::either(x.a, y.a), I::either(x.b, y.b)}; }
  static PLATEN_INLINE Mask negate(const Mask& x) { return {I::negate(x.a), I::negate(x.b)}; }
  static PLATEN_INLINE Mask not_less(const Real& x, const Real& y) { return {I::not_less(x.a, y.a), I::not_less(x.b, y.b)}; }
  static PLATEN_INLINE Real fast_inverse_sqrt(const Real& x) {
    return {I::fast_inverse_sqrt(x.a), I::fast_inverse_sqrt(x.b)};
  }
  static PLATEN_INLINE double sum(const Real& x) { return I::sum(One(x.a) + One(x.b)); }
};

// What sums over vectors of I are kept in: single vectors, which take half the registers.
template <class I>
struct SingleOf {
  using Type = I;
  static PLATEN_INLINE typename I::Real sum(const typename I::Real& x) { return x; }
};
template <class I>
struct SingleOf<Twice<I>> {
  using Type = I;
  static PLATEN_INLINE typename I::Real sum(const typename Twice<I>::Real& x) { return typename I::Real(x.a) + typename I::Real(x.b); }
};

// What the law runs on. AVX2 has too few registers for two vectors at once [docs/decisions.md, "What did not help the contact kernel"].
template <class I>
struct Interleaved {
  using Type = I;
};
#if defined(__AVX512F__) && defined(__AVX512DQ__)
template <>
struct Interleaved<Avx512> {
  using Type = Twice<Avx512>;
};
#endif

// Whether the law of this instruction set works on two vectors at once; I: a single vector, or two.
template <class I>
inline constexpr bool interleaved = !std::is_same_v<typename Interleaved<typename SingleOf<I>::Type>::Type, typename SingleOf<I>::Type>;

}  // namespace platen
