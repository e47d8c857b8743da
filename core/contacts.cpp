#include "core/contacts.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tuple>

#include "kernels/owner_runs.h"

namespace platen {

namespace {

bool has_history(const Batch& b, std::size_t k) {
  return b.sp[k] != 0.0 || b.tx[k] != 0.0 || b.ty[k] != 0.0 || b.tz[k] != 0.0 || (!b.k_t_last.empty() && b.k_t_last[k] != 0.0);
}

template <class Visit>
void for_each_bit(std::uint64_t bits, const Visit& visit) {
  for (; bits != 0; bits &= bits - 1) visit(std::countr_zero(bits));
}

// Which pairs are closer than their radii and margins.
struct Closer {
  const Particles& particles;
  const Domain& domain;
  const Margins& margins;
  const KernelTable& kernels;
  void choose(const Batch& b, const std::int32_t* owners, std::uint64_t* chosen) const {
    kernels.choose({particles.rows.data(), margins.of.data(), owners, b.outer_j.data(), static_cast<std::int64_t>(b.outer_j.size()),
                    domain.width, domain.inverse_width, domain.depth, domain.inverse_depth, chosen});
  }
};

// New inner list of one batch in the making; the same memory for every batch that a thread works on.
struct Inner {
  AlignedArray<std::int32_t> outer_i;                      // owners of the outer pairs
  AlignedArray<std::int32_t> i;                            // and of those of the inner list, padded
  std::vector<std::int32_t> from;                          // places in the outer list, ascending
  AlignedArray<std::uint64_t> listed;                      // Batch::listed
  AlignedArray<double> sp, tx, ty, tz, k_t;                // signed from owner to partner
  std::vector<std::uint64_t> foreign;                      // pairs with particles of other batches: that particle, then the place in the list
  std::vector<std::int32_t> halo;                          // these particles
  std::vector<std::int32_t> distances;                     // along the curve, of a sample of contacts

  // Starts a list of those outer pairs that are closer than their margins.
  void choose(const Batch& batch, const Closer& closer) {
    const std::size_t outer = batch.outer_j.size();
    outer_i.resize_to_overwrite(outer + OwnedCounts::beyond);
    batch.outer_owned.name_owners(batch.first, outer_i.data());
    listed.renew((outer + 63) / 64, 0);
    closer.choose(batch, outer_i.data(), listed.data());
    from.resize(outer);
    std::size_t kept = 0;
    for (std::size_t word = 0; word < listed.size(); ++word)
      for_each_bit(listed[word], [&](int bit) { from[kept++] = static_cast<std::int32_t>(64 * word) + bit; });
    from.resize(kept);
  }
  std::size_t padded() const { return (from.size() + pair_padding - 1) / pair_padding * pair_padding; }
  void clear_history(bool with_k_t) {
    // All of the last batch's are given back before any is taken: together they leave a gap that others fit in.
    for (auto* column : {&sp, &tx, &ty, &tz, &k_t}) *column = AlignedArray<double>();
    for (auto* column : {&sp, &tx, &ty, &tz}) column->assign(padded(), 0.0);
    k_t.assign(with_k_t ? padded() : 0, 0.0);
  }
};

Inner& inner_of_this_thread() {
  static thread_local Inner inner;
  return inner;
}

// How far ahead of their owners partners are on the curve, of every sixteenth contact: three quarters of them are nearer than
// this, and so are most of the others, since it is a layer; and some more, for memory to answer in time [kernels/ask_ahead.h].
std::int32_t usual_distance(const Batch& batch, std::vector<std::int32_t>& distances) {
  constexpr std::int32_t in_time = 256, farthest = 4096;
  distances.clear();
  for (std::size_t k = 0; k < static_cast<std::size_t>(batch.used); k += 16) distances.push_back(batch.j(k) - batch.i(k));
  if (distances.empty()) return 0;
  const auto most = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() * 3 / 4);
  std::nth_element(distances.begin(), most, distances.end());
  return std::clamp(*most, 0, farthest) + in_time;
}

// Sums of the batch's own particles stay what they are; halo slots are empty afterwards.
void install(Batch& batch, Inner& inner) {
  batch.used = static_cast<std::int32_t>(inner.from.size());
  batch.padded = static_cast<std::int32_t>(inner.padded());
  const auto size = inner.padded();
  inner.i.resize_to_overwrite(size);
  batch.row_j.renew(size, 0);
  batch.to.renew(size, {});
  batch.sp.swap(inner.sp), batch.tx.swap(inner.tx), batch.ty.swap(inner.ty), batch.tz.swap(inner.tz);
  batch.k_t_last.swap(inner.k_t);
  batch.listed.swap(inner.listed);

  inner.foreign.clear();
  for (std::size_t k = 0; k < inner.from.size(); ++k) {
    const auto m = static_cast<std::size_t>(inner.from[k]);
    const std::int32_t j = batch.outer_j[m], local = j - batch.first;
    inner.i[k] = inner.outer_i[m];
    batch.row_j[k] = row_size * j;
    batch.to[k].partner = record_bytes * local;
    if (local < 0 || local >= batch.count) inner.foreign.push_back(static_cast<std::uint64_t>(j) << 32 | k);
  }
  std::sort(inner.foreign.begin(), inner.foreign.end());
  inner.halo.clear();
  for (const std::uint64_t pair : inner.foreign) {
    const auto j = static_cast<std::int32_t>(pair >> 32);
    if (inner.halo.empty() || inner.halo.back() != j) inner.halo.push_back(j);
    batch.to[pair & 0xffffffffu].partner = record_bytes * (batch.count + static_cast<std::int32_t>(inner.halo.size()) - 1);
  }
  batch.halo.assign(inner.halo.begin(), inner.halo.end());  // grows to what it needs, not to twice as much
  for (std::size_t k = inner.from.size(); k < size; ++k) {  // harmless repetitions: i with itself
    inner.i[k] = batch.used > 0 ? inner.i[static_cast<std::size_t>(batch.used) - 1] : batch.first;
    batch.row_j[k] = row_size * inner.i[k];
    batch.to[k].partner = record_bytes * (inner.i[k] - batch.first);
  }
  const std::size_t own = static_cast<std::size_t>(batch.count) * record_size;
  const std::size_t nothing = own + batch.halo.size() * record_size;
  find_owner_runs(inner.i.data(), batch.padded, batch.first, batch.to.data());
  batch.owners_of_eight.renew(size / 8, {});
  find_owners(inner.i.data(), batch.padded, batch.first, batch.first + batch.count, batch.owners_of_eight.data());
  batch.sum.reserve(nothing + record_size);
  batch.sum.resize(own);
  batch.sum.resize(nothing + record_size);
  batch.ahead = usual_distance(batch, inner.distances);
}

void connect_halos(std::vector<Batch>& batches, const ParallelFor& parallel) {
  parallel(static_cast<int>(batches.size()), [&](int k) {
    Batch& batch = batches[static_cast<std::size_t>(k)];
    batch.incoming.clear();
    for (int owner : batch.owners) {
      const Batch& other = batches[static_cast<std::size_t>(owner)];
      const auto begin = std::lower_bound(other.halo.begin(), other.halo.end(), batch.first);
      const auto end = std::lower_bound(begin, other.halo.end(), batch.first + batch.count);
      if (begin != end)
        batch.incoming.push_back({owner, static_cast<std::int32_t>(begin - other.halo.begin()), static_cast<std::int32_t>(end - begin)});
    }
  });
}

[[noreturn]] void lost(const Particles& p, std::int32_t i, std::int32_t j) {
  throw std::logic_error("a touching pair is missing from the rebuilt lists: ids " +
                         std::to_string(p.id_of_rank[static_cast<std::size_t>(p.rank[static_cast<std::size_t>(i)])]) + " and " +
                         std::to_string(p.id_of_rank[static_cast<std::size_t>(p.rank[static_cast<std::size_t>(j)])]));
}

}  // namespace

PairHistories pair_history(const std::vector<Batch>& batches, const Particles& p, const ParallelFor& parallel) {
  PairHistories all;
  all.by_place = true;
  all.start.assign(static_cast<std::size_t>(p.count) + 1, 0);
  const auto in_batches = [&](const auto& visit) {
    parallel(static_cast<int>(batches.size()), [&](int number) {
      const Batch& b = batches[static_cast<std::size_t>(number)];
      visit(b);
    });
  };
  in_batches([&](const Batch& b) {
    for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k)
      if (has_history(b, k)) ++all.start[static_cast<std::size_t>(b.i(k)) + 1];
  });
  for (std::size_t k = 1; k < all.start.size(); ++k) all.start[k] += all.start[k - 1];
  all.pairs.resize_to_overwrite(static_cast<std::size_t>(all.start.back()));
  in_batches([&](const Batch& b) {
    if (b.first >= p.count) return;
    auto to = static_cast<std::size_t>(all.start[static_cast<std::size_t>(b.first)]);  // lists are sorted by owner
    for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k) {
      if (!has_history(b, k)) continue;
      const std::int32_t ri = p.rank[static_cast<std::size_t>(b.i(k))], rj = p.rank[static_cast<std::size_t>(b.j(k))];
      const double sign = ri < rj ? 1.0 : -1.0;
      all.pairs[to++] = {std::min(ri, rj), std::max(ri, rj), b.sp[k], sign * b.tx[k], sign * b.ty[k], sign * b.tz[k],
                         b.k_t_last.empty() ? 0.0 : b.k_t_last[k]};
    }
  });
  return all;
}

std::vector<PlateHistory> plate_history(const std::vector<Batch>& batches, const Particles& p) {
  std::vector<PlateHistory> all;
  std::size_t listed = 0;
  for (const Batch& b : batches)
    for (const PlateList& list : b.plates) listed += static_cast<std::size_t>(list.used);
  all.reserve(listed);
  for (const Batch& b : batches)
    for (int plate = 0; plate < plate_count; ++plate) {
      const PlateList& list = b.plates[plate];
      for (std::size_t k = 0; k < static_cast<std::size_t>(list.used); ++k)
        if (list.stiffness_last[k] != 0.0) {
          PlateHistory h{p.rank[static_cast<std::size_t>(list.particle[k])], plate, list.xi_x[k], list.xi_y[k],
                         list.xi_z[k], list.stiffness_last[k], list.overlap[k], {}};
          std::copy_n(list.records.data() + record_size * k, record_size, h.record);
          all.push_back(h);
        }
    }
  std::sort(all.begin(), all.end(),
            [](const PlateHistory& a, const PlateHistory& b) { return std::tie(a.plate, a.rank) < std::tie(b.plate, b.rank); });
  return all;
}

void prune(std::vector<Batch>& batches, const Particles& p, const Domain& domain, const Margins& margins, bool with_k_t,
           const KernelTable& kernels, const ParallelFor& parallel) {
  const Closer close{p, domain, margins, kernels};
  parallel(static_cast<int>(batches.size()), [&](int k) {
    Batch& b = batches[static_cast<std::size_t>(k)];
    Inner& inner = inner_of_this_thread();
    inner.choose(b, close);
    inner.clear_history(with_k_t);
    // Both lists have the order of the outer one.
    std::size_t old_first = 0, first = 0;
    for (std::size_t word = 0; word < b.listed.size(); ++word) {
      const std::uint64_t old_bits = b.listed[word], bits = inner.listed[word];
      const auto place = [](std::uint64_t of, int bit) { return static_cast<std::size_t>(std::popcount(of & ((std::uint64_t{1} << bit) - 1))); };
      for_each_bit(old_bits & bits, [&](int bit) {
        const std::size_t old = old_first + place(old_bits, bit), to = first + place(bits, bit);
        inner.sp[to] = b.sp[old], inner.tx[to] = b.tx[old], inner.ty[to] = b.ty[old], inner.tz[to] = b.tz[old];
        if (with_k_t) inner.k_t[to] = b.k_t_last[old];
      });
      for_each_bit(old_bits & ~bits, [&](int bit) {
        if (const std::size_t old = old_first + place(old_bits, bit); has_history(b, old)) lost(p, b.i(old), b.j(old));
      });
      old_first += static_cast<std::size_t>(std::popcount(old_bits)), first += static_cast<std::size_t>(std::popcount(bits));
    }
    install(b, inner);
  });
  connect_halos(batches, parallel);
}

void fill_inner(std::vector<Batch>& batches, const Particles& p, const Domain& domain, const Margins& margins,
                bool with_k_t, const PairHistories& history, const std::int32_t* bucket, const KernelTable& kernels, const ParallelFor& parallel) {
  std::vector<std::int64_t> found(batches.size(), 0);
  const Closer close{p, domain, margins, kernels};
  parallel(static_cast<int>(batches.size()), [&](int k) {
    Batch& b = batches[static_cast<std::size_t>(k)];
    Inner& inner = inner_of_this_thread();
    inner.choose(b, close);
    inner.clear_history(with_k_t);
    for (std::size_t to = 0; to < inner.from.size(); ++to) {
      const auto m = static_cast<std::size_t>(inner.from[to]);
      const auto i = static_cast<std::size_t>(inner.outer_i[m]), j = static_cast<std::size_t>(b.outer_j[m]);
      const std::int32_t ri = p.rank[i], rj = p.rank[j], low = std::min(ri, rj), high = std::max(ri, rj);
      const auto found_in = [&](std::int32_t of) {
        for (std::int32_t h = history.start[static_cast<std::size_t>(of)]; h < history.start[static_cast<std::size_t>(of) + 1]; ++h) {
          const PairHistory& entry = history.pairs[static_cast<std::size_t>(h)];
          if (entry.low != low || entry.high != high) continue;
          const double sign = ri < rj ? 1.0 : -1.0;
          inner.sp[to] = entry.sp, inner.tx[to] = sign * entry.tx, inner.ty[to] = sign * entry.ty, inner.tz[to] = sign * entry.tz;
          if (with_k_t) inner.k_t[to] = entry.k_t;
          return true;
        }
        return false;
      };
      // Who owns a pair mostly owned it before.
      found[static_cast<std::size_t>(k)] += found_in(bucket[i]) || found_in(bucket[j]) ? 1 : 0;
    }
    install(b, inner);
  });
  std::int64_t carried = 0;
  for (std::int64_t n : found) carried += n;
  if (carried != static_cast<std::int64_t>(history.pairs.size())) {
    throw std::logic_error("rebuild carried " + std::to_string(carried) + " of " + std::to_string(history.pairs.size()) +
                           " touching pairs");
  }
  connect_halos(batches, parallel);
}

void list_plates(std::vector<Batch>& batches, const Particles& p, const Planes& planes, std::int64_t step, const Margins& margins,
                 double gap, const std::vector<PlateHistory>& history, const ParallelFor& parallel) {
  parallel(static_cast<int>(batches.size()), [&](int k) {
    Batch& b = batches[static_cast<std::size_t>(k)];
    for (int plate = 0; plate < plate_count; ++plate) {
      PlateList& list = b.plates[plate];
      std::vector<std::int32_t> near;
      if (planes[static_cast<std::size_t>(plate)].present) {
        const Plane shape = plane_shape(plate);
        const double position = planes[static_cast<std::size_t>(plate)].position_at(step);
        const AlignedArray<double>& column = shape.axis == 0 ? p.x : shape.axis == 1 ? p.y : p.z;
        for (std::int32_t i = b.first; i < std::min(b.first + b.count, p.count); ++i)
          if (shape.sign * (column[static_cast<std::size_t>(i)] - position) < p.radius_of(i) + margins.of[static_cast<std::size_t>(i)] + gap) near.push_back(i);
      }
      list.used = static_cast<std::int32_t>(near.size());
      list.padded = (list.used + padding - 1) / padding * padding;
      const auto size = static_cast<std::size_t>(list.padded);
      list.particle.assign(size, near.empty() ? 0 : near.back());
      std::copy(near.begin(), near.end(), list.particle.begin());
      for (auto* column : {&list.xi_x, &list.xi_y, &list.xi_z, &list.stiffness_last, &list.overlap}) column->assign(size, 0.0);
      list.records.assign(size * record_size, 0.0);
      for (std::size_t m = 0; m < near.size(); ++m) {
        const PlateHistory key{p.rank[static_cast<std::size_t>(near[m])], plate, 0, 0, 0, 0, 0, {}};
        const auto it = std::lower_bound(history.begin(), history.end(), key, [](const PlateHistory& a, const PlateHistory& c) {
          return std::tie(a.plate, a.rank) < std::tie(c.plate, c.rank);
        });
        if (it == history.end() || it->plate != plate || it->rank != key.rank) continue;
        list.xi_x[m] = it->xi_x, list.xi_y[m] = it->xi_y, list.xi_z[m] = it->xi_z;
        list.stiffness_last[m] = it->stiffness_last;
        list.overlap[m] = it->overlap;
        std::copy_n(it->record, record_size, list.records.data() + record_size * m);
      }
    }
  });
}

}  // namespace platen
