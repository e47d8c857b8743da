// Memory on huge pages [core/huge_pool.h].
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <random>
#include <set>
#include <thread>
#include <vector>

#include "core/aligned.h"
#include "core/chunked.h"
#include "core/huge_pool.h"

namespace platen {
namespace {

struct Taken {
  PoolBlock block;
  unsigned char mark;
};

// Blocks of any size, in any order: each keeps what was written to all of it until it goes back.
void take_and_give(unsigned seed, int rounds, std::vector<Taken>& taken) {
  std::mt19937 random(seed);
  for (int round = 0; round < rounds; ++round) {
    if (taken.empty() || random() % 5 < 3) {
      const std::size_t bytes = std::size_t{1} << (random() % 18), wanted = bytes + random() % bytes;
      const Taken one{take_from_pool(wanted), static_cast<unsigned char>(random())};
      ASSERT_GE(one.block.bytes, wanted);
      ASSERT_EQ(reinterpret_cast<std::uintptr_t>(one.block.memory) % 64, 0u);
      std::memset(one.block.memory, one.mark, one.block.bytes);
      taken.push_back(one);
    } else {
      std::swap(taken[random() % taken.size()], taken.back());
      const auto* const at = static_cast<const unsigned char*>(taken.back().block.memory);
      const unsigned char mark = taken.back().mark;
      ASSERT_TRUE(std::all_of(at, at + taken.back().block.bytes, [mark](unsigned char c) { return c == mark; }));
      give_to_pool(taken.back().block);
      taken.pop_back();
    }
  }
}

TEST(HugePool, BlocksAreTheirOwners) {
  const PoolUse before = pool_use();
  std::vector<std::vector<Taken>> taken(4);
  std::vector<std::thread> threads;
  for (unsigned k = 0; k < 4; ++k) threads.emplace_back([&, k] { take_and_give(k, 3000, taken[k]); });
  for (std::thread& thread : threads) thread.join();
  std::vector<Taken> all;
  std::size_t bytes = 0;
  for (const auto& of_thread : taken)
    for (const Taken& one : of_thread) all.push_back(one), bytes += one.block.bytes;
  ASSERT_GT(all.size(), 100u);
  EXPECT_EQ(pool_use().in_use, before.in_use + bytes);
  std::sort(all.begin(), all.end(), [](const Taken& a, const Taken& b) { return a.block.memory < b.block.memory; });
  for (std::size_t k = 1; k < all.size(); ++k)
    EXPECT_LE(static_cast<char*>(all[k - 1].block.memory) + all[k - 1].block.bytes, static_cast<char*>(all[k].block.memory));
  for (const Taken& one : all) give_to_pool(one.block);
  EXPECT_EQ(pool_use().in_use, before.in_use);
}

// What was given back in small pieces can be taken as a large one.
TEST(HugePool, JoinsWhatIsFree) {
  constexpr std::size_t slab = std::size_t{1} << 25, piece = 20000;
  std::vector<PoolBlock> pieces;
  for (std::size_t bytes = 0; bytes < 4 * slab; bytes += piece) pieces.push_back(take_from_pool(piece));
  const std::size_t held = pool_use().held;
  std::shuffle(pieces.begin(), pieces.end(), std::mt19937(1));
  for (const PoolBlock& block : pieces) give_to_pool(block);
  std::vector<PoolBlock> large;
  for (int k = 0; k < 3; ++k) large.push_back(take_from_pool(slab / 2 + slab / 4));
  EXPECT_EQ(pool_use().held, held);
  for (const PoolBlock& block : large) give_to_pool(block);
}

// What nobody uses may go; what somebody uses stays.
TEST(HugePool, TrimsWhatIsFree) {
  std::vector<Taken> taken;
  take_and_give(5, 2000, taken);
  const std::size_t page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE)), size = std::size_t{1} << 23, pages = size / page;
  const PoolBlock large = take_from_pool(size + page);
  std::memset(large.memory, 1, large.bytes);
  const auto resident = [&] {
    void* const first = reinterpret_cast<void*>((reinterpret_cast<std::uintptr_t>(large.memory) + page - 1) / page * page);
    std::vector<unsigned char> in_core(pages);
    EXPECT_EQ(mincore(first, size, in_core.data()), 0);
    return std::count_if(in_core.begin(), in_core.end(), [](unsigned char c) { return (c & 1) != 0; });
  };
  EXPECT_EQ(resident(), static_cast<std::ptrdiff_t>(pages));
  give_to_pool(large);
  trim_pool();
  EXPECT_LE(resident(), static_cast<std::ptrdiff_t>(pages / 2));  // at least two of its four huge pages are free as a whole
  ASSERT_GT(taken.size(), 100u);
  for (const Taken& one : taken) {
    const auto* const at = static_cast<const unsigned char*>(one.block.memory);
    EXPECT_TRUE(std::all_of(at, at + one.block.bytes, [&](unsigned char c) { return c == one.mark; }));
    give_to_pool(one.block);
  }
  taken.clear();
  take_and_give(6, 2000, taken);
  for (const Taken& one : taken) give_to_pool(one.block);
}

// Arrays of equal length, one after the other, do not begin at the same place of the first cache.
TEST(HugePool, BlocksOfOneSizeStartAtAllPlacesOfAPage) {
  for (const std::size_t bytes : {8 * 4096, 8 * 4096 + 2048, 8 * 4096 + 64, 12345}) {
    const PoolBlock block = take_from_pool(bytes);
    std::set<std::size_t> starts;
    for (std::size_t k = 0; k < 64; ++k) starts.insert(k * block.bytes % 4096);
    EXPECT_EQ(starts.size(), 64u) << bytes;
    give_to_pool(block);
  }
}

TEST(AlignedArray, RenewsInMemoryOfItsLength) {
  AlignedArray<double> a;
  a.assign(100000, 1.0);
  a.renew(99000, 2.0);  // nearly as long: the same memory
  EXPECT_GE(a.capacity(), 100000u);
  a.renew(50000, 3.0);
  EXPECT_LT(a.capacity(), 51000u);
  EXPECT_EQ(a.size(), 50000u);
  EXPECT_TRUE(std::all_of(a.begin(), a.end(), [](double v) { return v == 3.0; }));
  a.renew(60000, 4.0);
  EXPECT_LT(a.capacity(), 61000u);
  EXPECT_TRUE(std::all_of(a.begin(), a.end(), [](double v) { return v == 4.0; }));
}

// Some that the pool has and some that are too large for it.
TEST(AlignedArray, KeepsItsContentAtEverySize) {
  AlignedArray<double> a;
  std::size_t known = 0;
  const auto is_kept = [&] {
    for (std::size_t k = 0; k < known; ++k)
      if (a[k] != static_cast<double>(k)) return false;
    return true;
  };
  for (const std::size_t size : {100u, 200000u, 3000000u, 5000000u}) {
    a.resize(size);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(a.data()) % 64, 0u);
    EXPECT_TRUE(is_kept());
    EXPECT_TRUE(std::all_of(a.begin() + static_cast<std::ptrdiff_t>(known), a.end(), [](double v) { return v == 0.0; }));
    for (std::size_t k = known; k < size; ++k) a[k] = static_cast<double>(k);
    known = size;
    a.resize_to_overwrite(size + size / 2);
    EXPECT_EQ(a.size(), size + size / 2);
    EXPECT_TRUE(is_kept());
    a.resize_to_overwrite(size);
  }
}

TEST(PooledVector, KeepsItsContentAtEverySize) {
  for (const std::size_t size : {100u, 200000u, 3000000u}) {
    PooledVector<std::int64_t> v(size, 7);
    EXPECT_TRUE(std::all_of(v.begin(), v.end(), [](std::int64_t x) { return x == 7; }));
    v.resize(2 * size);  // what is new has no value yet
    EXPECT_TRUE(std::all_of(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(size), [](std::int64_t x) { return x == 7; }));
    std::iota(v.begin(), v.end(), 0);
    const PooledVector<std::int64_t> copy = v;
    v.resize(size), v.shrink_to_fit();
    v.push_back(-1);
    EXPECT_EQ(v.back(), -1);
    EXPECT_TRUE(std::equal(v.begin(), v.end() - 1, copy.begin()));
    EXPECT_EQ(copy.back(), static_cast<std::int64_t>(2 * size - 1));
  }
}

// Pieces are whole but for the last, and hold what an array in a row would.
TEST(Chunked, HoldsWhatARowWould) {
  constexpr std::size_t piece = ChunkedArray<std::int32_t>::piece;
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, piece - 1, piece, piece + 1, 3 * piece + 7}) {
    std::vector<std::int32_t> row;
    for (std::size_t k = 0; k < size; ++k) row.push_back(static_cast<std::int32_t>(7 * k));
    ChunkedArray<std::int32_t> chunked;
    chunked.resize_to_overwrite(5 * piece);
    chunked.assign(row);
    ASSERT_EQ(chunked.size(), size);
    for (std::size_t k = 0; k < size; ++k) ASSERT_EQ(chunked[k], row[k]);
    if (size > 0) chunked[size - 1] = -1, row[size - 1] = -1;
    EXPECT_EQ(chunked.in_a_row(), row);
    for (std::size_t k = 0; k + 8 <= size; k += 8) ASSERT_EQ(&chunked[k + 7] - &chunked[k], 7) << "eight of a record";
  }
}

TEST(Chunked, StretchesAcrossPieces) {
  constexpr std::size_t piece = 8;
  ChunkedArray<int, piece> chunked;
  std::vector<int> row;
  for (const std::size_t size : {3 * piece + 5, 2 * piece, piece - 1}) {
    chunked.resize_to_overwrite(size);
    row.resize(size);
    for (std::size_t from = 0; from < size; from += 5) {
      const std::size_t count = std::min<std::size_t>(5, size - from);
      for (std::size_t k = from; k < from + count; ++k) row[k] = static_cast<int>(100 * size + k);
      chunked.put(from, row.data() + from, count);
    }
    EXPECT_EQ(chunked.in_a_row(), row);
    std::vector<int> back(size + 1, -1);
    chunked.get(1, back.data(), size - 1);
    EXPECT_TRUE(std::equal(row.begin() + 1, row.end(), back.begin()));
    EXPECT_EQ(back[size - 1], -1);
  }
  chunked.release();
  EXPECT_EQ(chunked.size(), 0u);
  chunked.get(0, nullptr, 0);
}

// What an array of lists is given anew may lie where it was.
TEST(AlignedArray, GivesBackBeforeItTakes) {
  if (!pools) GTEST_SKIP() << "AddressSanitizer keeps what is given back";
  AlignedArray<char> array;
  array.assign(12'000'000, 'a');  // of a block of whole huge pages, which has half a MB more
  const char* const place = array.data();
  const std::size_t held = pool_use().held;
  array.assign(12'100'000, 'b');
  EXPECT_EQ(array.data(), place);
  EXPECT_EQ(array[12'099'999], 'b');
  EXPECT_EQ(pool_use().held, held);
}

}  // namespace
}  // namespace platen
