#include "protocol/study/collapse.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace platen {
namespace {

double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v * v;
  return values.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(values.size()));
}

std::vector<double> difference(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> out(a.size());
  std::transform(a.begin(), a.end(), b.begin(), out.begin(), [](double p, double q) { return p - q; });
  return out;
}

std::vector<double> sampled(const Curve& curve, const std::vector<double>& x) {
  std::vector<double> y;
  // The ends of the grid may lie an ulp outside.
  for (const double at : x) y.push_back(value_at(curve, std::clamp(at, curve.x.front(), curve.x.back())));
  return y;
}

Band band_on(const std::vector<Curve>& curves, const std::vector<double>& x) {
  Band band{x, std::vector<double>(x.size(), 0.0), std::vector<double>(x.size(), 0.0)};
  std::vector<std::vector<double>> y;
  for (const Curve& curve : curves) y.push_back(sampled(curve, x));
  for (std::size_t k = 0; k < x.size(); ++k) {
    std::vector<double> values;
    for (const auto& one : y) values.push_back(one[k]);
    const Spread spread = spread_of(values);
    band.mean[k] = spread.mean;
    band.deviation[k] = spread.deviation.value_or(0.0);
  }
  return band;
}

}  // namespace

Spread spread_of(const std::vector<double>& values) {
  Spread out;
  out.count = static_cast<int>(values.size());
  if (values.empty()) return out;
  for (const double v : values) out.mean += v;
  out.mean /= out.count;
  if (out.count < 2) return out;
  double sum = 0.0;
  for (const double v : values) sum += (v - out.mean) * (v - out.mean);
  out.deviation = std::sqrt(sum / (out.count - 1));
  return out;
}

std::optional<std::pair<double, double>> common_range(const std::vector<Curve>& curves) {
  if (curves.empty()) return std::nullopt;
  double low = -std::numeric_limits<double>::infinity(), high = -low;
  for (const Curve& curve : curves) {
    if (curve.empty()) return std::nullopt;
    low = std::max(low, curve.x.front());
    high = std::min(high, curve.x.back());
  }
  if (!(low < high)) return std::nullopt;
  return std::pair(low, high);
}

std::vector<double> grid(std::pair<double, double> range, int points) {
  std::vector<double> x;
  for (int k = 0; k < points; ++k) {
    const double t = static_cast<double>(k) / (points - 1);
    x.push_back((1.0 - t) * range.first + t * range.second);
  }
  return x;
}

Band band_of(const std::vector<Curve>& curves, int points) {
  const auto range = common_range(curves);
  return range ? band_on(curves, grid(*range, points)) : Band{};
}

std::optional<CollapseError> collapse_error(const std::vector<Curve>& reference, const std::vector<Curve>& curves) {
  if (reference.empty() || curves.empty()) return std::nullopt;
  std::vector<Curve> all = reference;
  all.insert(all.end(), curves.begin(), curves.end());
  const auto range = common_range(all);
  if (!range) return std::nullopt;
  const std::vector<double> x = grid(*range);
  const Band wanted = band_on(reference, x);
  CollapseError out;
  for (const Curve& curve : curves) out.each.push_back(rms(difference(sampled(curve, x), wanted.mean)));
  const Spread spread = spread_of(out.each);
  out.error = spread.mean;
  out.scatter = spread.deviation;
  out.of_means = rms(difference(band_on(curves, x).mean, wanted.mean));
  const auto [smallest, largest] = std::minmax_element(wanted.mean.begin(), wanted.mean.end());
  out.relative = *largest > *smallest ? out.error / (*largest - *smallest) : std::numeric_limits<double>::quiet_NaN();
  const double sigma = rms(wanted.deviation);
  if (reference.size() >= 2 && sigma > 0.0) out.in_scatter = out.error / sigma;
  return out;
}

namespace {

struct Fit {
  Minimum minimum;
  double residual = 0.0;  // sum of squares
};

// The parabola in u = ratio^(sign p) on `count` powers from `first`.
std::optional<Fit> fit_in(double ratio, double sign, const std::vector<double>& powers, const std::vector<double>& squares, std::size_t first,
                          std::size_t count, std::size_t best) {
  const double rate = sign * std::log(ratio);
  Eigen::MatrixXd A(count, 3);
  Eigen::VectorXd b(count);
  for (std::size_t k = 0; k < count; ++k) {
    // Around the smallest error and in units of the power, so that the fit is well conditioned.
    const double u = std::expm1(rate * (powers[first + k] - powers[best])) / rate;
    const auto row = static_cast<Eigen::Index>(k);
    A.row(row) << 1.0, u, u * u;
    b(row) = squares[first + k];
  }
  const Eigen::VectorXd c = A.colPivHouseholderQr().solve(b);
  const double place = -0.5 * c(1) / c(2);
  if (!(c(2) > 0.0) || !(1.0 + rate * place > 0.0)) return std::nullopt;
  Fit fit;
  Minimum& out = fit.minimum;
  out.power = powers[best] + std::log1p(rate * place) / rate;
  out.error = std::sqrt(std::max(0.0, c(0) - 0.25 * c(1) * c(1) / c(2)));
  out.inside = out.power >= powers.front() && out.power <= powers.back();
  out.uncertainty = std::numeric_limits<double>::quiet_NaN();
  fit.residual = (A * c - b).squaredNorm();
  if (count > 3) {
    const Eigen::MatrixXd covariance = fit.residual / static_cast<double>(count - 3) * (A.transpose() * A).inverse();
    Eigen::Vector3d slope;  // of the minimum's place over the coefficients
    slope << 0.0, -0.5 / c(2), 0.5 * c(1) / (c(2) * c(2));
    out.uncertainty = std::sqrt(std::max(0.0, (slope.transpose() * covariance * slope).value())) / (1.0 + rate * place);
  }
  return fit;
}

}  // namespace

std::optional<Minimum> least_error(const std::vector<double>& powers, const std::vector<double>& squares, double ratio) {
  const std::size_t n = powers.size();
  if (n < 3 || squares.size() != n || !(ratio > 0.0) || ratio == 1.0) return std::nullopt;
  const auto best = static_cast<std::size_t>(std::min_element(squares.begin(), squares.end()) - squares.begin());
  const std::size_t count = std::min<std::size_t>(5, n);
  std::size_t first = best < count / 2 ? 0 : best - count / 2;
  first = std::min(first, n - count);
  const auto rising = fit_in(ratio, 1.0, powers, squares, first, count, best), falling = fit_in(ratio, -1.0, powers, squares, first, count, best);
  if (!rising || !falling) return rising ? std::optional(rising->minimum) : falling ? std::optional(falling->minimum) : std::nullopt;
  // Three points fit both: the mean of the two, and half their distance as what the form leaves open.
  if (count == 3) {
    Minimum out = rising->minimum;
    out.power = 0.5 * (out.power + falling->minimum.power);
    out.uncertainty = 0.5 * std::abs(rising->minimum.power - falling->minimum.power);
    return out;
  }
  return rising->residual <= falling->residual ? rising->minimum : falling->minimum;
}

double student_975(int degrees) {
  static constexpr double table[] = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};
  if (degrees < 1) return std::numeric_limits<double>::infinity();
  return degrees <= 10 ? table[degrees - 1] : 2.0 + 2.3 / degrees;
}

std::vector<double> ScanData::squares(std::size_t observable, std::size_t without_seed, std::size_t without_reference) const {
  const ScanObservable& o = observables[observable];
  const auto left = [](const std::vector<Curve>& all, std::size_t without) {
    std::vector<Curve> out;
    for (std::size_t k = 0; k < all.size(); ++k)
      if (k != without) out.push_back(all[k]);
    return out;
  };
  const std::vector<double> wanted = band_on(left(o.reference, without_reference), o.x).mean;
  std::vector<double> out;
  for (const std::vector<Curve>& curves : o.of_power) {
    double sum = 0.0;
    const std::vector<Curve> used = left(curves, without_seed);
    for (const Curve& curve : used) {
      const double e = rms(difference(sampled(curve, o.x), wanted)) / o.scale;
      sum += e * e / static_cast<double>(used.size());
    }
    out.push_back(sum);
  }
  return out;
}

std::optional<Minimum> ScanData::minimum(const std::vector<std::size_t>& which) const {
  const auto found = [&](std::size_t without_seed, std::size_t without_reference) {
    std::vector<double> sum(powers.size(), 0.0);
    for (const std::size_t o : which) {
      const std::vector<double> one = squares(o, without_seed, without_reference);
      for (std::size_t p = 0; p < sum.size(); ++p) sum[p] += one[p] / static_cast<double>(which.size());
    }
    return least_error(powers, sum, ratio);
  };
  constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  auto out = found(none, none);
  if (!out) return out;
  const std::size_t seeds = observables[which.front()].of_power.front().size(), references = observables[which.front()].reference.size();
  if (seeds < 2 || references < 2) return out;
  // Delete-one jackknife over the seeds of the curves and over those of the reference [Efron1982]; the fit's own error comes on top.
  const auto jackknife = [&](std::size_t count, bool of_reference) {
    std::vector<double> places;
    for (std::size_t k = 0; k < count; ++k)
      if (const auto one = of_reference ? found(none, k) : found(k, none)) places.push_back(one->power);
    if (places.size() < count) return std::numeric_limits<double>::quiet_NaN();
    const double deviation = *spread_of(places).deviation, n = static_cast<double>(count);
    return deviation * deviation * (n - 1.0) * (n - 1.0) / n;
  };
  const double fit = std::isfinite(out->uncertainty) ? out->uncertainty : 0.0;
  out->uncertainty = std::sqrt(fit * fit + jackknife(seeds, false) + jackknife(references, true));
  out->degrees = static_cast<int>(std::min(seeds, references)) - 1;
  return out;
}

}  // namespace platen
