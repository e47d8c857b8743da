// The look at the lists on every instruction set, against one sphere at a time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/kernel_table.h"
#include "tests/scenes.h"

namespace platen {
namespace {

constexpr std::int32_t count = 48, particles = 43;  // whole vectors, and what fills up the last
constexpr double boundless = std::numeric_limits<double>::infinity();

struct Spheres {
  std::vector<double> x, y, z, vx, vy, vz, then_x, then_y, then_z;
  std::vector<float> margin, room, outer, speed2;  // the second and third of them as the kernel leaves them
  explicit Spheres(std::uint64_t seed) {
    scenes::Sequence random(seed);
    for (auto* column : {&x, &y, &z, &vx, &vy, &vz, &then_x, &then_y, &then_z})
      for (std::int32_t k = 0; k < count; ++k) column->push_back(random.next());
    // Of even seeds nobody has moved as far.
    for (std::int32_t k = 0; k < count; ++k) margin.push_back(static_cast<float>(random.next() + (seed % 2 == 0 ? 2.0 : 0.0)));
    speed2.assign(count, -1.0f);
  }
  LookBatch batch(bool moved) {
    room = outer = margin;
    for (float& of : outer) of += 0.5f;
    return {x.data(), y.data(), z.data(), vx.data(), vy.data(), vz.data(), moved ? then_x.data() : nullptr, moved ? then_y.data() : nullptr,
            moved ? then_z.data() : nullptr, room.data(), outer.data(), speed2.data(), count, particles};
  }
};

const LookConstants constants{0.9, 1.0 / 0.9, 0.0, 0.0, {0.1, -0.05, 0.02}, {0.3, 0.2, 0.1}, boundless};

double room_of(const Spheres& s, std::size_t k, bool moved) {
  if (!moved) return s.margin[k];
  const LookConstants& c = constants;
  double dx = s.x[k] - s.then_x[k] - c.drift[0];
  dx -= c.width * std::nearbyint(dx / c.width);
  return s.margin[k] - std::hypot(dx, s.y[k] - s.then_y[k] - c.drift[1], s.z[k] - s.then_z[k] - c.drift[2]);
}

TEST(Look, SeesWhatOneSphereAtATimeSees) {
  for (const InstructionSet set : available_instruction_sets()) {
    const KernelTable kernels = choose_kernels(set, {});
    for (const std::uint64_t seed : {1, 2, 3})
      for (const bool moved : {true, false}) {
        Spheres s(seed);
        LookTotals totals;
        kernels.look(s.batch(moved), constants, totals);
        double fastest = 0.0, closest = 0.0;
        int used_up = 0;
        for (std::size_t k = 0; k < count; ++k) {
          EXPECT_EQ(s.speed2[k], 0.0);
          if (k >= particles) {
            EXPECT_EQ(s.room[k], boundless) << to_string(set);
            continue;
          }
          const double left = room_of(s, k, moved), left_outside = left + 0.5;
          EXPECT_LE(s.room[k], std::max(left, 0.0)) << to_string(set);
          EXPECT_NEAR(s.room[k], std::max(left, 0.0), 5e-7) << to_string(set);
          EXPECT_LE(s.outer[k], std::max(left_outside, 0.0) + 1e-7) << to_string(set);  // 1e-7: margin and 0.5 have been added in single precision
          EXPECT_NEAR(s.outer[k], std::max(left_outside, 0.0), 1e-6) << to_string(set);
          EXPECT_LE(s.room[k], s.outer[k]);
          const double inverse = 1.0 / std::max(left, 1e-100);
          fastest = std::max(fastest, std::hypot(s.vx[k] - 0.3, s.vy[k] - 0.2, s.vz[k] - 0.1) * inverse);
          closest = std::max(closest, inverse);
          used_up += left < 0.0 ? 1 : 0;
        }
        EXPECT_EQ(used_up > 0, moved && seed % 2 == 1);
        EXPECT_NEAR(totals.fastest / fastest, 1.0, 1e-6) << to_string(set);
        EXPECT_NEAR(totals.closest / closest, 1.0, 1e-6) << to_string(set);
      }
  }
}

// Columns get what rows hold, and rooms become what a look with these columns would have made of them.
TEST(Look, WhatMovedInRowsIsSettled) {
  for (const InstructionSet set : available_instruction_sets()) {
    const KernelTable kernels = choose_kernels(set, {});
    for (const std::uint64_t seed : {1, 2}) {
      Spheres s(seed), looked(seed);
      std::vector<double> u[3];
      scenes::Sequence random(7 + seed);
      for (auto& column : u)
        for (std::int32_t k = 0; k < count; ++k) column.push_back(random.next());
      std::vector<double> rows;
      for (std::size_t k = 0; k < count; ++k)
        for (const double of : {s.x[k], s.y[k], s.z[k], -1.0, s.vx[k], s.vy[k], s.vz[k], -2.0, u[0][k], u[1][k], u[2][k], -3.0}) rows.push_back(of);
      LookTotals totals;
      kernels.look(looked.batch(true), constants, totals);
      const LookBatch b = s.batch(true);
      Spheres columns(seed + 10);
      std::vector<double> spins[3] = {std::vector<double>(count, -1.0), std::vector<double>(count, -1.0), std::vector<double>(count, -1.0)};
      columns.x = s.then_x, columns.y = s.then_y, columns.z = s.then_z;
      kernels.settle({rows.data(), columns.x.data(), columns.y.data(), columns.z.data(), columns.vx.data(), columns.vy.data(), columns.vz.data(), spins[0].data(), spins[1].data(),
                      spins[2].data(), b.inner, b.outer, count},
                     constants);
      EXPECT_EQ(columns.x, s.x);
      EXPECT_EQ(columns.y, s.y);
      EXPECT_EQ(columns.z, s.z);
      EXPECT_EQ(columns.vx, s.vx);
      EXPECT_EQ(columns.vy, s.vy);
      EXPECT_EQ(columns.vz, s.vz);
      for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(spins[axis], u[axis]);
      for (std::size_t k = 0; k < particles; ++k) {
        EXPECT_EQ(s.room[k], looked.room[k]);
        EXPECT_EQ(s.outer[k], looked.outer[k]);
      }
    }
  }
}

// Spheres with much room, one of them fast with little, and one in the same lane of any vector that is nowhere.
TEST(Look, ASphereThatIsNowhereHidesNoOther) {
  for (const InstructionSet set : available_instruction_sets())
    for (const std::size_t lost : {std::size_t{8}, std::size_t{20}, std::size_t{42}})
      for (const bool before : {true, false}) {
        const std::size_t tight = before || lost + 8 >= particles ? lost - 8 : lost + 8;
        Spheres s(4);
        for (float& margin : s.margin) margin = 10.0f;
        s.margin[tight] = 3.0f, s.vx[tight] = 50.0;
        const double left = room_of(s, tight, true);
        s.x[lost] = s.vy[lost] = std::numeric_limits<double>::quiet_NaN();
        LookTotals totals;
        choose_kernels(set, {}).look(s.batch(true), constants, totals);
        EXPECT_NEAR(totals.closest * left, 1.0, 1e-6) << to_string(set);
        EXPECT_NEAR(totals.fastest * left, std::hypot(50.0 - 0.3, s.vy[tight] - 0.2, s.vz[tight] - 0.1), 1e-4) << to_string(set);
        EXPECT_TRUE(std::isnan(s.room[lost]));  // by which it is found
      }
}

}  // namespace
}  // namespace platen
