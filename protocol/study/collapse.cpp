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

std::optional<Minimum> least_error(const std::vector<double>& powers, const std::vector<double>& errors) {
  const std::size_t n = powers.size();
  if (n < 3 || errors.size() != n) return std::nullopt;
  const auto best = static_cast<std::size_t>(std::min_element(errors.begin(), errors.end()) - errors.begin());
  const std::size_t count = std::min<std::size_t>(5, n);
  std::size_t first = best < count / 2 ? 0 : best - count / 2;
  first = std::min(first, n - count);
  // Around the smallest error, so that the fit is well conditioned.
  Eigen::MatrixXd A(count, 3);
  Eigen::VectorXd b(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double p = powers[first + k] - powers[best];
    const auto row = static_cast<Eigen::Index>(k);
    A.row(row) << 1.0, p, p * p;
    b(row) = errors[first + k] * errors[first + k];
  }
  const Eigen::VectorXd c = A.colPivHouseholderQr().solve(b);
  if (!(c(2) > 0.0)) return std::nullopt;
  Minimum out;
  const double shift = -0.5 * c(1) / c(2);
  out.power = powers[best] + shift;
  out.error = std::sqrt(std::max(0.0, c(0) - 0.25 * c(1) * c(1) / c(2)));
  out.inside = out.power >= powers.front() && out.power <= powers.back();
  out.uncertainty = std::numeric_limits<double>::quiet_NaN();
  if (count > 3) {
    const double variance = (A * c - b).squaredNorm() / static_cast<double>(count - 3);
    const Eigen::MatrixXd covariance = variance * (A.transpose() * A).inverse();
    Eigen::Vector3d slope;  // of the minimum's place over the coefficients
    slope << 0.0, -0.5 / c(2), 0.5 * c(1) / (c(2) * c(2));
    out.uncertainty = std::sqrt(std::max(0.0, (slope.transpose() * covariance * slope).value()));
  }
  return out;
}

std::optional<Minimum> least_error(const std::vector<double>& powers, const std::vector<std::vector<double>>& errors) {
  if (errors.empty()) return std::nullopt;
  std::vector<double> mean(powers.size(), 0.0);
  std::vector<double> minima;
  for (const std::vector<double>& one : errors) {
    if (one.size() != powers.size()) return std::nullopt;
    for (std::size_t k = 0; k < powers.size(); ++k) mean[k] += one[k] * one[k] / static_cast<double>(errors.size());
    if (const auto minimum = least_error(powers, one)) minima.push_back(minimum->power);
  }
  for (double& m : mean) m = std::sqrt(m);
  auto out = least_error(powers, mean);
  if (out && errors.size() >= 2) {
    const Spread spread = spread_of(minima);
    out->uncertainty = spread.deviation && minima.size() == errors.size()
                           ? *spread.deviation / std::sqrt(static_cast<double>(minima.size()))
                           : std::numeric_limits<double>::quiet_NaN();
  }
  return out;
}

}  // namespace platen
