#include "core/contacts.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tuple>

namespace platen {

namespace {

bool has_history(const Batch& b, std::size_t k) {
  return b.sp[k] != 0.0 || b.tx[k] != 0.0 || b.ty[k] != 0.0 || b.tz[k] != 0.0 || (!b.k_t_last.empty() && b.k_t_last[k] != 0.0);
}

// New inner list of one batch in the making.
struct Inner {
  std::vector<std::int32_t> from;
  std::vector<PairHistory> history;  // signed from owner to partner here
};

void install(Batch& batch, const Inner& inner, bool with_k_t) {
  batch.used = static_cast<std::int32_t>(inner.from.size());
  batch.padded = (batch.used + pair_padding - 1) / pair_padding * pair_padding;
  const auto size = static_cast<std::size_t>(batch.padded);
  for (auto* column : {&batch.i, &batch.j, &batch.slot_j, &batch.from}) column->assign(size, 0);
  for (auto* column : {&batch.sp, &batch.tx, &batch.ty, &batch.tz}) column->assign(size, 0.0);
  batch.k_t_last.assign(with_k_t ? size : 0, 0.0);

  // Halo slots in the order of first use.
  batch.halo.clear();
  std::vector<std::pair<std::int32_t, std::int32_t>> foreign;  // particle, contact
  for (std::size_t k = 0; k < inner.from.size(); ++k) {
    const auto m = static_cast<std::size_t>(inner.from[k]);
    batch.from[k] = inner.from[k];
    batch.i[k] = batch.outer_i[m];
    batch.j[k] = batch.outer_j[m];
    const PairHistory& h = inner.history[k];
    batch.sp[k] = h.sp, batch.tx[k] = h.tx, batch.ty[k] = h.ty, batch.tz[k] = h.tz;
    if (with_k_t) batch.k_t_last[k] = h.k_t;
    const std::int32_t local = batch.j[k] - batch.first;
    if (local >= 0 && local < batch.count)
      batch.slot_j[k] = local;
    else
      foreign.emplace_back(batch.j[k], static_cast<std::int32_t>(k));
  }
  std::sort(foreign.begin(), foreign.end());
  for (const auto& [particle, k] : foreign) {
    if (batch.halo.empty() || batch.halo.back() != particle) batch.halo.push_back(particle);
    batch.slot_j[static_cast<std::size_t>(k)] = batch.count + static_cast<std::int32_t>(batch.halo.size()) - 1;
  }
  for (std::int32_t k = batch.used; k < batch.padded; ++k) {  // harmless repetitions: i with itself
    const auto at = static_cast<std::size_t>(k);
    batch.i[at] = batch.j[at] = batch.used > 0 ? batch.i[static_cast<std::size_t>(batch.used) - 1] : batch.first;
    batch.slot_j[at] = batch.i[at] - batch.first;
    batch.from[at] = -1;
  }
  batch.sum_i.assign(static_cast<std::size_t>(batch.count) * record_size, 0.0);
  batch.sum_j.assign((static_cast<std::size_t>(batch.count) + batch.halo.size()) * record_size, 0.0);
}

void connect_halos(std::vector<Batch>& batches, const ParallelFor& parallel) {
  parallel(static_cast<int>(batches.size()), [&](int k) {
    Batch& batch = batches[static_cast<std::size_t>(k)];
    batch.incoming.clear();
    for (int owner : batch.owners) {
      const Batch& other = batches[static_cast<std::size_t>(owner)];
      const auto begin = std::lower_bound(other.halo.begin(), other.halo.end(), batch.first);
      const auto end = std::lower_bound(begin, other.halo.end(), batch.first + batch.count);
      for (auto it = begin; it != end; ++it)
        batch.incoming.push_back({owner, other.count + static_cast<std::int32_t>(it - other.halo.begin()), *it - batch.first});
    }
    std::stable_sort(batch.incoming.begin(), batch.incoming.end(),
                     [](const Incoming& a, const Incoming& b) { return a.local < b.local; });
  });
}

bool closer_than(const Particles& p, const Domain& domain, std::int32_t i, std::int32_t j, double gap) {
  const auto a = static_cast<std::size_t>(i), c = static_cast<std::size_t>(j);
  const double dx = domain.nearest_x(p.x[a] - p.x[c]), dy = domain.nearest_y(p.y[a] - p.y[c]);
  const double dz = p.z[a] - p.z[c], reach = p.radius_of(i) + p.radius_of(j) + gap;
  return dx * dx + dy * dy + dz * dz < reach * reach;
}

[[noreturn]] void lost(const Particles& p, std::int32_t i, std::int32_t j) {
  throw std::logic_error("a touching pair is missing from the rebuilt lists: ids " +
                         std::to_string(p.id_of_rank[static_cast<std::size_t>(p.rank[static_cast<std::size_t>(i)])]) + " and " +
                         std::to_string(p.id_of_rank[static_cast<std::size_t>(p.rank[static_cast<std::size_t>(j)])]));
}

}  // namespace

std::vector<PairHistory> pair_history(const std::vector<Batch>& batches, const Particles& p) {
  std::vector<PairHistory> all;
  for (const Batch& b : batches)
    for (std::size_t k = 0; k < static_cast<std::size_t>(b.used); ++k) {
      if (!has_history(b, k)) continue;
      const std::int32_t ri = p.rank[static_cast<std::size_t>(b.i[k])], rj = p.rank[static_cast<std::size_t>(b.j[k])];
      const double sign = ri < rj ? 1.0 : -1.0;
      all.push_back({std::min(ri, rj), std::max(ri, rj), b.sp[k], sign * b.tx[k], sign * b.ty[k], sign * b.tz[k],
                     b.k_t_last.empty() ? 0.0 : b.k_t_last[k]});
    }
  std::sort(all.begin(), all.end(),
            [](const PairHistory& a, const PairHistory& b) { return std::tie(a.low, a.high) < std::tie(b.low, b.high); });
  return all;
}

std::vector<PlateHistory> plate_history(const std::vector<Batch>& batches, const Particles& p) {
  std::vector<PlateHistory> all;
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

void prune(std::vector<Batch>& batches, const Particles& p, const Domain& domain, double gap, bool with_k_t,
           const ParallelFor& parallel) {
  parallel(static_cast<int>(batches.size()), [&](int k) {
    Batch& b = batches[static_cast<std::size_t>(k)];
    Inner inner;
    std::size_t old = 0;
    for (std::size_t m = 0; m < b.outer_j.size(); ++m) {
      const bool was = old < static_cast<std::size_t>(b.used) && b.from[old] == static_cast<std::int32_t>(m);
      if (closer_than(p, domain, b.outer_i[m], b.outer_j[m], gap)) {
        inner.from.push_back(static_cast<std::int32_t>(m));
        PairHistory h{};
        if (was) h = {0, 0, b.sp[old], b.tx[old], b.ty[old], b.tz[old], with_k_t ? b.k_t_last[old] : 0.0};
        inner.history.push_back(h);
      } else if (was && has_history(b, old)) {
        lost(p, b.outer_i[m], b.outer_j[m]);
      }
      if (was) ++old;
    }
    install(b, inner, with_k_t);
  });
  connect_halos(batches, parallel);
}

void fill_inner(std::vector<Batch>& batches, const Particles& p, const Domain& domain, double gap, bool with_k_t,
                const std::vector<PairHistory>& history, const ParallelFor& parallel) {
  // First entry of each rank.
  std::vector<std::int32_t> start(static_cast<std::size_t>(p.count) + 1, 0);
  for (const PairHistory& h : history) ++start[static_cast<std::size_t>(h.low) + 1];
  for (std::size_t k = 1; k < start.size(); ++k) start[k] += start[k - 1];
  std::vector<std::int64_t> found(batches.size(), 0);
  parallel(static_cast<int>(batches.size()), [&](int k) {
    Batch& b = batches[static_cast<std::size_t>(k)];
    Inner inner;
    for (std::size_t m = 0; m < b.outer_j.size(); ++m) {
      const std::int32_t i = b.outer_i[m], j = b.outer_j[m];
      if (!closer_than(p, domain, i, j, gap)) continue;
      const std::int32_t ri = p.rank[static_cast<std::size_t>(i)], rj = p.rank[static_cast<std::size_t>(j)];
      const std::int32_t low = std::min(ri, rj), high = std::max(ri, rj);
      PairHistory mine{};
      for (std::int32_t h = start[static_cast<std::size_t>(low)]; h < start[static_cast<std::size_t>(low) + 1]; ++h) {
        const PairHistory& entry = history[static_cast<std::size_t>(h)];
        if (entry.high != high) continue;
        const double sign = ri < rj ? 1.0 : -1.0;
        mine = {0, 0, entry.sp, sign * entry.tx, sign * entry.ty, sign * entry.tz, entry.k_t};
        ++found[static_cast<std::size_t>(k)];
        break;
      }
      inner.from.push_back(static_cast<std::int32_t>(m));
      inner.history.push_back(mine);
    }
    install(b, inner, with_k_t);
  });
  std::int64_t carried = 0;
  for (std::int64_t n : found) carried += n;
  if (carried != static_cast<std::int64_t>(history.size())) {
    throw std::logic_error("rebuild carried " + std::to_string(carried) + " of " + std::to_string(history.size()) +
                           " touching pairs");
  }
  connect_halos(batches, parallel);
}

void list_plates(std::vector<Batch>& batches, const Particles& p, const Planes& planes, std::int64_t step, double gap,
                 const std::vector<PlateHistory>& history, const ParallelFor& parallel) {
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
          if (shape.sign * (column[static_cast<std::size_t>(i)] - position) < p.radius_of(i) + gap) near.push_back(i);
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
