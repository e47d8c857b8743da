// How far a curve is from the reference, and which power brings it nearest.
//
//   on a common axis (200 equal steps over the range that all curves of both sets share):
//   E_s    = RMS over x of y_s(x) - <y_ref>(x)            one seed s against the mean over the reference's seeds
//   error  = mean of E_s over seeds; scatter = their standard deviation (n - 1)
//   sigma  = RMS over x of the standard deviation of y_ref over its seeds: the scatter below which no distance counts
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "protocol/study/observables.h"

namespace platen {

inline constexpr int common_points = 201;

// The range that all curves share; empty where there is none or a curve is empty.
std::optional<std::pair<double, double>> common_range(const std::vector<Curve>& curves);

// `points` x from low to high, ends included.
std::vector<double> grid(std::pair<double, double> range, int points = common_points);

// Mean and standard deviation (n - 1; 0 for one curve) over curves at each x of the range that they share.
struct Band {
  std::vector<double> x, mean, deviation;
};
Band band_of(const std::vector<Curve>& curves, int points = common_points);

struct CollapseError {
  std::vector<double> each;          // E_s, unit of the observable
  double error = 0.0;                // mean over seeds
  std::optional<double> scatter;     // over seeds; needs two
  double of_means = 0.0;             // RMS between the two means over seeds
  double relative = 0.0;             // error over the range (largest - smallest) of the reference
  std::optional<double> in_scatter;  // error over sigma; needs two seeds of the reference
};

// Both sets hold one curve a seed. Empty where they share no range.
std::optional<CollapseError> collapse_error(const std::vector<Curve>& reference, const std::vector<Curve>& curves);

// Mean and standard deviation (n - 1).
struct Spread {
  int count = 0;
  double mean = 0.0;
  std::optional<double> deviation;  // needs two
};
Spread spread_of(const std::vector<double>& values);

// The minimum of a least-squares parabola through E^2 on the (at most) five powers around the smallest E. E^2, because a
// distance grows linearly from its minimum and has a corner there, its square does not. The parabola is one in
// u = ratio^p or ratio^-p, whichever fits better, ratio that of the radii: what scales as a power of R is off by |u/u0 - 1|.
struct Minimum {
  double power = 0.0;
  double uncertainty = 0.0;  // standard error; NaN where there is nothing to judge it by
  double error = 0.0;        // E of the parabola there (0 where it dips below 0)
  bool inside = false;       // between the smallest and the largest power that were tried
  int degrees = 0;           // of freedom of the uncertainty where seeds give it; 0: the fit alone
};

// squares[power]: E^2. The uncertainty is that of the fit. Empty with fewer than three powers or where there is no minimum.
// `powers` increasing.
std::optional<Minimum> least_error(const std::vector<double>& powers, const std::vector<double>& squares, double ratio);

// Half width of the 95 % interval in standard errors (Student's t).
double student_975(int degrees);

// The curves of a scan, all on one axis per observable, so that every power is judged over the same range.
struct ScanObservable {
  std::string name;
  std::vector<double> x;
  double scale = 1.0;                       // range of the reference
  std::vector<Curve> reference;             // one a seed
  std::vector<std::vector<Curve>> of_power; // [power][seed], the same seeds at every power
};
struct ScanData {
  double ratio = 1.0;  // radius over the reference's
  std::vector<double> powers;
  std::vector<ScanObservable> observables;

  // Mean over seeds of the squared relative distance from the reference's mean, for each power; leaving one seed out, of the curves or of
  // the reference (a number that no seed has: none).
  std::vector<double> squares(std::size_t observable, std::size_t without_seed, std::size_t without_reference) const;
  // Of the mean over these observables. Uncertainty with two seeds or more: that of the fit and, by delete-one jackknife, of the seeds
  // of the curves and of the reference.
  std::optional<Minimum> minimum(const std::vector<std::size_t>& which) const;
};

}  // namespace platen
