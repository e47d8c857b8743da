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
  std::vector<double> x, y, z, vx, vy, vz, then_x, then_y, then_z, margin, room, speed2;
  explicit Spheres(std::uint64_t seed) {
    scenes::Sequence random(seed);
    for (auto* column : {&x, &y, &z, &vx, &vy, &vz, &then_x, &then_y, &then_z, &margin})
      for (std::int32_t k = 0; k < count; ++k) column->push_back(random.next());
    for (std::int32_t k = 0; k < count; ++k) margin[static_cast<std::size_t>(k)] *= 0.8;  // some have moved farther
    room.assign(count, -1.0), speed2.assign(count, -1.0);
  }
  LookBatch batch(bool moved) {
    return {x.data(), y.data(), z.data(), vx.data(), vy.data(), vz.data(), moved ? then_x.data() : nullptr, moved ? then_y.data() : nullptr,
            moved ? then_z.data() : nullptr, margin.data(), room.data(), speed2.data(), count, particles};
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
          const double left = room_of(s, k, moved);
          EXPECT_NEAR(s.room[k], std::max(left, 0.0), 1e-14) << to_string(set);
          const double inverse = 1.0 / std::max(left, 1e-100);
          fastest = std::max(fastest, std::hypot(s.vx[k] - 0.3, s.vy[k] - 0.2, s.vz[k] - 0.1) * inverse);
          closest = std::max(closest, inverse);
          used_up += left < 0.0 ? 1 : 0;
        }
        EXPECT_EQ(used_up > 0, moved);
        EXPECT_NEAR(totals.fastest / fastest, 1.0, 1e-12) << to_string(set);
        EXPECT_NEAR(totals.closest / closest, 1.0, 1e-12) << to_string(set);
      }
  }
}

TEST(Look, ASphereThatIsNowhereHidesNoOther) {
  for (const InstructionSet set : available_instruction_sets()) {
    for (const std::size_t lost : {std::size_t{0}, std::size_t{12}, std::size_t{particles - 1}}) {
      Spheres s(4), whole(4);
      s.x[lost] = s.vy[lost] = std::numeric_limits<double>::quiet_NaN();
      whole.margin[lost] = whole.then_x[lost] = 1e300;  // as good as not there
      LookTotals totals, others;
      choose_kernels(set, {}).look(s.batch(true), constants, totals);
      whole.x[lost] = 1e300;
      choose_kernels(set, {}).look(whole.batch(true), constants, others);
      EXPECT_EQ(totals.fastest, others.fastest) << to_string(set);
      EXPECT_EQ(totals.closest, others.closest) << to_string(set);
    }
  }
}

}  // namespace
}  // namespace platen
