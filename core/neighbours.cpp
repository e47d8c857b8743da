#include "core/neighbours.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace platen {

namespace {

struct Bounds {
  double low[3], high[3];
};

Bounds bounds_of(const Particles& p) {
  Bounds b;
  const AlignedArray<double>* columns[3] = {&p.x, &p.y, &p.z};
  for (int axis = 0; axis < 3; ++axis) {
    b.low[axis] = std::numeric_limits<double>::infinity();
    b.high[axis] = -b.low[axis];
    for (std::int32_t k = 0; k < p.count; ++k) {
      const double x = (*columns[axis])[static_cast<std::size_t>(k)];
      b.low[axis] = std::min(b.low[axis], x);
      b.high[axis] = std::max(b.high[axis], x);
    }
  }
  return b;
}

// A grid of cells at least `reach` wide over the particles; periodic where the domain is.
class CellGrid {
 public:
  CellGrid(const Particles& p, const Domain& domain, const Margins& margins, double reach) {
    const Bounds b = bounds_of(p);
    const double periodic[3] = {domain.width, domain.depth, 0.0};
    double extent[3];
    for (int axis = 0; axis < 3; ++axis) {
      wraps_[axis] = periodic[axis] > 0.0;
      low_[axis] = wraps_[axis] ? 0.0 : b.low[axis];
      extent[axis] = wraps_[axis] ? periodic[axis] : std::max(b.high[axis] - b.low[axis], reach);
    }
    // Sparse scenes: wider cells, so that there are never many more cells than particles.
    double size = reach;
    const auto cells_for = [&](double width) {
      double product = 1.0;
      for (double e : extent) product *= std::max(1.0, std::floor(e / width));
      return product;
    };
    while (cells_for(size) > 8.0 * p.count + 64.0) size *= 1.26;
    for (int axis = 0; axis < 3; ++axis) {
      cells_[axis] = std::max(1, static_cast<int>(std::floor(extent[axis] / size)));
      inverse_[axis] = cells_[axis] / extent[axis];
    }
    start_.assign(static_cast<std::size_t>(cells_[0]) * cells_[1] * cells_[2] + 1, 0);
    cell_of_.resize(static_cast<std::size_t>(p.count));
    for (std::int32_t k = 0; k < p.count; ++k) {
      const auto at = static_cast<std::size_t>(k);
      cell_of_[at] = index(coordinate(p.x[at], 0), coordinate(p.y[at], 1), coordinate(p.z[at], 2));
      ++start_[static_cast<std::size_t>(cell_of_[at]) + 1];
    }
    for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
    for (auto* column : {&x_, &y_, &z_, &reach_, &number_}) column->resize(static_cast<std::size_t>(p.count + padding));
    particle_.resize(static_cast<std::size_t>(p.count + padding));
    // Whole vectors are read beyond the last.
    for (auto* column : {&x_, &y_, &z_, &reach_, &number_}) std::fill_n(column->end() - padding, padding, 0.0);
    std::fill_n(particle_.end() - padding, padding, 0);
    PooledVector<std::int32_t> next(start_.begin(), start_.end() - 1);
    for (std::int32_t k = 0; k < p.count; ++k) {
      const double* row = p.rows.data() + row_size * static_cast<std::size_t>(k);
      const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(cell_of_[static_cast<std::size_t>(k)])]++);
      x_[at] = row[0], y_[at] = row[1], z_[at] = row[2], reach_[at] = row[3] + margins.of[static_cast<std::size_t>(k)];
      number_[at] = k, particle_[at] = k;
    }
    lengths_[0] = domain.width, lengths_[1] = domain.depth, lengths_[2] = 0.0;
    members_ = {x_.data(), y_.data(), z_.data(), reach_.data(), number_.data(), particle_.data(), 0.0, 0.0, 0.0, 0.0};
    // A periodic axis with one or two cells: images are looked for pair by pair.
    if (wraps_[0] && cells_[0] < 3) members_.width = lengths_[0], members_.inverse_width = 1.0 / lengths_[0];
    if (wraps_[1] && cells_[1] < 3) members_.depth = lengths_[1], members_.inverse_depth = 1.0 / lengths_[1];
  }
  CellGrid(const CellGrid&) = delete;  // members_ points into it

  const SearchMembers& members() const { return members_; }

  static constexpr int most_ranges = 3 * 3 * 2;

  // The members of the cells around particle i, each cell once; returns the number of ranges. Cells along x lie next to each
  // other in memory.
  int around(const Particles& p, std::int32_t i, SearchRange (&found)[most_ranges]) const {
    const double* row = p.rows.data() + row_size * static_cast<std::size_t>(i);
    struct Range {
      int first, last;
      double shift;
    };
    Range ranges[3][3];
    int length[3];
    for (int axis = 0; axis < 3; ++axis) {
      const int c = coordinate(row[axis], axis), n = cells_[axis];
      length[axis] = 0;
      const auto add = [&](int first, int last, double shift) { ranges[axis][length[axis]++] = {first, last, shift}; };
      if (!wraps_[axis]) {
        add(std::max(c - 1, 0), std::min(c + 1, n - 1), 0.0);
      } else if (n < 3) {
        add(0, n - 1, 0.0);  // all of them; images are looked for pair by pair
      } else {
        if (c == 0) add(n - 1, n - 1, lengths_[axis]);
        add(std::max(c - 1, 0), std::min(c + 1, n - 1), 0.0);
        if (c == n - 1) add(0, 0, -lengths_[axis]);
      }
    }
    int count = 0;
    for (int a = 0; a < length[2]; ++a)
      for (int z = ranges[2][a].first; z <= ranges[2][a].last; ++z)
        for (int b = 0; b < length[1]; ++b)
          for (int y = ranges[1][b].first; y <= ranges[1][b].last; ++y)
            for (int d = 0; d < length[0]; ++d) {
              const Range& x = ranges[0][d];
              found[count++] = {start_[static_cast<std::size_t>(index(x.first, y, z))], start_[static_cast<std::size_t>(index(x.last, y, z)) + 1],
                                row[0] + x.shift, row[1] + ranges[1][b].shift, row[2]};
            }
    return count;
  }

 private:
  int coordinate(double x, int axis) const {
    const int c = static_cast<int>(std::floor((x - low_[axis]) * inverse_[axis]));
    return std::clamp(c, 0, cells_[axis] - 1);
  }
  std::int32_t index(int a, int b, int c) const { return (c * cells_[1] + b) * cells_[0] + a; }

  bool wraps_[3];
  double low_[3], inverse_[3], lengths_[3];
  int cells_[3];
  PooledVector<std::int32_t> start_, cell_of_;
  PooledVector<double> x_, y_, z_, reach_, number_;
  PooledVector<std::int32_t> particle_;
  SearchMembers members_;
};

// Greedy colouring of the batches: no two that share a pair get the same colour.
void colour(std::vector<Batch>& batches) {
  std::vector<int> taken_by(batches.size() + 1, -1);
  for (Batch& batch : batches) batch.colour = -1;
  for (int k = 0; k < static_cast<int>(batches.size()); ++k) {
    Batch& batch = batches[static_cast<std::size_t>(k)];
    for (int other : batch.partners)
      if (const int c = batches[static_cast<std::size_t>(other)].colour; c >= 0) taken_by[static_cast<std::size_t>(c)] = k;
    batch.colour = 0;
    while (taken_by[static_cast<std::size_t>(batch.colour)] == k) ++batch.colour;
  }
}

void find_centre(Batch& batch, const Particles& p) {
  const AlignedArray<double>* columns[3] = {&p.x, &p.y, &p.z};
  const std::int32_t end = std::min(batch.first + batch.count, p.count);
  for (int axis = 0; axis < 3; ++axis) {
    double sum = 0.0;
    for (std::int32_t k = batch.first; k < end; ++k) sum += (*columns[axis])[static_cast<std::size_t>(k)];
    batch.centre[axis] = sum / std::max(end - batch.first, 1);
  }
}

// Whether the shorter way from i to j along the curve, closed to a ring, goes forwards; of two equally long ones that from the lower
// number. True of exactly one of (i, j) and (j, i).
bool lies_ahead(std::int32_t i, std::int32_t j, std::int32_t all) {
  return i < j ? 2 * std::int64_t{j - i} <= all : 2 * std::int64_t{i - j} > all;
}

}  // namespace

int BatchOf::operator()(std::int32_t particle) const {
  return static_cast<int>(std::upper_bound(starts.begin(), starts.end(), particle) - starts.begin()) - 1;
}

std::vector<Batch> make_batches(const Particles& p, const Domain& domain, const Margins& margins, const Cuts& cuts, Ownership ownership,
                                const KernelTable& kernels, const ParallelFor& parallel) {
  const int count = static_cast<int>(cuts.size()) - 1;
  std::vector<Batch> batches(static_cast<std::size_t>(count));
  std::vector<std::int32_t> batch_of(static_cast<std::size_t>(std::max(p.padded / padding, 1)), 0);  // of each vector of particles
  for (int k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    Batch& batch = batches[at];
    batch.first = cuts[at], batch.count = cuts[at + 1] - cuts[at];
    std::fill(batch_of.begin() + cuts[at] / padding, batch_of.begin() + cuts[at + 1] / padding, k);
  }

  double largest = p.common_radius;
  if (!p.equal) largest = *std::max_element(p.radius.begin(), p.radius.begin() + p.count);
  const CellGrid grid(p, domain, margins, 2.0 * (largest + margins.largest));

  // Every pair within a batch once, every pair across batches from both sides; then the owner keeps it.
  parallel(count, [&](int k) {
    Batch& batch = batches[static_cast<std::size_t>(k)];
    find_centre(batch, p);
    std::vector<char> seen(static_cast<std::size_t>(count), 0);
    std::vector<std::int32_t> close;  // partners of one particle; grows to the most candidates that one had
    PooledVector<std::int32_t> partners;
    partners.reserve(static_cast<std::size_t>(batch.count) * 8);
    for (std::int32_t i = batch.first; i < std::min(batch.first + batch.count, p.count); ++i) {
      const double own = p.radius_of(i) + margins.of[static_cast<std::size_t>(i)];
      SearchRange ranges[CellGrid::most_ranges];
      const int count_of_ranges = grid.around(p, i, ranges);
      std::size_t candidates = 0;
      for (int r = 0; r < count_of_ranges; ++r) candidates += static_cast<std::size_t>(ranges[r].last - ranges[r].first);
      if (close.size() < candidates + padding) close.resize(candidates + padding);
      const auto kept = static_cast<std::size_t>(kernels.search(grid.members(), ranges, count_of_ranges, {own, static_cast<double>(i), static_cast<double>(batch.first)}, close.data()));
      for (std::size_t m = 0; count > 1 && m < kept; ++m) seen[static_cast<std::size_t>(batch_of[static_cast<std::size_t>(close[m] / padding)])] = 1;
      partners.insert(partners.end(), close.begin(), close.begin() + static_cast<std::ptrdiff_t>(kept));
      batch.outer_owned.add(static_cast<std::int32_t>(kept));
    }
    batch.outer_j.assign(partners.begin(), partners.end());  // no longer than it need be
    for (int other = 0; other < count; ++other)
      if (other != k && seen[static_cast<std::size_t>(other)]) batch.partners.push_back(other);
  });
  if (ownership == Ownership::by_colour) colour(batches);
  parallel(count, [&](int k) {
    Batch& batch = batches[static_cast<std::size_t>(k)];
    const auto owns = [&](std::int32_t i, std::int32_t j, int other) {
      return ownership == Ownership::ahead ? lies_ahead(i, j, p.padded) : batch.colour < batches[static_cast<std::size_t>(other)].colour;
    };
    std::vector<char> shares(static_cast<std::size_t>(count), 0);
    std::size_t kept = 0;
    OwnedCounts owned;
    batch.outer_owned.for_each([&](std::int32_t own, std::int32_t begin, std::int32_t end) {
      const std::int32_t i = batch.first + own;
      const std::size_t before = kept;
      for (std::int32_t m = begin; m < end; ++m) {
        const std::int32_t j = batch.outer_j[static_cast<std::size_t>(m)];
        if (j < batch.first || j >= batch.first + batch.count) {
          const int other = batch_of[static_cast<std::size_t>(j / padding)];
          if (!owns(i, j, other)) continue;
          shares[static_cast<std::size_t>(other)] = 1;
        }
        batch.outer_j[kept++] = j;
      }
      owned.add(static_cast<std::int32_t>(kept - before));
    });
    batch.outer_owned = std::move(owned), batch.outer_owned.fit();
    batch.outer_j.resize(kept), batch.outer_j.shrink_to_fit();
    std::erase_if(batch.partners, [&](int other) { return !shares[static_cast<std::size_t>(other)]; });
  });
  for (int k = 0; k < count; ++k)
    for (const int other : batches[static_cast<std::size_t>(k)].partners) batches[static_cast<std::size_t>(other)].owners.push_back(k);
  return batches;
}

}  // namespace platen
