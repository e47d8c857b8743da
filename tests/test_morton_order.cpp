// The order of particles in memory: a permutation, neighbours close to each other, whatever shape the bed has.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <utility>
#include <vector>

#include "core/morton_order.h"
#include "tests/scenes.h"

namespace platen {
namespace {

Particles grid(int nx, int ny, int nz) {
  Particles p;
  p.resize(nx * ny * nz, true);
  p.common_radius = 0.5;
  scenes::Sequence random(3);
  std::size_t at = 0;
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i, ++at) {
        const auto jitter = [&](int n) { return n > 1 ? random.between(-0.1, 0.1) : 0.0; };
        p.rank[at] = static_cast<std::int32_t>(at);
        p.x[at] = i + jitter(nx), p.y[at] = j + jitter(ny), p.z[at] = k + jitter(nz);
      }
  return p;
}

bool is_permutation(std::vector<std::int32_t> order, std::int32_t count) {
  std::sort(order.begin(), order.end());
  if (order.size() != static_cast<std::size_t>(count)) return false;
  for (std::int32_t k = 0; k < count; ++k)
    if (order[static_cast<std::size_t>(k)] != k) return false;
  return true;
}

// Of the pairs next to each other on the grid, the share whose places in memory lie further apart than `window`.
double far_apart(const std::vector<std::int32_t>& order, int nx, int ny, int nz, int window) {
  std::vector<int> place(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) place[static_cast<std::size_t>(order[k])] = static_cast<int>(k);
  int pairs = 0, far = 0;
  const auto of = [&](int i, int j, int k) { return place[static_cast<std::size_t>((k * ny + j) * nx + i)]; };
  const auto look = [&](int a, int b) { ++pairs, far += std::abs(a - b) > window; };
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        if (i + 1 < nx) look(of(i, j, k), of(i + 1, j, k));
        if (j + 1 < ny) look(of(i, j, k), of(i, j + 1, k));
        if (k + 1 < nz) look(of(i, j, k), of(i, j, k + 1));
      }
  return static_cast<double>(far) / pairs;
}

// Whatever the keys are, sorting makes a permutation: this looks for crashes.
TEST(MortonOrder, TakesBedsOfAnyShape) {
  for (const auto& n : std::vector<std::array<int, 3>>{{1, 1, 1}, {1, 1, 5}, {7, 1, 1}, {1, 9, 4}, {6, 5, 1}, {40, 3, 2}, {3, 40, 60}, {20, 20, 20}})
    for (const int layer : {1, 30, 1000000}) {
      const Particles p = grid(n[0], n[1], n[2]);
      EXPECT_TRUE(is_permutation(morton_order(p, layer), p.count)) << n[0] << " x " << n[1] << " x " << n[2] << ", layers of " << layer;
    }
  Particles one_place = grid(3, 3, 3);
  for (auto* column : {&one_place.x, &one_place.y, &one_place.z}) std::fill(column->begin(), column->end(), 0.25);
  EXPECT_TRUE(is_permutation(morton_order(one_place), 27));
}

// The same spheres in another order to begin with come to lie in the same order.
TEST(MortonOrder, DependsOnPlacesAlone) {
  const Particles p = grid(12, 9, 15);
  Particles mixed = grid(12, 9, 15);
  scenes::Sequence random(7);
  for (std::size_t k = static_cast<std::size_t>(p.count) - 1; k > 0; --k) {
    const auto other = static_cast<std::size_t>(random.next() * static_cast<double>(k + 1));
    for (auto* column : {&mixed.x, &mixed.y, &mixed.z}) std::swap((*column)[k], (*column)[other]);
  }
  const auto order = morton_order(p), order_mixed = morton_order(mixed);
  for (std::size_t k = 0; k < order.size(); ++k) {
    const auto a = static_cast<std::size_t>(order[k]), b = static_cast<std::size_t>(order_mixed[k]);
    ASSERT_TRUE(p.x[a] == mixed.x[b] && p.y[a] == mixed.y[b] && p.z[a] == mixed.z[b]) << k;
  }
}

TEST(MortonOrder, LayersGrowWithTheBed) {
  const Particles small = grid(30, 20, 60), large = grid(10, 8, 700);  // layers of 1,200 and of 5,600
  EXPECT_EQ(morton_order(small), morton_order(small, 500));
  EXPECT_NE(morton_order(small), morton_order(small, 1000));
  EXPECT_EQ(morton_order(large), morton_order(large, 1000));
  EXPECT_NE(morton_order(large), morton_order(large, 500));
}

// Stretches of the bed are sorted by whoever comes, in any order.
TEST(MortonOrder, SharedAmongThreads) {
  const Particles places = grid(40, 40, 30);
  const auto bed = [&](bool equal) {  // three spheres fewer, so that a vector is filled up
    Particles p;
    p.resize(places.count - 3, equal);
    p.common_radius = 0.5, p.common_mass = 2.0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(p.count); ++k) {
      p.rank[k] = static_cast<std::int32_t>(k);
      p.x[k] = places.x[k], p.y[k] = places.y[k], p.z[k] = places.z[k], p.vx[k] = 1.0 + static_cast<double>(k);
      p.image[2 * k] = static_cast<std::int32_t>(k), p.image[2 * k + 1] = 1 - static_cast<std::int32_t>(k), p.crossed[2 * k + 1] = -1;
      if (!equal) p.radius[k] = 0.4 + 1e-6 * static_cast<double>(k);
    }
    return p;
  };
  for (const bool equal : {true, false}) {
    const Particles before = bed(equal);
    Particles p = bed(equal);
    ASSERT_NE(p.count, p.padded);
    ASSERT_GT(stretches_of(static_cast<std::size_t>(p.count)), 4);
    int bodies = 0;
    const ParallelFor backwards = [&](int count, const std::function<void(int)>& body) {
      for (int k = count; k-- > 0; ++bodies) body(k);
    };
    const std::vector<std::int32_t> order = morton_order(p);
    EXPECT_EQ(order, morton_order(p, 0, backwards));
    EXPECT_GT(std::exchange(bodies, 0), 0);
    p.permute(order, backwards);
    EXPECT_GT(bodies, 0);
    for (std::size_t k = 0; k < order.size(); ++k) {
      const auto from = static_cast<std::size_t>(order[k]);
      ASSERT_EQ(p.x[k], before.x[from]);
      ASSERT_EQ(p.vx[k], before.vx[from]);
      ASSERT_EQ(p.radius_of(static_cast<std::int32_t>(k)), before.radius_of(order[k]));
      ASSERT_EQ(p.rank[k], order[k]);
      ASSERT_EQ(p.image[2 * k], order[k]);
      ASSERT_EQ(p.image[2 * k + 1], -order[k]);
      ASSERT_EQ(p.crossed[2 * k + 1], 0);
    }
    const std::vector<std::int32_t> place = p.places();
    for (std::size_t k = 0; k < order.size(); ++k) ASSERT_EQ(place[static_cast<std::size_t>(order[k])], static_cast<std::int32_t>(k));
    for (auto k = static_cast<std::size_t>(p.count); k < static_cast<std::size_t>(p.padded); ++k) {
      EXPECT_EQ(p.x[k], 0.0);
      EXPECT_EQ(p.rank[k], -1);
      if (!equal) {
        EXPECT_EQ(p.radius[k], 1.0);
      }
    }
    const AlignedArray<double> rows = std::move(p.rows);
    p.rows.assign(rows.size(), -1.0);
    p.write_rows();
    EXPECT_TRUE(std::equal(rows.begin(), rows.end(), p.rows.begin()));
  }
}

TEST(MortonOrder, OfNothing) { EXPECT_TRUE(morton_order(Particles()).empty()); }

// One layer of a bar is 200 spheres here: partners in it and in the next one lie within two layers. What is further away
// lies across the sides of bars, each 14 spheres wide.
TEST(MortonOrder, NeighboursAreWithinTwoLayers) {
  for (const auto& n : std::vector<std::array<int, 3>>{{40, 14, 14}, {14, 40, 14}}) {
    EXPECT_EQ(far_apart(morton_order(grid(n[0], n[1], n[2]), 200), n[0], n[1], n[2], 2 * 200), 0.0);
  }
  // A flat bed has layers of far fewer spheres, and no bars.
  EXPECT_EQ(far_apart(morton_order(grid(60, 60, 2), 500), 60, 60, 2, 2 * 120), 0.0);
  EXPECT_LT(far_apart(morton_order(grid(42, 42, 42), 200), 42, 42, 42, 2 * 200), 2.0 / 3.0 * 2.0 / 42 + 0.01);
}

}  // namespace
}  // namespace platen
