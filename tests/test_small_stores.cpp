// What large beds keep in few bytes: ids, owners of pairs, who waits for whom, sides that were crossed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/ids.h"
#include "core/owned_counts.h"
#include "core/particles.h"
#include "core/task_successors.h"

namespace platen {
namespace {

TEST(Ids, InARowOrNot) {
  for (const std::vector<std::int64_t>& ids : std::vector<std::vector<std::int64_t>>{{}, {7}, {-2, -1, 0, 1}, {1, 2, 4}, {1, 1, 3}, {0, 5, 1'000'000'000'000}}) {
    const Ids kept(ids);
    ASSERT_EQ(kept.size(), ids.size());
    EXPECT_EQ(kept.all(), ids);
    for (std::size_t rank = 0; rank < ids.size(); ++rank) EXPECT_EQ(kept[rank], ids[rank]);
  }
  EXPECT_EQ(Ids().all(), std::vector<std::int64_t>());
}

TEST(OwnedCounts, AnyNumberOfEach) {
  const std::vector<std::int32_t> counts = {0, 3, 254, 255, 256, 0, 0, 510, 100000, 1, 0};
  OwnedCounts owned;
  for (const std::int32_t count : counts) owned.add(count);
  owned.fit();
  std::size_t spheres = 0;
  std::int32_t begin = 0;
  owned.for_each([&](std::int32_t sphere, std::int32_t first, std::int32_t end) {
    ASSERT_LT(spheres, counts.size());
    EXPECT_EQ(sphere, static_cast<std::int32_t>(spheres));
    EXPECT_EQ(first, begin);
    EXPECT_EQ(end - first, counts[spheres++]);
    begin = end;
  });
  EXPECT_EQ(spheres, counts.size());
  std::vector<std::int32_t> expected, owner(static_cast<std::size_t>(begin) + OwnedCounts::beyond + 1, -1);
  for (std::size_t k = 0; k < counts.size(); ++k) expected.insert(expected.end(), static_cast<std::size_t>(counts[k]), 70 + static_cast<std::int32_t>(k));
  owned.name_owners(70, owner.data());
  EXPECT_EQ(owner.back(), -1);
  owner.resize(expected.size());
  EXPECT_EQ(owner, expected);
}

TEST(TaskSuccessors, FromThoseWhoWait) {
  // 0 -> 1, 2, 4;  1 -> 4;  2 -> 3;  3 -> 4;  4 -> none
  const std::vector<std::int32_t> before = {0, 0, 2, 1, 3, 0}, waits_for = {0, 1, 1, 1, 3};
  TaskSuccessors successors(before, waits_for);
  const std::vector<std::vector<std::int32_t>> expected = {{1, 2, 4}, {4}, {3}, {4}, {}};
  ASSERT_EQ(successors.size(), 5u);
  const auto list = [](const TaskSuccessors& of, std::size_t task) { return std::vector<std::int32_t>(of[task].begin(), of[task].end()); };
  for (std::size_t t = 0; t < 5; ++t) EXPECT_EQ(list(successors, t), expected[t]);
  TaskSuccessors reversed;
  for (std::size_t t = 5; t-- > 0;) reversed.add(successors[t], [](std::int32_t next) { return 4 - next; });
  EXPECT_EQ(reversed.edges(), successors.edges());
  EXPECT_EQ(list(reversed, 4), (std::vector<std::int32_t>{3, 2, 0}));
  EXPECT_EQ(list(reversed, 0), std::vector<std::int32_t>());
  EXPECT_FALSE(successors.remove(1, 2));
  EXPECT_TRUE(successors.remove(0, 2));
  EXPECT_FALSE(successors.remove(0, 2));
  EXPECT_EQ(list(successors, 0), (std::vector<std::int32_t>{1, 4}));
  EXPECT_EQ(list(successors, 2), (std::vector<std::int32_t>{3}));
  EXPECT_EQ(list(successors, 3), (std::vector<std::int32_t>{4}));
}

TEST(Particles, CrossingsAreKept) {
  Particles p;
  p.resize(20, true);
  p.image[2 * 9] = 5, p.crossed[2 * 9] = -128, p.crossed[2 * 9 + 1] = 127, p.crossed[2 * 3] = 1, p.crossed[2 * 17 + 1] = -1;
  EXPECT_EQ(p.boxes(9, 0), -123);
  EXPECT_EQ(p.boxes(3, 0), 1);
  p.keep_crossings(8, 8);  // of a batch
  EXPECT_EQ(p.image[2 * 9], -123);
  EXPECT_EQ(p.image[2 * 9 + 1], 127);
  EXPECT_EQ(p.crossed[2 * 9], 0);
  EXPECT_EQ(p.crossed[2 * 9 + 1], 0);
  EXPECT_EQ(p.boxes(9, 0), -123);
  EXPECT_EQ(p.image[2 * 3], 0);
  EXPECT_EQ(p.crossed[2 * 3], 1);
  EXPECT_EQ(p.crossed[2 * 17 + 1], -1);
}

}  // namespace
}  // namespace platen
