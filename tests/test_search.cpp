// The search for neighbours in a few runs of cells, on every instruction set, against one pair at a time.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/kernel_table.h"
#include "tests/scenes.h"

namespace platen {
namespace {

struct Members {
  std::vector<double> x, y, z, reach, number;
  std::vector<std::int32_t> particle;
  SearchMembers view;

  Members(int count, std::uint64_t seed, double width, double depth) {
    scenes::Sequence random(seed);
    for (int k = 0; k < count + padding; ++k) {
      x.push_back(random.next()), y.push_back(random.next()), z.push_back(random.next());
      reach.push_back(0.1 + 0.2 * random.next());
      particle.push_back(static_cast<std::int32_t>((k * 37) % count));  // in no order
      number.push_back(particle.back());
    }
    view = {x.data(), y.data(), z.data(), reach.data(), number.data(), particle.data(),
            width, width > 0.0 ? 1.0 / width : 0.0, depth, depth > 0.0 ? 1.0 / depth : 0.0};
  }
};

std::vector<std::int32_t> one_by_one(const SearchMembers& m, const std::vector<SearchRange>& ranges, const SearchedSphere& s) {
  std::vector<std::int32_t> found;
  for (const SearchRange& r : ranges)
    for (std::int32_t k = r.first; k < r.last; ++k) {
      double dx = r.x - m.x[k], dy = r.y - m.y[k];
      const double dz = r.z - m.z[k], both = s.reach + m.reach[k];
      if (m.width > 0.0) dx -= m.width * std::nearbyint(dx / m.width);
      if (m.depth > 0.0) dy -= m.depth * std::nearbyint(dy / m.depth);
      const auto number = static_cast<double>(m.particle[k]);
      if (dx * dx + dy * dy + dz * dz < both * both && (number > s.particle || number < s.first_of_batch)) found.push_back(m.particle[k]);
    }
  return found;
}

TEST(Search, FindsWhatOnePairAtATimeFinds) {
  const int count = 101;  // a prime, so that 37 k runs through all numbers
  for (const InstructionSet set : available_instruction_sets()) {
    const KernelTable kernels = choose_kernels(set, {});
    ASSERT_NE(kernels.search, nullptr);
    std::size_t all = 0;
    for (const double width : {0.0, 0.7})
      for (const double depth : {0.0, 0.6}) {
        const Members members(count, 5, width, depth);
        scenes::Sequence random(11);
        for (int n = 0; n < 200; ++n) {
          const auto number = static_cast<double>(n % count);
          const SearchedSphere sphere{0.3 * random.next(), number, std::min(number, 20.0 + n % 3)};
          const double x = random.next(), y = random.next(), z = random.next();
          std::vector<SearchRange> ranges;
          std::int32_t first = n % 5;
          for (int r = 0; r < 4; ++r) {  // of every length from nothing to some vectors; the last ends with the members
            const std::int32_t last = r == 3 ? count : std::min(count, first + (n + 7 * r) % 21);
            ranges.push_back({first, last, x + 0.1 * r, y - 0.1 * r, z});
            first = last;
          }
          std::vector<std::int32_t> found(static_cast<std::size_t>(count + padding), -1);
          const int kept = kernels.search(members.view, ranges.data(), 4, sphere, found.data());
          const std::vector<std::int32_t> wanted = one_by_one(members.view, ranges, sphere);
          for (std::size_t k = static_cast<std::size_t>(kept + padding); k < found.size(); ++k) EXPECT_EQ(found[k], -1) << to_string(set);
          found.resize(static_cast<std::size_t>(kept));
          EXPECT_EQ(found, wanted) << to_string(set);
          all += wanted.size();
        }
      }
    EXPECT_GT(all, 5000u);
  }
}

TEST(Search, OfNothing) {
  const Members members(3, 1, 0.0, 0.0);
  for (const InstructionSet set : available_instruction_sets()) {
    std::int32_t found[padding];
    const SearchRange empty{2, 2, 0.0, 0.0, 0.0};
    EXPECT_EQ(choose_kernels(set, {}).search(members.view, nullptr, 0, {1.0, 0.0, 0.0}, found), 0);
    EXPECT_EQ(choose_kernels(set, {}).search(members.view, &empty, 1, {1.0, 0.0, 0.0}, found), 0);
  }
}

}  // namespace
}  // namespace platen
