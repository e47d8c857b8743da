#include "protocol/study/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace platen {

std::string size_text(double radius) { return fmt::format("R = {:g} mm", 1e3 * radius); }

bool Judge::is_plain(const MeasuredCurve& curve) const {
  if (!curve.planned->varied.empty() || curve.planned->powers.dashpots) return false;
  for (const CurveSpec& spec : part_.plan->study->curves)
    if (spec.name == curve.planned->block) return spec.set.empty();
  return false;
}

std::vector<const MeasuredCurve*> Judge::plain() const {
  std::vector<const MeasuredCurve*> out;
  for (const MeasuredCurve& curve : part_.curves)
    if (is_plain(curve) && !curve.runs.empty()) out.push_back(&curve);
  return out;
}

bool Judge::plain_are_there() const {
  return std::none_of(part_.curves.begin(), part_.curves.end(), [&](const MeasuredCurve& curve) { return is_plain(curve) && curve.runs.empty(); });
}

// The first planned one, with runs or not: another one in its place would be judged as what it is not.
const MeasuredCurve* Judge::first(const std::function<bool(const PlannedCurve&)>& wanted) const {
  for (const MeasuredCurve& curve : part_.curves)
    if (is_plain(curve) && wanted(*curve.planned)) return curve.runs.empty() ? nullptr : &curve;
  return nullptr;
}

const MeasuredCurve* Judge::reference() const {
  return first([&](const PlannedCurve& curve) { return curve.radius == part_.plan->reference_radius; });
}

const MeasuredCurve* Judge::scaled(double radius, std::optional<double> a, std::optional<double> b) const {
  return first([&](const PlannedCurve& curve) {
    return curve.radius == radius && (!a || curve.powers.stiffness == *a) && (!b || curve.powers.adhesion == *b);
  });
}

bool Judge::planned(double radius, double a, double b) const {
  return std::any_of(part_.curves.begin(), part_.curves.end(), [&](const MeasuredCurve& curve) {
    return is_plain(curve) && curve.planned->radius == radius && curve.planned->powers.stiffness == a && curve.planned->powers.adhesion == b;
  });
}

std::vector<double> Judge::radii() const {
  std::set<double> out;
  for (const MeasuredCurve& curve : part_.curves)
    if (is_plain(curve) && curve.planned->radius != part_.plan->reference_radius) out.insert(curve.planned->radius);
  return {out.begin(), out.end()};
}

double Judge::mean(const MeasuredCurve* curve, const std::string& scalar) {
  if (curve == nullptr) return no_value;
  const std::vector<double> values = curve->values(scalar);
  return values.empty() ? no_value : spread_of(values).mean;
}

double Judge::deviation(const MeasuredCurve* curve, const std::string& scalar) {
  return curve == nullptr ? no_value : spread_of(curve->values(scalar)).deviation.value_or(no_value);
}

Estimate Judge::estimate(const MeasuredCurve* curve, const std::string& scalar) {
  if (curve == nullptr) return {};
  const Spread spread = spread_of(curve->values(scalar));
  if (spread.count == 0) return {};
  return {spread.mean, spread.deviation.value_or(no_value) / std::sqrt(static_cast<double>(spread.count))};
}

Estimate Judge::ratio(const MeasuredCurve* a, const MeasuredCurve* b, const std::string& scalar) {
  const Estimate p = estimate(a, scalar), q = estimate(b, scalar);
  const double value = p.value / q.value;
  return {value, std::abs(value) * std::hypot(p.error / p.value, q.error / q.value)};
}

Estimate Judge::minus(const MeasuredCurve* a, const MeasuredCurve* b, const std::string& scalar) {
  const Estimate p = estimate(a, scalar), q = estimate(b, scalar);
  return {p.value - q.value, std::hypot(p.error, q.error)};
}

std::string Judge::shown(const MeasuredCurve* curve, const std::string& scalar, double scale, int decimals) {
  std::string text = fmt::format("{:.{}f}", scale * mean(curve, scalar), decimals);
  const double d = deviation(curve, scalar);
  if (std::isfinite(d)) text += fmt::format(" ± {:.{}f}", scale * d, decimals);
  return text;
}

void Judge::number(const std::string& figure, const std::string& text, Estimate found, Bounds bounds, int decimals,
                   const std::string& unit, double scale) {
  const double value = found.value;
  if (!std::isfinite(value)) return missing(figure, text);
  const std::string with_unit = unit.empty() ? "" : " " + unit;
  std::string allowed;
  if (std::isfinite(bounds.low) && std::isfinite(bounds.high))
    allowed = fmt::format("{:.3g} to {:.3g}{}", scale * bounds.low, scale * bounds.high, with_unit);
  else if (std::isfinite(bounds.high))
    allowed = fmt::format("at most {:.3g}{}", scale * bounds.high, with_unit);
  else
    allowed = fmt::format("at least {:.3g}{}", scale * bounds.low, with_unit);
  const std::string error = std::isfinite(found.error) ? fmt::format(" ± {:.{}f}", scale * found.error, decimals) : "";
  say(figure, text + ": " + allowed, fmt::format("{:.{}f}{}{}", scale * value, decimals, error, with_unit),
      value >= bounds.low && value <= bounds.high);
}

void Judge::say(const std::string& figure, const std::string& text, const std::string& number,
                std::optional<bool> holds) {
  std::optional<std::size_t> seeds;  // of the curve that has fewest
  const auto count = [&](const MeasuredCurve& curve) {
    const std::size_t own = std::set(curve.seeds.begin(), curve.seeds.end()).size();
    seeds = seeds ? std::min(*seeds, own) : own;
  };
  for (const MeasuredCurve* curve : curves_) {
    if (curve != nullptr)
      count(*curve);
    else
      seeds = 0;
  }
  if (curves_.empty())
    for (const MeasuredCurve& curve : part_.curves)
      if (!curve.runs.empty()) count(curve);
  out_->push_back({part_.plan->study->name, figure, text, number, holds, static_cast<int>(seeds.value_or(0))});
}

double Judge::distance(const MeasuredCurve* a, const MeasuredCurve* b, const std::string& observable) {
  if (a == nullptr || b == nullptr) return no_value;
  const auto error = collapse_error(a->curves(observable), b->curves(observable));
  return error ? error->of_means : no_value;
}

std::vector<double> Judge::difference(const MeasuredCurve* a, const std::string& of_a, const MeasuredCurve* b,
                                      const std::string& of_b) {
  if (a == nullptr || b == nullptr) return {};
  std::vector<Curve> all = a->curves(of_a), others = b->curves(of_b);
  const std::size_t first = all.size();
  if (first == 0 || others.empty()) return {};
  all.insert(all.end(), others.begin(), others.end());
  const auto range = common_range(all);
  if (!range) return {};
  std::vector<double> out;
  for (const double x : grid(*range)) {
    double sum_a = 0.0, sum_b = 0.0;
    for (std::size_t k = 0; k < all.size(); ++k)
      (k < first ? sum_a : sum_b) += value_at(all[k], std::clamp(x, all[k].x.front(), all[k].x.back()));
    out.push_back(sum_b / static_cast<double>(all.size() - first) - sum_a / static_cast<double>(first));
  }
  return out;
}

}  // namespace platen
