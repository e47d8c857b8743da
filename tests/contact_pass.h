// One pass of the contact kernel over copies of what a batch holds.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/float_mode.h"
#include "core/simulation.h"

namespace platen::test {

// What a pass over a batch leaves behind, as bits.
struct Pass {
  std::string history, sums;
  PairTotals totals;
  bool operator==(const Pass& o) const {
    return history == o.history && sums == o.sums && totals.contacts == o.totals.contacts && totals.out_of_range == o.totals.out_of_range &&
           std::equal(std::begin(totals.energy), std::end(totals.energy), std::begin(o.totals.energy));
  }
};
// `ahead`: partners are asked for so far ahead, and history with them; 0: nobody asks. `others`: what tasks to come need.
// `in_rows`: the batch's columns have to be made from its rows first.
inline Pass pass(const Simulation& sim, const Batch& b, bool dense, double leap_bound, std::int32_t ahead = 0, const StretchesOfLines& others = {}, bool in_rows = false) {
  const FloatMode mode;
  const Particles& p = sim.state();
  const auto copied = [](const AlignedArray<double>& from) {
    AlignedArray<double> to;
    to.resize(from.size());
    std::copy(from.begin(), from.end(), to.begin());
    return to;
  };
  AlignedArray<double> sp = copied(b.sp), tx = copied(b.tx), ty = copied(b.ty), tz = copied(b.tz), k_t = copied(b.k_t_last), sum;
  sum.assign(b.sum.size(), 0.0);
  LawConstants law = sim.law();
  law.dt = sim.time_step();
  const auto nothing = static_cast<std::int32_t>(sum.size() * sizeof(double)) - record_bytes;
  AlignedArray<double> stage;
  if (in_rows) stage.resize(static_cast<std::size_t>(9 * stage_column(b.count)));
  const auto state = [&](const AlignedArray<double>& column) { return in_rows ? nullptr : column.data() + b.first; };
  PairBatch pairs{p.rows.data(), p.rows.data() + row_size * static_cast<std::int64_t>(b.first), b.row_j.data(), b.to.data(), b.owners_of_eight.data(), sp.data(), tx.data(), ty.data(), tz.data(),
                  k_t.empty() ? nullptr : k_t.data(), sum.data(), b.first, b.padded, b.first + b.count, nothing, dense, leap_bound,
                  state(p.x), state(p.y), state(p.z), state(p.vx), state(p.vy), state(p.vz), state(p.ux), state(p.uy), state(p.uz), stage.data(), ahead, p.padded, ahead != 0, nullptr, 0, 0};
  others.put_into(pairs);
  Pass found;
  sim.kernels().contacts(pairs, law, found.totals);
  const auto bits = [](const AlignedArray<double>& of, std::size_t count) { return std::string(reinterpret_cast<const char*>(of.data()), count * sizeof(double)); };
  for (const auto* column : {&sp, &tx, &ty, &tz, &k_t}) found.history += bits(*column, column->size());
  found.sums = bits(sum, sum.size());
  for (std::size_t k = sum.size() - record_size; k < sum.size(); ++k) EXPECT_EQ(sum[k], 0.0) << "the record that stays zero";
  return found;
}

}  // namespace platen::test
