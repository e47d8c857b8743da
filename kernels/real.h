// The arithmetic that kernels are written in: one Real per instruction set, the same names for all.
//
//   Isa::Real    a number, or a vector of `width` numbers        Isa::Mask   the result of a comparison
//   Isa::Record  eight numbers next to each other in memory (64 bytes): one particle's or one contact's sums
//
// xsimd supplies load, store, + - * / and comparisons. What it lacks or does badly (xsimd 8.1: no gather instruction
// on double, fma on AVX-512 as multiply and add, no transpose, no rsqrt on AVX-512) is written here with intrinsics;
// tests/test_real.cpp checks every function on every instruction set. Every function is forced inline: an object
// compiled for an instruction set must not leave a symbol that another one could be linked to.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>

#include <xsimd/xsimd.hpp>
#endif

#define PLATEN_INLINE inline __attribute__((always_inline))

namespace platen {

// ---------------------------------------------------------------------------------------------- one number at a time
struct Scalar {
  using Real = double;
  using Mask = bool;
  static constexpr int width = 1;
  static constexpr bool picks = false;  // has pick(): see Avx512
  static constexpr const char* name = "scalar";

  struct Record {
    double v[8];
  };

  static PLATEN_INLINE Real set(double a) { return a; }
  static PLATEN_INLINE Real load(const double* p) { return *p; }
  static PLATEN_INLINE void store(double* p, Real a) { *p = a; }
  static PLATEN_INLINE Real load_floats(const float* p) { return *p; }
  static PLATEN_INLINE void store_floats(float* p, Real a) { *p = static_cast<float>(a); }
  static PLATEN_INLINE Real fma(Real a, Real b, Real c) { return __builtin_fma(a, b, c); }    // a b + c
  static PLATEN_INLINE Real fms(Real a, Real b, Real c) { return __builtin_fma(a, b, -c); }   // a b - c
  static PLATEN_INLINE Real fnma(Real a, Real b, Real c) { return __builtin_fma(-a, b, c); }  // c - a b
  static PLATEN_INLINE Real sqrt(Real a) { return __builtin_sqrt(a); }
  static PLATEN_INLINE Real abs(Real a) { return __builtin_fabs(a); }
  static PLATEN_INLINE Real min(Real a, Real b) { return a < b ? a : b; }  // b when either is NaN, as minpd
  static PLATEN_INLINE Real max(Real a, Real b) { return a > b ? a : b; }  // b when either is NaN, as maxpd
  // Nearest integer, ties to even, for |a| < 2^51: the odd function that the minimum image needs.
  static PLATEN_INLINE Real round(Real a) {
    const double magic = 0x1.8p52;
    return (a + magic) - magic;
  }
  static PLATEN_INLINE Real where(Mask m, Real a, Real b) { return m ? a : b; }
  static PLATEN_INLINE bool any(Mask m) { return m; }
  static PLATEN_INLINE int count(Mask m) { return m ? 1 : 0; }
  static PLATEN_INLINE unsigned bits(Mask m) { return m ? 1u : 0u; }
  static PLATEN_INLINE Mask both(Mask a, Mask b) { return a && b; }
  static PLATEN_INLINE Mask either(Mask a, Mask b) { return a || b; }
  static PLATEN_INLINE Mask negate(Mask a) { return !a; }
  static PLATEN_INLINE Mask not_less(Real a, Real b) { return !(a < b); }  // also where either is no number
  // Those of `width` numbers whose bits are set, one behind the other; their number. Writes `width` places. [tests/test_search.cpp]
  static PLATEN_INLINE int pack(unsigned bits, const std::int32_t* from, std::int32_t* to) {
    *to = *from;
    return static_cast<int>(bits);
  }
  static PLATEN_INLINE Real fast_inverse_sqrt(Real a) { return 1.0 / __builtin_sqrt(a); }
  static PLATEN_INLINE double sum(Real a) { return a; }  // exact for order-free terms, whose order does not matter
  static PLATEN_INLINE double largest(Real a) { return a; }

  static PLATEN_INLINE Real gather_floats(const float* p, const std::int32_t* place) { return p[place[0]]; }  // p[place[lane]]
  // fields[k][lane] <- rows[unit place[lane] + k], k = 0..n-1: n (a multiple of 4) numbers of `width` rows.
  template <int unit, int n>
  static PLATEN_INLINE void fetch_rows(const double* rows, const std::int32_t* place, Real (&fields)[n]) {
    const double* p = rows + unit * static_cast<std::int64_t>(place[0]);
    for (int k = 0; k < n; ++k) fields[k] = p[k];
  }
  // rows[index[0] + lane][first + k] <- fields[k][lane]
  static PLATEN_INLINE void scatter4(double* row, int first, const Real (&fields)[4]) {
    for (int k = 0; k < 4; ++k) row[first + k] = fields[k];
  }
  static PLATEN_INLINE void to_records(const Real (&fields)[8], Record (&records)[1]) {
    for (int k = 0; k < 8; ++k) records[0].v[k] = fields[k];
  }
  static PLATEN_INLINE void from_records(const Record (&records)[1], Real (&fields)[8]) {
    for (int k = 0; k < 8; ++k) fields[k] = records[0].v[k];
  }
  static PLATEN_INLINE Record zero_record() { return Record{{0, 0, 0, 0, 0, 0, 0, 0}}; }
  static PLATEN_INLINE Record load_record(const double* p) {
    Record r;
    std::memcpy(r.v, p, sizeof r.v);
    return r;
  }
  static PLATEN_INLINE Record load_sum(const double* p) { return load_record(p); }
  static PLATEN_INLINE void store_record(double* p, const Record& r) { std::memcpy(p, r.v, sizeof r.v); }
  static PLATEN_INLINE Record add(const Record& a, const Record& b) {
    Record r;
    for (int k = 0; k < 8; ++k) r.v[k] = a.v[k] + b.v[k];
    return r;
  }
  // a + b where all bits of `yes` are set, b where none is.
  static PLATEN_INLINE Record add_if(std::uint8_t yes, const Record& a, const Record& b) { return yes != 0 ? add(a, b) : b; }
  // a and what b does to the other side: the reaction of a force (the first three), the rest as it is.
  static PLATEN_INLINE Record add_reaction(const Record& a, const Record& b) {
    Record r;
    for (int k = 0; k < 8; ++k) r.v[k] = k < 3 ? a.v[k] - b.v[k] : a.v[k] + b.v[k];
    return r;
  }
};

#if defined(__AVX2__) && defined(__FMA__)
// ------------------------------------------------------------------------------------------------------ four at a time
struct Avx2 {
  using Arch = xsimd::fma3<xsimd::avx2>;
  using Real = xsimd::batch<double, Arch>;
  using Mask = xsimd::batch_bool<double, Arch>;
  static constexpr int width = 4;
  static constexpr bool picks = false;
  static constexpr const char* name = "avx2";

  struct Record {
    __m256d lo, hi;
  };

  static PLATEN_INLINE Real set(double a) { return _mm256_set1_pd(a); }
  static PLATEN_INLINE Real load(const double* p) { return _mm256_loadu_pd(p); }
  static PLATEN_INLINE void store(double* p, Real a) { _mm256_storeu_pd(p, a); }
  static PLATEN_INLINE Real load_floats(const float* p) { return _mm256_cvtps_pd(_mm_loadu_ps(p)); }
  static PLATEN_INLINE void store_floats(float* p, Real a) { _mm_storeu_ps(p, _mm256_cvtpd_ps(a)); }
  static PLATEN_INLINE Real fma(Real a, Real b, Real c) { return _mm256_fmadd_pd(a, b, c); }
  static PLATEN_INLINE Real fms(Real a, Real b, Real c) { return _mm256_fmsub_pd(a, b, c); }
  static PLATEN_INLINE Real fnma(Real a, Real b, Real c) { return _mm256_fnmadd_pd(a, b, c); }
  static PLATEN_INLINE Real sqrt(Real a) { return _mm256_sqrt_pd(a); }
  static PLATEN_INLINE Real abs(Real a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a); }
  static PLATEN_INLINE Real min(Real a, Real b) { return _mm256_min_pd(a, b); }
  static PLATEN_INLINE Real max(Real a, Real b) { return _mm256_max_pd(a, b); }
  static PLATEN_INLINE Real round(Real a) {
    const __m256d magic = _mm256_set1_pd(0x1.8p52);
    return _mm256_sub_pd(_mm256_add_pd(a, magic), magic);
  }
  static PLATEN_INLINE Real where(Mask m, Real a, Real b) { return _mm256_blendv_pd(b, a, m); }
  static PLATEN_INLINE bool any(Mask m) { return _mm256_movemask_pd(m) != 0; }
  static PLATEN_INLINE int count(Mask m) { return __builtin_popcount(bits(m)); }
  static PLATEN_INLINE unsigned bits(Mask m) { return static_cast<unsigned>(_mm256_movemask_pd(m)); }  // first lane lowest
  static PLATEN_INLINE Mask both(Mask a, Mask b) { return _mm256_and_pd(a, b); }
  static PLATEN_INLINE Mask either(Mask a, Mask b) { return _mm256_or_pd(a, b); }
  static PLATEN_INLINE Mask negate(Mask a) {
    return _mm256_xor_pd(a, _mm256_castsi256_pd(_mm256_set1_epi64x(-1)));
  }
  static PLATEN_INLINE Mask not_less(Real a, Real b) { return _mm256_cmp_pd(a, b, _CMP_NLT_UQ); }
  static PLATEN_INLINE int pack(unsigned bits, const std::int32_t* from, std::int32_t* to) {
    unsigned n = 0;
    for (unsigned lane = 0; lane < width; ++lane) to[n] = from[lane], n += bits >> lane & 1u;
    return static_cast<int>(n);
  }
  static PLATEN_INLINE Real fast_inverse_sqrt(Real a) {
    return _mm256_div_pd(_mm256_set1_pd(1.0), _mm256_sqrt_pd(a));
  }
  static PLATEN_INLINE double sum(Real a) {
    alignas(32) double v[4];
    _mm256_store_pd(v, a);
    return (v[0] + v[1]) + (v[2] + v[3]);
  }
  static PLATEN_INLINE double largest(Real a) {
    alignas(32) double v[4];
    _mm256_store_pd(v, a);
    const double x = v[0] > v[1] ? v[0] : v[1], y = v[2] > v[3] ? v[2] : v[3];
    return x > y ? x : y;
  }
  static PLATEN_INLINE Real gather_floats(const float* p, const std::int32_t* place) {
    return _mm256_cvtps_pd(_mm_set_ps(p[place[3]], p[place[2]], p[place[1]], p[place[0]]));
  }
  // The lower halves of two vectors, and the upper ones. No permute2f128: that takes eight operations on Zen 1, and elsewhere
  // the unit that is short anyway.
  static PLATEN_INLINE __m256d lower_halves(__m256d a, __m256d b) { return _mm256_insertf128_pd(a, _mm256_castpd256_pd128(b), 1); }
  static PLATEN_INLINE __m256d upper_halves(__m256d a, __m256d b) {
    return _mm256_blend_pd(_mm256_castpd128_pd256(_mm256_extractf128_pd(a, 1)), b, 0xc);
  }
  static PLATEN_INLINE void transpose(__m256d& a, __m256d& b, __m256d& c, __m256d& d) {
    const __m256d ab_lo = _mm256_unpacklo_pd(a, b), ab_hi = _mm256_unpackhi_pd(a, b);
    const __m256d cd_lo = _mm256_unpacklo_pd(c, d), cd_hi = _mm256_unpackhi_pd(c, d);
    a = lower_halves(ab_lo, cd_lo), b = lower_halves(ab_hi, cd_hi);
    c = upper_halves(ab_lo, cd_lo), d = upper_halves(ab_hi, cd_hi);
  }
  template <int unit, int n>
  static PLATEN_INLINE void fetch_rows(const double* rows, const std::int32_t* place, Real (&fields)[n]) {
    const double* p[4];
    for (int lane = 0; lane < 4; ++lane) p[lane] = rows + unit * static_cast<std::int64_t>(place[lane]);
    for (int k = 0; k < n; k += 2) {  // rows 0 and 2, 1 and 3 share a register, so that nothing goes across its middle
      const __m256d even = _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(p[0] + k)), _mm_loadu_pd(p[2] + k), 1);
      const __m256d odd = _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(p[1] + k)), _mm_loadu_pd(p[3] + k), 1);
      fields[k] = _mm256_unpacklo_pd(even, odd), fields[k + 1] = _mm256_unpackhi_pd(even, odd);
    }
  }
  static PLATEN_INLINE void scatter4(double* row, int first, const Real (&fields)[4]) {
    __m256d a = fields[0], b = fields[1], c = fields[2], d = fields[3];
    transpose(a, b, c, d);
    _mm256_storeu_pd(row + first, a);
    _mm256_storeu_pd(row + 12 + first, b);
    _mm256_storeu_pd(row + 24 + first, c);
    _mm256_storeu_pd(row + 36 + first, d);
  }
  static PLATEN_INLINE void to_records(const Real (&fields)[8], Record (&records)[4]) {
    __m256d f[8];
    for (int k = 0; k < 8; ++k) f[k] = fields[k];
    transpose(f[0], f[1], f[2], f[3]);
    transpose(f[4], f[5], f[6], f[7]);
    for (int k = 0; k < 4; ++k) records[k] = {f[k], f[k + 4]};
  }
  static PLATEN_INLINE void from_records(const Record (&records)[4], Real (&fields)[8]) {
    __m256d f[8];
    for (int k = 0; k < 4; ++k) f[k] = records[k].lo, f[k + 4] = records[k].hi;
    transpose(f[0], f[1], f[2], f[3]);
    transpose(f[4], f[5], f[6], f[7]);
    for (int k = 0; k < 8; ++k) fields[k] = f[k];
  }
  static PLATEN_INLINE Record zero_record() { return {_mm256_setzero_pd(), _mm256_setzero_pd()}; }
  static PLATEN_INLINE Record load_record(const double* p) { return {_mm256_load_pd(p), _mm256_load_pd(p + 4)}; }
  static PLATEN_INLINE Record load_sum(const double* p) { return load_record(p); }
  static PLATEN_INLINE void store_record(double* p, const Record& r) {
    _mm256_store_pd(p, r.lo);
    _mm256_store_pd(p + 4, r.hi);
  }
  static PLATEN_INLINE Record add(const Record& a, const Record& b) {
    return {_mm256_add_pd(a.lo, b.lo), _mm256_add_pd(a.hi, b.hi)};
  }
  static PLATEN_INLINE Record add_if(std::uint8_t yes, const Record& a, const Record& b) {
    const __m256d m = _mm256_castsi256_pd(_mm256_set1_epi8(static_cast<char>(yes)));
    return {_mm256_add_pd(_mm256_and_pd(a.lo, m), b.lo), _mm256_add_pd(_mm256_and_pd(a.hi, m), b.hi)};
  }
  static PLATEN_INLINE Record add_reaction(const Record& a, const Record& b) {
    return {_mm256_fmadd_pd(b.lo, _mm256_set_pd(1.0, -1.0, -1.0, -1.0), a.lo), _mm256_add_pd(a.hi, b.hi)};
  }
};
#endif

#if defined(__AVX512F__) && defined(__AVX512DQ__)
// ----------------------------------------------------------------------------------------------------- eight at a time
struct Avx512 {
  using Arch = xsimd::avx512dq;
  using Real = xsimd::batch<double, Arch>;
  using Mask = xsimd::batch_bool<double, Arch>;
  static constexpr int width = 8;
  static constexpr const char* name = "avx512";
  static constexpr bool picks = true;
  using Places = __m512i;

  // For pick(); each must be in 0..7.
  static PLATEN_INLINE Places places(const std::uint8_t (&place)[8]) {
    return _mm512_cvtepu8_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(place)));
  }
  // p[places[lane]]: one load and one permutation where a gather would take eight loads.
  static PLATEN_INLINE Real pick(const double* p, const Places& where) {
    return _mm512_permutexvar_pd(where, _mm512_loadu_pd(p));
  }

  struct Record {
    __m512d v;
  };

  static PLATEN_INLINE Real set(double a) { return _mm512_set1_pd(a); }
  static PLATEN_INLINE Real load(const double* p) { return _mm512_loadu_pd(p); }
  static PLATEN_INLINE void store(double* p, Real a) { _mm512_storeu_pd(p, a); }
  static PLATEN_INLINE Real load_floats(const float* p) { return _mm512_cvtps_pd(_mm256_loadu_ps(p)); }
  static PLATEN_INLINE void store_floats(float* p, Real a) { _mm256_storeu_ps(p, _mm512_cvtpd_ps(a)); }
  static PLATEN_INLINE Real fma(Real a, Real b, Real c) { return _mm512_fmadd_pd(a, b, c); }
  static PLATEN_INLINE Real fms(Real a, Real b, Real c) { return _mm512_fmsub_pd(a, b, c); }
  static PLATEN_INLINE Real fnma(Real a, Real b, Real c) { return _mm512_fnmadd_pd(a, b, c); }
  static PLATEN_INLINE Real sqrt(Real a) { return _mm512_sqrt_pd(a); }
  static PLATEN_INLINE Real abs(Real a) { return _mm512_abs_pd(a); }
  static PLATEN_INLINE Real min(Real a, Real b) { return _mm512_min_pd(a, b); }
  static PLATEN_INLINE Real max(Real a, Real b) { return _mm512_max_pd(a, b); }
  static PLATEN_INLINE Real round(Real a) {
    const __m512d magic = _mm512_set1_pd(0x1.8p52);
    return _mm512_sub_pd(_mm512_add_pd(a, magic), magic);
  }
  static PLATEN_INLINE Real where(Mask m, Real a, Real b) { return _mm512_mask_blend_pd(m, b, a); }
  static PLATEN_INLINE bool any(Mask m) { return static_cast<__mmask8>(m) != 0; }
  static PLATEN_INLINE int count(Mask m) { return __builtin_popcount(static_cast<__mmask8>(m)); }
  static PLATEN_INLINE unsigned bits(Mask m) { return static_cast<__mmask8>(m); }
  // By intrinsics, lest they leave the mask registers.
  static PLATEN_INLINE Mask both(Mask a, Mask b) { return _kand_mask8(static_cast<__mmask8>(a), static_cast<__mmask8>(b)); }
  static PLATEN_INLINE Mask either(Mask a, Mask b) { return _kor_mask8(static_cast<__mmask8>(a), static_cast<__mmask8>(b)); }
  static PLATEN_INLINE Mask negate(Mask a) { return _knot_mask8(static_cast<__mmask8>(a)); }
  static PLATEN_INLINE Mask not_less(Real a, Real b) { return _mm512_cmp_pd_mask(a, b, _CMP_NLT_UQ); }
  static PLATEN_INLINE int pack(unsigned bits, const std::int32_t* from, std::int32_t* to) {
    const __m256i all = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_maskz_compress_epi32(static_cast<__mmask8>(bits), all));
    return __builtin_popcount(bits);
  }
  // 14 correct bits, then one step of fourth order in e = 1 - a y^2: y <- y + y e (1/2 + 3/8 e + 5/16 e^2). What is left
  // out is below 2^-54 of the result; rounding makes the error up to 1.5 ulp.
  static PLATEN_INLINE Real fast_inverse_sqrt(Real a) {
    const __m512d y = _mm512_rsqrt14_pd(a);
    const __m512d e = _mm512_fnmadd_pd(_mm512_mul_pd(a, y), y, _mm512_set1_pd(1.0));
    const __m512d slope = _mm512_fmadd_pd(e, _mm512_set1_pd(0.3125), _mm512_set1_pd(0.375));
    return _mm512_fmadd_pd(_mm512_mul_pd(y, e), _mm512_fmadd_pd(e, slope, _mm512_set1_pd(0.5)), y);
  }
  static PLATEN_INLINE double sum(Real a) { return _mm512_reduce_add_pd(a); }
  static PLATEN_INLINE double largest(Real a) { return _mm512_reduce_max_pd(a); }

  static PLATEN_INLINE Real gather_floats(const float* p, const std::int32_t* place) {
    return _mm512_cvtps_pd(_mm256_set_ps(p[place[7]], p[place[6]], p[place[5]], p[place[4]], p[place[3]], p[place[2]], p[place[1]], p[place[0]]));
  }

  template <int unit, int n>
  static PLATEN_INLINE void fetch_rows(const double* rows, const std::int32_t* place, Real (&fields)[n]) {
    // Of eight rows 0 and 2, 1 and 3, 4 and 6, 5 and 7 share a register: so two shuffles without a register of indices bring
    // their numbers into order.
    __m512d part[n / 4][4];
    for (int pair = 0; pair < 4; ++pair) {
      const int lane = pair + (pair & 2);
      const double* p = rows + unit * static_cast<std::int64_t>(place[lane]);
      const double* q = rows + unit * static_cast<std::int64_t>(place[lane + 2]);
      for (int k = 0; k < n / 4; ++k)
        part[k][pair] = _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_loadu_pd(p + 4 * k)), _mm256_loadu_pd(q + 4 * k), 1);
    }
    for (int k = 0; k < n / 4; ++k) {
      const __m512d ab_lo = _mm512_unpacklo_pd(part[k][0], part[k][1]), ab_hi = _mm512_unpackhi_pd(part[k][0], part[k][1]);
      const __m512d cd_lo = _mm512_unpacklo_pd(part[k][2], part[k][3]), cd_hi = _mm512_unpackhi_pd(part[k][2], part[k][3]);
      fields[4 * k + 0] = _mm512_shuffle_f64x2(ab_lo, cd_lo, 0x88);
      fields[4 * k + 1] = _mm512_shuffle_f64x2(ab_hi, cd_hi, 0x88);
      fields[4 * k + 2] = _mm512_shuffle_f64x2(ab_lo, cd_lo, 0xdd);
      fields[4 * k + 3] = _mm512_shuffle_f64x2(ab_hi, cd_hi, 0xdd);
    }
  }
  static PLATEN_INLINE void scatter4(double* row, int first, const Real (&fields)[4]) {
    const __m512d a = fields[0], b = fields[1], c = fields[2], d = fields[3];
    const __m512d ab_lo = _mm512_unpacklo_pd(a, b), ab_hi = _mm512_unpackhi_pd(a, b);
    const __m512d cd_lo = _mm512_unpacklo_pd(c, d), cd_hi = _mm512_unpackhi_pd(c, d);
    const __m512i low = _mm512_set_epi64(13, 12, 5, 4, 9, 8, 1, 0), high = _mm512_set_epi64(15, 14, 7, 6, 11, 10, 3, 2);
    const __m512d r04 = _mm512_permutex2var_pd(ab_lo, low, cd_lo), r15 = _mm512_permutex2var_pd(ab_hi, low, cd_hi);
    const __m512d r26 = _mm512_permutex2var_pd(ab_lo, high, cd_lo), r37 = _mm512_permutex2var_pd(ab_hi, high, cd_hi);
    const auto put = [&](int lane, const __m512d& pair) {
      _mm256_storeu_pd(row + 12 * lane + first, _mm512_castpd512_pd256(pair));
      _mm256_storeu_pd(row + 12 * (lane + 4) + first, _mm512_extractf64x4_pd(pair, 1));
    };
    put(0, r04), put(1, r15), put(2, r26), put(3, r37);
  }
  static PLATEN_INLINE void transpose8(__m512d (&r)[8]) {
    __m512d t[8], u[8];
    for (int k = 0; k < 4; ++k) {
      t[2 * k] = _mm512_unpacklo_pd(r[2 * k], r[2 * k + 1]);
      t[2 * k + 1] = _mm512_unpackhi_pd(r[2 * k], r[2 * k + 1]);
    }
    for (int h = 0; h < 2; ++h)
      for (int k = 0; k < 2; ++k) {
        u[4 * h + k] = _mm512_shuffle_f64x2(t[4 * h + k], t[4 * h + k + 2], 0x88);
        u[4 * h + k + 2] = _mm512_shuffle_f64x2(t[4 * h + k], t[4 * h + k + 2], 0xdd);
      }
    for (int k = 0; k < 4; ++k) {
      r[k] = _mm512_shuffle_f64x2(u[k], u[k + 4], 0x88);
      r[k + 4] = _mm512_shuffle_f64x2(u[k], u[k + 4], 0xdd);
    }
  }
  static PLATEN_INLINE void to_records(const Real (&fields)[8], Record (&records)[8]) {
    __m512d r[8];
    for (int k = 0; k < 8; ++k) r[k] = fields[k];
    transpose8(r);
    for (int k = 0; k < 8; ++k) records[k].v = r[k];
  }
  static PLATEN_INLINE void from_records(const Record (&records)[8], Real (&fields)[8]) {
    __m512d r[8];
    for (int k = 0; k < 8; ++k) r[k] = records[k].v;
    transpose8(r);
    for (int k = 0; k < 8; ++k) fields[k] = r[k];
  }
  static PLATEN_INLINE Record zero_record() { return {_mm512_setzero_pd()}; }
  static PLATEN_INLINE Record load_record(const double* p) { return {_mm512_load_pd(p)}; }
  // The same of a record that may just have been stored: in two halves, since Zen 5 is slow to read 64 bytes again
  // [docs/decisions.md, "A run begins with its owner's sum"]. The empty statement keeps a compiler from making them one.
  static PLATEN_INLINE Record load_sum(const double* p) {
    __m256d lower = _mm256_load_pd(p);
    asm("" : "+v"(lower));
    return {_mm512_insertf64x4(_mm512_castpd256_pd512(lower), _mm256_load_pd(p + 4), 1)};
  }
  static PLATEN_INLINE void store_record(double* p, const Record& r) { _mm512_store_pd(p, r.v); }
  static PLATEN_INLINE Record add(const Record& a, const Record& b) { return {_mm512_add_pd(a.v, b.v)}; }
  static PLATEN_INLINE Record add_if(std::uint8_t yes, const Record& a, const Record& b) {
    return {_mm512_mask_add_pd(b.v, static_cast<__mmask8>(yes), a.v, b.v)};
  }
  static PLATEN_INLINE Record add_reaction(const Record& a, const Record& b) {
    return {_mm512_fmadd_pd(b.v, _mm512_set_pd(1.0, 1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0), a.v)};
  }
};
#endif

// The two ways to take 1/sqrt: full IEEE operations, or the quickest that an instruction set has.
template <class I, bool exact>
PLATEN_INLINE typename I::Real inverse_sqrt(typename I::Real a) {
  if constexpr (exact)
    return I::set(1.0) / I::sqrt(a);
  else
    return I::fast_inverse_sqrt(a);
}

}  // namespace platen
