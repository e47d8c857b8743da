#include "protocol/stages/grow.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace platen {

namespace {

constexpr double allowed_overlap = 1e-3;  // of the smaller radius
constexpr double spare = 5e-4;            // by which radii are grown too far

// Overlapping spheres in a box, and the forces by which they push each other away. The stiffness is 1, so forces
// are lengths and the energy of an overlap is half its square.
class SoftSpheres {
 public:
  SoftSpheres(const std::vector<double>& radii, double width, double depth, double height, bool periodic)
      : radii_(radii),
        length_{width, depth, height},
        periodic_(periodic),
        largest_(*std::max_element(radii.begin(), radii.end())) {}

  // Pairs that may come to overlap at this scale of the radii before some sphere has moved skin/2.
  void find_pairs(const std::vector<double>& x, double scale) {
    const double skin = 0.4 * largest_;
    listed_at_ = x, listed_scale_ = scale, listed_skin_ = skin;
    pairs_.clear();
    const double edge = 2.0 * largest_ * scale + skin;
    int cells[3];
    for (std::size_t k = 0; k < 3; ++k)
      cells[k] = static_cast<int>(std::clamp(std::floor(length_[k] / edge), 1.0, 1024.0));
    const auto index = [&](int a, int b, int c) {
      return (static_cast<std::size_t>(c) * static_cast<std::size_t>(cells[1]) + static_cast<std::size_t>(b)) *
                 static_cast<std::size_t>(cells[0]) +
             static_cast<std::size_t>(a);
    };
    // Places outside the box are periodic in x and y (cells wrap), and go to the outermost cell elsewhere.
    const auto cell = [&](double place, std::size_t axis) {
      const int c = static_cast<int>(std::floor(place / length_[axis] * cells[axis]));
      if (wraps(axis)) return ((c % cells[axis]) + cells[axis]) % cells[axis];
      return std::clamp(c, 0, cells[axis] - 1);
    };
    std::vector<int> head(index(cells[0] - 1, cells[1] - 1, cells[2] - 1) + 1, -1), next(radii_.size(), -1);
    for (std::size_t s = radii_.size(); s-- > 0;) {  // backwards, so that each cell's chain rises
      int& first = head[index(cell(x[3 * s], 0), cell(x[3 * s + 1], 1), cell(x[3 * s + 2], 2))];
      next[s] = first;
      first = static_cast<int>(s);
    }
    // Cells around c along an axis, each once even where the box is only one or two cells wide.
    const auto around = [&](int c, std::size_t axis, int* list) {
      const int count = cells[axis];
      int found = 0;
      for (int d = -1; d <= 1; ++d) {
        int other = c + d;
        if (wraps(axis)) other = (other + count) % count;
        if (other < 0 || other >= count || std::find(list, list + found, other) != list + found) continue;
        list[found++] = other;
      }
      return found;
    };
    for (std::size_t i = 0; i < radii_.size(); ++i) {
      int list[3][3], count[3];
      for (std::size_t k = 0; k < 3; ++k) count[k] = around(cell(x[3 * i + k], k), k, list[k]);
      for (int c = 0; c < count[2]; ++c)
        for (int b = 0; b < count[1]; ++b)
          for (int a = 0; a < count[0]; ++a)
            for (int s = head[index(list[0][a], list[1][b], list[2][c])]; s >= 0;
                 s = next[static_cast<std::size_t>(s)]) {
              const auto j = static_cast<std::size_t>(s);
              if (j <= i) continue;
              const double reach = (radii_[i] + radii_[j]) * scale + skin;
              double d[3];
              if (apart(x, i, j, d) < reach * reach) pairs_.push_back({static_cast<int>(i), s});
            }
    }
  }

  // Lists pairs again where they may have changed.
  void refresh(const std::vector<double>& x, double scale) {
    double farthest2 = 0.0;
    for (std::size_t s = 0; s < listed_at_.size(); s += 3) {
      const double a = x[s] - listed_at_[s], b = x[s + 1] - listed_at_[s + 1], c = x[s + 2] - listed_at_[s + 2];
      farthest2 = std::max(farthest2, a * a + b * b + c * c);
    }
    const double room = 0.5 * listed_skin_ - std::max(0.0, scale - listed_scale_) * largest_;
    if (listed_at_.empty() || room <= 0.0 || farthest2 >= room * room) find_pairs(x, scale);
  }

  // Forces at radii times scale; returns the largest overlap over the smaller radius.
  double push(const std::vector<double>& x, double scale, std::vector<double>& F) const {
    double worst = 0.0;
    std::fill(F.begin(), F.end(), 0.0);
    for (const auto& [first, second] : pairs_) {
      const auto i = static_cast<std::size_t>(first), j = static_cast<std::size_t>(second);
      const double reach = (radii_[i] + radii_[j]) * scale;
      double d[3];
      const double squared = apart(x, i, j, d);
      if (squared >= reach * reach) continue;
      const double distance = std::sqrt(squared), delta = reach - distance;
      worst = std::max(worst, delta / (std::min(radii_[i], radii_[j]) * scale));
      // Centres in one place are pushed apart along z.
      const double share = distance > 0.0 ? delta / distance : 0.0;
      if (!(distance > 0.0)) F[3 * i + 2] += delta, F[3 * j + 2] -= delta;
      for (std::size_t k = 0; k < 3; ++k) F[3 * i + k] += share * d[k], F[3 * j + k] -= share * d[k];
    }
    for (std::size_t s = 0; s < radii_.size(); ++s)
      for (std::size_t k = 0; k < 3; ++k) {
        if (wraps(k)) continue;
        const double R = radii_[s] * scale, low = R - x[3 * s + k], high = x[3 * s + k] - (length_[k] - R);
        if (low > 0.0) F[3 * s + k] += low;
        if (high > 0.0) F[3 * s + k] -= high;
        worst = std::max(worst, std::max(low, high) / R);
      }
    return worst;
  }

  bool wraps(std::size_t axis) const { return periodic_ && axis < 2; }
  double length(std::size_t axis) const { return length_[axis]; }
  double largest() const { return largest_; }

 private:
  struct Pair {
    int first, second;
  };

  // d = x_i - x_j of the nearest image; returns its square. Places may be any number of boxes away.
  double apart(const std::vector<double>& x, std::size_t i, std::size_t j, double* d) const {
    for (std::size_t k = 0; k < 3; ++k) {
      d[k] = x[3 * i + k] - x[3 * j + k];
      if (wraps(k) && std::abs(d[k]) > 0.5 * length_[k]) d[k] -= length_[k] * std::floor(d[k] / length_[k] + 0.5);
    }
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
  }

  const std::vector<double>& radii_;
  double length_[3];
  bool periodic_;
  double largest_;
  std::vector<Pair> pairs_;
  std::vector<double> listed_at_;
  double listed_scale_ = 0.0, listed_skin_ = 0.0;
};

// Lets the spheres slide down the energy of their overlaps: fast inertial relaxation, parameters as published. Unit
// masses, so that time is in units of one over the frequency of a single spring.
class Fire {
 public:
  Fire(SoftSpheres& spheres, std::vector<double>& x) : spheres_(spheres), x_(x), v_(x.size()), F_(x.size()) {}

  // Ends when no overlap exceeds `goal` of the smaller radius, after `most` iterations, or when 400 of them have not
  // lowered the largest overlap seen by 2 %. Returns whether the goal was reached.
  bool relax(double scale, double goal, int most) {
    std::fill(v_.begin(), v_.end(), 0.0);
    double dt = 0.1, alpha = 0.1, best = 1e300;
    int downhill = 0, since_better = 0;
    for (int iteration = 0; iteration < most; ++iteration) {
      spheres_.refresh(x_, scale);
      const double worst = spheres_.push(x_, scale, F_);
      if (worst <= goal) return true;
      if (worst < 0.98 * best)
        best = worst, since_better = 0;
      else if (++since_better > 400)
        return false;

      double power = 0.0, v2 = 0.0, F2 = 0.0;
      for (std::size_t k = 0; k < x_.size(); ++k) power += F_[k] * v_[k], v2 += v_[k] * v_[k], F2 += F_[k] * F_[k];
      if (power < 0.0) {
        std::fill(v_.begin(), v_.end(), 0.0);
        dt *= 0.5, alpha = 0.1, downhill = 0;
      } else {
        const double turn = F2 > 0.0 ? alpha * std::sqrt(v2 / F2) : 0.0;
        for (std::size_t k = 0; k < x_.size(); ++k) v_[k] = (1.0 - alpha) * v_[k] + turn * F_[k];
        if (++downhill > 5) dt = std::min(1.1 * dt, 0.5), alpha *= 0.99;
      }
      const double farthest = 0.1 * spheres_.largest();  // a step; keeps the violent start in hand
      for (std::size_t k = 0; k < x_.size(); ++k) {
        v_[k] += dt * F_[k];
        x_[k] += std::clamp(dt * v_[k], -farthest, farthest);
      }
    }
    return false;
  }

  // Largest overlap of the radii as they are, pairs found anew.
  double measure() {
    spheres_.find_pairs(x_, 1.0);
    return spheres_.push(x_, 1.0, F_);
  }

 private:
  SoftSpheres& spheres_;
  std::vector<double>& x_;
  std::vector<double> v_, F_;
};

}  // namespace

GrownBed grow_bed(const std::vector<double>& radii, double width, double depth, bool periodic, double porosity,
                  RandomSource& random) {
  GrownBed bed;
  if (!(porosity > 0.0 && porosity < 1.0)) throw std::invalid_argument("grow: the porosity must be between 0 and 1");
  if (radii.empty()) {
    bed.reached = true;
    return bed;
  }
  double cubes = 0.0, largest = 0.0;
  for (const double R : radii) {
    if (!(R > 0.0 && std::isfinite(R))) throw std::invalid_argument("grow: radii must be positive");
    cubes += R * R * R;
    largest = std::max(largest, R);
  }
  bed.height = 4.0 / 3.0 * std::numbers::pi * cubes / (width * depth * (1.0 - porosity));
  // Where a periodic box is less than two diameters wide, a sphere meets another one from both sides at once.
  const double diameter = 2.0 * largest * (1.0 + spare), sideways = periodic ? 2.0 * diameter : diameter;
  if (!(std::min(width, depth) >= sideways && bed.height >= diameter))
    throw std::invalid_argument(
        "grow: the box, or the bed, is too narrow for the largest sphere (two diameters in a periodic box, else one)");

  bed.position.resize(3 * radii.size());
  const double box[3] = {width, depth, bed.height};
  for (std::size_t k = 0; k < bed.position.size(); ++k) bed.position[k] = box[k % 3] * random.uniform();

  SoftSpheres spheres(radii, width, depth, bed.height, periodic);
  Fire fire(spheres, bed.position);
  // From a third of the volume, at which random points part quickly. The last step alone has to be finished; on the
  // way it is enough that nothing overlaps badly.
  constexpr int steps = 20;
  const double full = 1.0 + spare;
  for (int step = 0; step < steps; ++step) fire.relax(full * (0.7 + 0.3 * step / steps), 0.02, 100);
  fire.relax(full, 0.5 * spare, 6000);

  for (std::size_t k = 0; k < bed.position.size(); ++k) {
    if (!spheres.wraps(k % 3)) continue;
    double& place = bed.position[k];
    place -= box[k % 3] * std::floor(place / box[k % 3]);
    if (place < 0.0 || place >= box[k % 3]) place = 0.0;  // rounding at the face itself
  }
  bed.largest_overlap = fire.measure();
  bed.reached = bed.largest_overlap <= allowed_overlap;
  return bed;
}

}  // namespace platen
