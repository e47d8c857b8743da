// Where the particles of a file stand: inside the box, and not inside each other.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include <fmt/format.h>

#include "protocol/particle_file.h"

namespace platen {
namespace {

constexpr std::size_t most_problems = 20;

struct Finding {
  std::size_t line = 0;
  std::string what;
};

class Findings {
 public:
  bool full() const { return found_.size() > most_problems; }
  void add(std::size_t line, std::string what) {
    if (!full()) found_.push_back({line, std::move(what)});
  }
  void write(const std::string& name, const std::string& kind, std::vector<std::string>& out) {
    const bool more = full();
    if (more) found_.resize(most_problems);
    std::stable_sort(found_.begin(), found_.end(), [](const Finding& a, const Finding& b) { return a.line < b.line; });
    for (const Finding& finding : found_) out.push_back(fmt::format("{}:{}: {}", name, finding.line, finding.what));
    if (more)
      out.push_back(fmt::format("{}: more particles {}; only the first {} are named", name, kind, most_problems));
  }

 private:
  std::vector<Finding> found_;
};

// One axis of the cell grid. Along a periodic axis the cells divide the box evenly and wrap.
class Axis {
 public:
  Axis(double cell, double period) : cell_(cell), period_(period) {
    if (period_ > 0.0) {
      const double n = std::clamp(std::floor(period_ / cell_), 1.0, most_cells);
      count_ = static_cast<std::int64_t>(n);
    }
  }
  std::int64_t index(double x) const {
    if (period_ <= 0.0) return static_cast<std::int64_t>(std::clamp(std::floor(x / cell_), -farthest, farthest));
    double wrapped = std::fmod(x, period_);
    if (wrapped < 0.0) wrapped += period_;
    const auto i = static_cast<std::int64_t>(wrapped / period_ * static_cast<double>(count_));
    return std::clamp<std::int64_t>(i, 0, count_ - 1);
  }
  // The neighbours of cell i, itself included, each once; how many there are.
  int neighbours(std::int64_t i, std::array<std::int64_t, 3>& out) const {
    if (count_ == 0) {
      out = {i - 1, i, i + 1};
      return 3;
    }
    const int n = static_cast<int>(std::min<std::int64_t>(count_, 3));
    for (int k = 0; k < n; ++k) out[static_cast<std::size_t>(k)] = (i + k + count_ - (n == 3 ? 1 : 0)) % count_;
    return n;
  }
  double distance(double a, double b) const {
    const double d = a - b;
    return period_ > 0.0 ? d - period_ * std::round(d / period_) : d;
  }

 private:
  // Beyond these, cells are only too wide or too full: slower, never wrong.
  static constexpr double most_cells = 1 << 20;
  static constexpr double farthest = 1e15;
  double cell_, period_;
  std::int64_t count_ = 0;  // 0: not periodic
};

std::uint64_t cell_key(std::int64_t i, std::int64_t j, std::int64_t k) {
  std::uint64_t key = static_cast<std::uint64_t>(i) * 0x9e3779b97f4a7c15u;
  key = (key ^ (key >> 29)) + static_cast<std::uint64_t>(j) * 0xbf58476d1ce4e5b9u;
  key = (key ^ (key >> 32)) + static_cast<std::uint64_t>(k) * 0x94d049bb133111ebu;
  return key ^ (key >> 31);
}

// Pairs that overlap by more than the smaller radius, that is, the centre of one lies inside the larger one: then the
// search needs to reach only one radius. Radii are taken in groups within a factor of 2, each against all that are not
// larger, in a grid that suits the group; so a few large spheres among many small ones cost little.
void find_overlaps(const ParticleFile& file, double period_x, double period_y, Findings& findings) {
  const ParticleTable& t = file.table;
  std::vector<std::size_t> order(t.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&t](std::size_t a, std::size_t b) { return t.radius[a] < t.radius[b]; });

  for (std::size_t begin = 0, end = 0; begin < order.size() && !findings.full(); begin = end) {
    const double cell = 2.0 * t.radius[order[begin]];
    while (end < order.size() && t.radius[order[end]] <= cell) ++end;
    const Axis along_x(cell, period_x), along_y(cell, period_y), along_z(cell, 0.0);
    // Linked lists: the ranks in a cell, newest first. A rank meets exactly the ranks before it.
    std::unordered_map<std::uint64_t, std::size_t> newest;
    newest.reserve(end);
    std::vector<std::size_t> next(end);
    constexpr std::size_t none = static_cast<std::size_t>(-1);
    for (std::size_t rank = 0; rank < end && !findings.full(); ++rank) {
      const std::size_t a = order[rank];
      const std::array<std::int64_t, 3> home{along_x.index(t.x[a]), along_y.index(t.y[a]), along_z.index(t.z[a])};
      if (rank >= begin) {
        std::array<std::int64_t, 3> is{}, js{}, ks{};
        const int ni = along_x.neighbours(home[0], is), nj = along_y.neighbours(home[1], js);
        const int nk = along_z.neighbours(home[2], ks);
        for (int n = 0; n < ni * nj * nk; ++n) {
          const auto found =
              newest.find(cell_key(is[static_cast<std::size_t>(n % ni)], js[static_cast<std::size_t>(n / ni % nj)],
                                   ks[static_cast<std::size_t>(n / ni / nj)]));
          for (std::size_t other = found == newest.end() ? none : found->second; other != none; other = next[other]) {
            const std::size_t b = order[other];
            const double dx = along_x.distance(t.x[a], t.x[b]), dy = along_y.distance(t.y[a], t.y[b]);
            const double dz = t.z[a] - t.z[b];
            const double d = std::sqrt(dx * dx + dy * dy + dz * dz);
            if (!(d < t.radius[a])) continue;
            findings.add(
                std::max(file.line[a], file.line[b]),
                fmt::format("particle {} overlaps particle {} of line {} by {:.6g} m; allowed: at most the "
                            "smaller radius, {:.6g} m",
                            t.id[file.line[a] > file.line[b] ? a : b], t.id[file.line[a] > file.line[b] ? b : a],
                            std::min(file.line[a], file.line[b]), t.radius[a] + t.radius[b] - d, t.radius[b]));
          }
        }
      }
      const auto [place, fresh] = newest.emplace(cell_key(home[0], home[1], home[2]), rank);
      next[rank] = fresh ? none : place->second;
      place->second = rank;
    }
  }
}

}  // namespace

std::vector<std::string> check_particle_positions(const ParticleFile& file, const std::string& name, const BoxSpec& box,
                                                  bool bottom_plate, bool top_plate) {
  const ParticleTable& t = file.table;
  Findings outside;
  const auto check_side = [&](std::size_t i, const char* axis, double value, double length) {
    if (box.sides == Sides::open || length <= 0.0) return;
    if (box.sides == Sides::periodic && !(value >= 0.0 && value < length)) {
      outside.add(file.line[i],
                  fmt::format("{}: particle {} at {:.6g} m is outside the periodic box; allowed: 0 <= {} < {:.6g} m",
                              axis, t.id[i], value, axis, length));
    } else if (box.sides == Sides::walls && !(value > 0.0 && value < length)) {
      outside.add(file.line[i], fmt::format("{}: particle {} at {:.6g} m is beyond a wall; allowed: 0 < {} < {:.6g} m",
                                            axis, t.id[i], value, axis, length));
    }
  };
  for (std::size_t i = 0; i < t.size() && !outside.full(); ++i) {
    check_side(i, "x", t.x[i], box.width);
    check_side(i, "y", t.y[i], box.depth);
    if (bottom_plate && !(t.z[i] > 0.0)) {
      outside.add(file.line[i], fmt::format("z: particle {} at {:.6g} m is beyond the bottom plate; allowed: z > 0 m",
                                            t.id[i], t.z[i]));
    }
    if (top_plate && box.height > 0.0 && !(t.z[i] < box.height)) {
      outside.add(file.line[i], fmt::format("z: particle {} at {:.6g} m is beyond the top plate; allowed: z < {:.6g} m",
                                            t.id[i], t.z[i], box.height));
    }
  }
  std::vector<std::string> problems;
  outside.write(name, "are outside", problems);

  // One radius in another unit would overlap everything: what is wrong is the radius.
  Findings wide;
  const double widest = 0.5 * std::min(box.width, box.depth);
  if (box.sides != Sides::open && widest > 0.0)
    for (std::size_t i = 0; i < t.size() && !wide.full(); ++i)
      if (t.radius[i] > widest)
        wide.add(file.line[i], fmt::format("radius: particle {} of {:.6g} m does not fit into the box; allowed: at most {:.6g} m", t.id[i], t.radius[i], widest));
  const std::size_t before = problems.size();
  wide.write(name, "do not fit", problems);
  if (problems.size() > before) return problems;

  Findings overlaps;
  const bool periodic = box.sides == Sides::periodic;
  find_overlaps(file, periodic ? box.width : 0.0, periodic ? box.depth : 0.0, overlaps);
  overlaps.write(name, "overlap", problems);
  return problems;
}

}  // namespace platen
