// The choice of pairs for the inner list on every instruction set, against one pair at a time.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/kernel_table.h"
#include "tests/scenes.h"

namespace platen {
namespace {

TEST(Choose, TakesWhatOnePairAtATimeTakes) {
  constexpr std::int32_t spheres = 40;
  scenes::Sequence random(3);
  std::vector<double> rows;
  std::vector<float> margin;
  for (std::int32_t k = 0; k < spheres; ++k) {
    for (int field = 0; field < row_size; ++field) rows.push_back(field == 3 ? 0.1 + 0.1 * random.next() : random.next());
    margin.push_back(static_cast<float>(0.2 * random.next()));
  }
  std::vector<std::int32_t> i, j;
  for (std::int32_t k = 0; k < 200; ++k) i.push_back(k * spheres / 200), j.push_back(k * 17 % spheres);
  for (const InstructionSet set : available_instruction_sets()) {
    const KernelTable kernels = choose_kernels(set, {});
    ASSERT_NE(kernels.choose, nullptr);
    int taken = 0, left = 0;
    for (const double width : {0.0, 0.7})
      for (const double depth : {0.0, 0.6})
        for (const std::size_t count : {0, 1, 3, 7, 8, 9, 63, 64, 65, 71, 128, 200}) {
          std::vector<std::uint64_t> chosen((count + 63) / 64 + 1, ~std::uint64_t{0});
          kernels.choose({rows.data(), margin.data(), i.data(), j.data(), static_cast<std::int64_t>(count), width, width > 0.0 ? 1.0 / width : 0.0,
                          depth, depth > 0.0 ? 1.0 / depth : 0.0, chosen.data()});
          for (std::size_t k = 0; k < count; ++k) {
            const double *a = rows.data() + row_size * static_cast<std::size_t>(i[k]), *b = rows.data() + row_size * static_cast<std::size_t>(j[k]);
            double dx = a[0] - b[0], dy = a[1] - b[1];
            if (width > 0.0) dx -= width * std::nearbyint(dx / width);
            if (depth > 0.0) dy -= depth * std::nearbyint(dy / depth);
            const double reach = a[3] + b[3] + margin[static_cast<std::size_t>(i[k])] + margin[static_cast<std::size_t>(j[k])];
            const bool close = std::hypot(dx, dy, a[2] - b[2]) < reach;
            EXPECT_EQ(chosen[k / 64] >> (k % 64) & 1, close ? 1u : 0u) << to_string(set) << ", pair " << k << " of " << count;
            ++(close ? taken : left);
          }
          if (count % 64 != 0) {
            EXPECT_EQ(chosen[count / 64] >> (count % 64), 0u) << "bits of no pair";
          }
          EXPECT_EQ(chosen.back(), ~std::uint64_t{0}) << "beyond the last word";
        }
    EXPECT_GT(taken, 100);
    EXPECT_GT(left, 100);
  }
}

}  // namespace
}  // namespace platen
