// Every function of kernels/real.h against plain doubles, for one instruction set.
//
// Included by one file per instruction set, compiled with its flags. Everything here has internal linkage and no test
// framework is included, so that such a file leaves no symbol that another one could be linked to.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "kernels/five_thirds.h"
#include "kernels/twice.h"

namespace platen {

// Hears of every comparison that fails.
struct RealReport {
  void (*fail)(void* context, const char* what, double got, double wanted);
  void* context;
  long compared = 0;
};

void check_real_scalar(RealReport& report);
void check_real_avx2(RealReport& report);
void check_real_avx512(RealReport& report);

namespace {

// Signs of zeros, infinities, not a number, ties of rounding, numbers far apart. A prime number of them, so that every
// one comes to stand in every lane.
constexpr int value_count = 23;
const double values[value_count] = {
    0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.5, 2.5, -2.5, 3.7, -1e-300, 1e300, -1e300, 1e-160, 0x1p50, -0x1p50 - 1.0,
    std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
    std::numeric_limits<double>::quiet_NaN(), 0.1, 1.0 / 3.0, -7.25, 0x1.fffffffffffffp-1};

inline std::uint64_t bits_of(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits;
}

template <class I>
class RealChecks {
  using Real = typename I::Real;
  static constexpr int W = I::width;
  RealReport& report_;

  // The same bits, or both not a number.
  void same(const char* what, double got, double wanted) {
    ++report_.compared;
    if (bits_of(got) == bits_of(wanted) || (std::isnan(got) && std::isnan(wanted))) return;
    report_.fail(report_.context, what, got, wanted);
  }
  void equal(const char* what, double got, double wanted) {  // zeros of either sign are one
    ++report_.compared;
    if (!(got == wanted)) report_.fail(report_.context, what, got, wanted);
  }
  static Real lanes_from(int start, int stride) {
    double v[W];
    for (int lane = 0; lane < W; ++lane) v[lane] = values[(start + stride * lane) % value_count];
    return I::load(v);
  }
  static double at(int start, int stride, int lane) { return values[(start + stride * lane) % value_count]; }
  template <class Want>
  void each(const char* what, Real got, const Want& want) {
    double v[W];
    I::store(v, got);
    for (int lane = 0; lane < W; ++lane) same(what, v[lane], want(lane));
  }

  // Sums and the least of two vectors side by side, a number that is none in either, both or neither.
  void folded() {
    using Two = Twice<I>;
    double nan_in[2 * W], so_far[W];
    for (int which = 0; which < 4; ++which) {
      for (int lane = 0; lane < 2 * W; ++lane) {
        const bool missing = lane < W ? which & 1 : which & 2;
        nan_in[lane] = missing ? std::numeric_limits<double>::quiet_NaN() : 0.25 * (lane + 1);
      }
      for (int lane = 0; lane < W; ++lane) so_far[lane] = 0.3 * (lane + 1);
      const auto wanted = [&](int lane) {
        double least = so_far[lane];
        for (const double x : {nan_in[lane], nan_in[lane + W]}) least = x < least ? x : least;
        return least;
      };
      each("least, kept where the other is no number", I::min(I::load(nan_in), I::min(I::load(nan_in + W), I::load(so_far))), wanted);
      const double limits[] = {0.6, 1.1, 0.1, 3.0};
      unsigned below = 0;
      for (int lane = 0; lane < 2 * W; ++lane) below |= (nan_in[lane] < limits[which] ? 1u : 0u) << lane;
      equal("bits of two", Two::bits(Two::load(nan_in) < Two::set(limits[which])), below);
      each("sum of two", SingleOf<Two>::sum(Two::load(nan_in)), [&](int lane) { return nan_in[lane] + nan_in[lane + W]; });
    }
  }

  void arithmetic() {
    for (int p = 0; p < value_count; ++p)
      for (int q = 0; q < value_count; ++q) {
        const Real a = lanes_from(p, 1), b = lanes_from(q, 1), c = lanes_from(p + 2 * q, 3);
        const auto A = [&](int l) { return at(p, 1, l); };
        const auto B = [&](int l) { return at(q, 1, l); };
        const auto C = [&](int l) { return at(p + 2 * q, 3, l); };
        each("+", a + b, [&](int l) { return A(l) + B(l); });
        each("-", a - b, [&](int l) { return A(l) - B(l); });
        each("*", a * b, [&](int l) { return A(l) * B(l); });
        each("/", a / b, [&](int l) { return A(l) / B(l); });
        // xsimd's minus sign on AVX-512 is 0 - x: a zero may come out with either sign, which nothing depends on.
        each("negation", -a + I::set(0.0), [&](int l) { return -A(l) + 0.0; });
        each("fma", I::fma(a, b, c), [&](int l) { return std::fma(A(l), B(l), C(l)); });
        each("fms", I::fms(a, b, c), [&](int l) { return std::fma(A(l), B(l), -C(l)); });
        each("fnma", I::fnma(a, b, c), [&](int l) { return std::fma(-A(l), B(l), C(l)); });
        each("min", I::min(a, b), [&](int l) { return A(l) < B(l) ? A(l) : B(l); });
        each("max", I::max(a, b), [&](int l) { return A(l) > B(l) ? A(l) : B(l); });
        each("where <", I::where(a < b, a, c), [&](int l) { return A(l) < B(l) ? A(l) : C(l); });
        each("where >", I::where(a > b, a, c), [&](int l) { return A(l) > B(l) ? A(l) : C(l); });
        each("where >=", I::where(a >= b, a, c), [&](int l) { return A(l) >= B(l) ? A(l) : C(l); });
        each("both", I::where(I::both(a < b, b < c), a, c), [&](int l) { return A(l) < B(l) && B(l) < C(l) ? A(l) : C(l); });
        each("either", I::where(I::either(a < b, b < c), a, c), [&](int l) { return A(l) < B(l) || B(l) < C(l) ? A(l) : C(l); });
        each("negate", I::where(I::negate(a < b), a, c), [&](int l) { return A(l) < B(l) ? C(l) : A(l); });
        int count = 0;
        unsigned less = 0;  // the first lane lowest
        for (int l = 0; l < W; ++l) count += A(l) < B(l) ? 1 : 0, less |= (A(l) < B(l) ? 1u : 0u) << l;
        equal("bits", I::bits(a < b), less);
        equal("bits of negated", I::bits(I::negate(a < b)), ~less & ((1u << W) - 1u));
        equal("count", I::count(a < b), count);
        equal("any", I::any(a < b) ? 1.0 : 0.0, count > 0 ? 1.0 : 0.0);
        equal("any of negated", I::any(I::negate(a < b)) ? 1.0 : 0.0, count < W ? 1.0 : 0.0);
        equal("count of negated", I::count(I::negate(a < b)), W - count);
      }
  }

  void one_argument() {
    for (int p = 0; p < value_count; ++p) {
      const Real a = lanes_from(p, 1);
      const auto A = [&](int l) { return at(p, 1, l); };
      each("load and store", a, A);
      each("set", I::set(values[p]), [&](int) { return values[p]; });
      each("abs", I::abs(a), [&](int l) { return std::fabs(A(l)); });
      each("sqrt", I::sqrt(a), [&](int l) { return std::sqrt(A(l)); });
      each("exact inverse sqrt", inverse_sqrt<I, true>(a), [&](int l) { return 1.0 / std::sqrt(A(l)); });
    }
    // round: nearest, ties to even, odd; zeros may have either sign.
    for (int k = -4096; k <= 4096; ++k) {
      const double x = k / 16.0 + (k % 7) * 0x1p48;
      double up[W], down[W];
      I::store(up, I::round(I::set(x))), I::store(down, I::round(I::set(-x)));
      for (int lane = 0; lane < W; ++lane) {
        equal("round", up[lane], std::nearbyint(x));
        equal("round is odd", down[lane], -up[lane]);
      }
    }
    // Errors below 2 ulp = 4 2^-53 over all exponents that squares of lengths, speeds and forces may have.
    double worst = 0.0;
    for (int k = 0; k < 40000; ++k) {
      double x[W], y[W];
      for (int lane = 0; lane < W; ++lane) x[lane] = std::ldexp(1.0 + (k * W + lane) * 9.3e-6, (k * 37 + lane) % 1700 - 899);
      I::store(y, inverse_sqrt<I, false>(I::load(x)));
      for (int lane = 0; lane < W; ++lane) {
        const long double exact = 1.0L / std::sqrt(static_cast<long double>(x[lane]));
        const double error = static_cast<double>((y[lane] - exact) / exact);
        worst = worst > std::fabs(error) ? worst : std::fabs(error);
      }
    }
    double worst_power = 0.0;
    for (int k = 0; k < 20000; ++k) {
      double x[W], y[W];
      for (int lane = 0; lane < W; ++lane) x[lane] = std::ldexp(1.0 + (k * W + lane) % 9973 * 1e-4, (k * 37 + lane) % 220 - 200);
      I::store(y, five_thirds<I>(I::load(x)));
      for (int lane = 0; lane < W; ++lane) {
        const long double exact = std::pow(static_cast<long double>(x[lane]), 5.0L / 3.0L);
        const double error = static_cast<double>((y[lane] - exact) / exact);
        worst_power = worst_power > std::fabs(error) ? worst_power : std::fabs(error);
      }
    }
    ++report_.compared;
    if (!(worst_power < 0x1p-51)) report_.fail(report_.context, "five thirds, relative error", worst_power, 0x1p-51);
    each("five thirds of nothing", five_thirds<I>(I::set(0.0)), [](int) { return 0.0; });
    ++report_.compared;
    if (!(worst < 4.0 * 0x1p-53)) report_.fail(report_.context, "fast inverse sqrt, relative error", worst, 4.0 * 0x1p-53);
  }

  void across_lanes() {
    for (int p = 0; p < 64; ++p) {
      double v[W], sum = 0.0, largest = -1e9;
      for (int lane = 0; lane < W; ++lane) {
        v[lane] = (p * 13 + lane * 29) % 101 - 50;  // whole numbers: exact in any order
        sum += v[lane];
        largest = v[lane] > largest ? v[lane] : largest;
      }
      equal("sum", I::sum(I::load(v)), sum);
      equal("largest", I::largest(I::load(v)), largest);
    }
  }

  void rows_and_records() {
    constexpr int rows = 19;
    alignas(64) double row[12 * rows];
    for (int k = 0; k < 12 * rows; ++k) row[k] = 1000.0 + k;
    for (int start = 0; start < rows; ++start) {
      std::int32_t index[W];
      for (int lane = 0; lane < W; ++lane) index[lane] = (start + 7 * lane * lane) % rows;
      Real fields[12];
      I::template fetch_rows<12>(row, index, fields);
      for (int k = 0; k < 12; ++k)
        each("fetch_rows", fields[k], [&](int lane) { return 1000.0 + 12 * index[lane] + k; });
      float narrow[rows];
      for (int k = 0; k < rows; ++k) narrow[k] = 1000.0f + static_cast<float>(k);
      each("gather_floats", I::gather_floats(narrow, index), [&](int lane) { return 1000.0 + index[lane]; });
      float near[W];
      I::store_floats(near, I::load(row + start) * I::set(1.0 / 3.0));
      each("load_floats", I::load_floats(near), [&](int lane) { return static_cast<double>(static_cast<float>((1000.0 + start + lane) * (1.0 / 3.0))); });
      Real part_of_row[4];
      std::int32_t place[W];
      for (int lane = 0; lane < W; ++lane) place[lane] = 12 * index[lane];
      I::template fetch_rows<1>(row + 8, place, part_of_row);
      for (int k = 0; k < 4; ++k)
        each("fetch_rows", part_of_row[k], [&](int lane) { return 1008.0 + 12 * index[lane] + k; });

      for (const int first : {0, 4, 8}) {
        alignas(64) double out[12 * W];
        for (double& x : out) x = -1.0;
        const Real part[4] = {fields[first], fields[first + 1], fields[first + 2], fields[first + 3]};
        I::scatter4(out, first, part);
        for (int lane = 0; lane < W; ++lane)
          for (int k = 0; k < 12; ++k)
            same("scatter4", out[12 * lane + k], k >= first && k < first + 4 ? 1000.0 + 12 * index[lane] + k : -1.0);
      }
    }

    Real fields[8], back[8];
    for (int k = 0; k < 8; ++k) {
      double v[W];
      for (int lane = 0; lane < W; ++lane) v[lane] = 10.0 * lane + k + 0.5;
      fields[k] = I::load(v);
    }
    typename I::Record records[W];
    I::to_records(fields, records);
    I::from_records(records, back);
    for (int k = 0; k < 8; ++k) each("from_records", back[k], [&](int lane) { return 10.0 * lane + k + 0.5; });
    alignas(64) double a[8], b[8];
    for (int lane = 0; lane < W; ++lane) {
      I::store_record(a, records[lane]);
      for (int k = 0; k < 8; ++k) same("to_records", a[k], 10.0 * lane + k + 0.5);
      I::store_record(b, I::add(records[lane], I::load_record(a)));
      for (int k = 0; k < 8; ++k) same("add", b[k], a[k] + a[k]);
      I::store_record(b, I::add_if(0xff, records[lane], I::load_record(a)));
      for (int k = 0; k < 8; ++k) same("add_if", b[k], a[k] + a[k]);
      I::store_record(b, I::add_if(0, records[0], I::load_record(a)));
      for (int k = 0; k < 8; ++k) same("add_if not", b[k], a[k]);
      I::store_record(b, I::add_reaction(I::load_record(a), records[W - 1 - lane]));
      for (int k = 0; k < 8; ++k) {
        const double other = 10.0 * (W - 1 - lane) + k + 0.5;
        same("add_reaction", b[k], k < 3 ? a[k] - other : a[k] + other);
      }
    }
    I::store_record(b, I::zero_record());
    for (int k = 0; k < 8; ++k) same("zero_record", b[k], 0.0);
    for (double& x : a) x = std::numeric_limits<double>::quiet_NaN();
    I::store_record(b, I::add_if(0, I::load_record(a), records[0]));  // what is left out may be anything
    for (int k = 0; k < 8; ++k) same("add_if no NaN", b[k], k + 0.5);
  }

 public:
  explicit RealChecks(RealReport& report) : report_(report) {}
  void all() {
    arithmetic();
    folded();
    one_argument();
    across_lanes();
    rows_and_records();
  }
};

}  // namespace
}  // namespace platen
