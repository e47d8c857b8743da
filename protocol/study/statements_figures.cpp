// The statements on Fig. 4-10 and 12-14 [Thakur2016, sections 4.1-4.3; bands: docs/studies.md].
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "protocol/study/judge.h"

namespace platen {
namespace {

double smallest(const std::vector<double>& values) {
  return values.empty() ? no_value : *std::min_element(values.begin(), values.end());
}

double largest_size(const std::vector<double>& values) {
  if (values.empty()) return no_value;
  double out = 0.0;
  for (const double v : values) out = std::max(out, std::abs(v));
  return out;
}

// Largest minus smallest mean of a scalar over curves; NaN where one is missing.
double span(const std::vector<const MeasuredCurve*>& curves, const std::string& scalar) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const MeasuredCurve* curve : curves) {
    const double mean = Judge::mean(curve, scalar);
    if (!std::isfinite(mean)) return no_value;
    low = std::min(low, mean), high = std::max(high, mean);
  }
  return curves.size() < 2 ? no_value : high - low;
}

// The size of a - b.
Estimate apart(const MeasuredCurve* a, const MeasuredCurve* b, const std::string& scalar) {
  const Estimate d = Judge::minus(a, b, scalar);
  return {std::abs(d.value), d.error};
}

// Everything but the slab at either end: walls loosen them.
std::vector<double> inside(const Curve& profile) {
  return profile.y.size() < 4 ? std::vector<double>{} : std::vector<double>(profile.y.begin() + 1, profile.y.end() - 1);
}

Curve mean_profile(const MeasuredCurve* curve) {
  if (curve == nullptr) return {};
  const std::vector<Curve> all = curve->curves("porosity_height");
  if (all.empty()) return {};
  Curve out = all.front();
  for (std::size_t k = 0; k < out.y.size(); ++k) {
    out.y[k] = 0.0;
    for (const Curve& one : all) out.y[k] += one.y[k] / static_cast<double>(all.size());
  }
  return out;
}

// Least-squares change from one end to the other.
double trend(const std::vector<double>& y) {
  if (y.size() < 3) return no_value;
  const double n = static_cast<double>(y.size()), middle = 0.5 * (n - 1.0);
  double sxy = 0.0, sxx = 0.0;
  for (std::size_t k = 0; k < y.size(); ++k) {
    const double x = static_cast<double>(k) - middle;
    sxy += x * y[k];
    sxx += x * x;
  }
  return sxy / sxx * (n - 1.0);
}

double mean_of(const std::vector<double>& y) {
  return y.empty() ? no_value : std::accumulate(y.begin(), y.end(), 0.0) / static_cast<double>(y.size());
}

void judge_profile(Judge& judge, const MeasuredCurve* reference, const MeasuredCurve* scaled,
                   const MeasuredCurve* unscaled, const std::string& size) {
  judge.on({reference, scaled}).number("6", size + " scaled: RMS distance of the porosity profile from the reference",
               Judge::distance(reference, scaled, "porosity_height"), {.high = 0.006}, 4);
  const Curve a = mean_profile(reference), b = mean_profile(unscaled);
  double least = no_value;
  for (std::size_t k = 0; k < a.y.size() && a.y.size() == b.y.size(); ++k) least = std::fmin(least, a.y[k] - b.y[k]);
  judge.on({reference, unscaled}).number("6", size + " unscaled: smaller porosity in every slab, least difference", least, {.low = 0.0}, 4);
  const std::vector<double> core = inside(a);
  const double ends = a.y.size() < 4 ? no_value : std::min(a.y.front(), a.y.back());
  judge.on({reference}).number("6", "reference: both end slabs are looser than the inside, least difference", ends - mean_of(core), {.low = 0.0}, 4);
  judge.on({reference}).number("6", "reference: no trend with height inside", std::abs(trend(core)), {.high = 0.015}, 4);
}

}  // namespace

void judge_figures_4_7(Judge& judge) {
  const MeasuredCurve* ref = judge.reference();
  judge.on({ref}).number("filling", "reference: porosity after the rain", Judge::estimate(ref, "porosity_filled"), {0.41, 0.44}, 4);
  judge.on({ref}).number("filling", "reference: porosity at 0.1 kPa after vibration", Judge::estimate(ref, "porosity_at_100_pa"),
               {0.38, 0.41}, 4);
  judge.number("filling", "all sizes: span of the porosity at 0.1 kPa", judge.plain_are_there() ? span(judge.plain(), "porosity_at_100_pa") : no_value,
               {.high = 0.008}, 4);
  judge.on({ref}).number("4", "reference: strain at the end of loading", Judge::estimate(ref, "strain_peak"), {0.05, 0.08}, 2, "%",
               100.0);
  const double residual = Judge::mean(ref, "strain_residual") / Judge::mean(ref, "strain_peak");
  judge.on({ref}).number("4", "reference: residual over peak strain", residual, {0.75, 0.85}, 3);
  judge.on({ref}).number("4", "reference: unloading is much stiffer, strain given back over strain of loading", 1.0 - residual,
               {.high = 0.5}, 3);
  judge.on({ref}).number("5", "reference: porosity at the end of loading", Judge::estimate(ref, "porosity_peak"), {0.335, 0.36}, 4);
  judge.on({ref}).number("7", "reference: coordination number at the end of loading", Judge::estimate(ref, "coordination_peak"),
               {5.9, 6.5}, 3);
  const std::vector<double> above = Judge::difference(ref, "coordination", ref, "coordination_unloading");
  judge.on({ref}).number("7", "reference: the unloading branch lies above the loading branch, least difference", smallest(above),
               {.low = 0.0}, 3);
  for (const double R : judge.radii()) {
    const std::string size = size_text(R);
    const MeasuredCurve* scaled = judge.scaled(R, 1.0, std::nullopt);
    const MeasuredCurve* unscaled = judge.scaled(R, 0.0, std::nullopt);
    judge.on({scaled, ref}).number("4", size + " scaled: strain at the end of loading over the reference's",
                 Judge::ratio(scaled, ref, "strain_peak"), {0.9, 1.1}, 3);
    judge.on({unscaled, scaled}).number("4", size + ": unscaled is softer, strain over the scaled one's",
                 Judge::ratio(unscaled, scaled, "strain_peak"), {1.2, 1.45}, 3);
    judge.on({scaled, ref}).number("5", size + " scaled: distance of the porosity at the end of loading from the reference's",
                 apart(scaled, ref, "porosity_peak"), {.high = 0.006}, 4);
    judge.on({ref, unscaled}).number("5", size + " unscaled: porosity at the end of loading lower than the reference's by",
                 Judge::minus(ref, unscaled, "porosity_peak"), {0.008, 0.025}, 4);
    judge.on({unscaled, ref}).number("5", size + " unscaled: lower at every stress, least difference",
                 smallest(Judge::difference(unscaled, "porosity", ref, "porosity")), {.low = 0.0}, 4);
    judge.on({ref, scaled, unscaled}).number("5", size + ": equal start, span of the porosity at 1 kPa",
                 span({ref, scaled, unscaled}, "porosity_start"), {.high = 0.008}, 4);
    judge_profile(judge, ref, scaled, unscaled, size);
    judge.on({unscaled, scaled}).number("7", size + ": coordination number at the end of loading, unscaled minus scaled",
                 Judge::minus(unscaled, scaled, "coordination_peak"), {0.15, 0.45}, 3);
    judge.on({scaled, ref}).number("7", size + " scaled: distance of the coordination number at the end of loading from the reference's",
                 apart(scaled, ref, "coordination_peak"), {.high = 0.12}, 3);
    judge.on({ref, scaled}).number("7", size + " scaled: largest distance from the reference's loading branch",
                 largest_size(Judge::difference(ref, "coordination", scaled, "coordination")), {.high = 0.12}, 3);
    judge.on({ref, scaled}).number("7", size + " scaled: largest distance from the reference's unloading branch",
                 largest_size(Judge::difference(ref, "coordination_unloading", scaled, "coordination_unloading")),
                 {.high = 0.12}, 3);
  }
}

void judge_figures_8_10(Judge& judge) {
  const MeasuredCurve* ref = judge.reference();
  std::vector<double> packing, strength;  // Rumpf
  std::vector<const MeasuredCurve*> sizes{ref};  // all that the quadratic law must bring together
  for (const double R : judge.radii()) sizes.push_back(judge.scaled(R, 1.0, 2.0));
  const auto relative_span = [&](const char* scalar) { return span(sizes, scalar) / Judge::mean(ref, scalar); };
  judge.on(sizes).number("8", "quadratic, all sizes: span of the strain at the end of loading over the reference's", relative_span("strain_peak"), {.high = 0.12}, 3);
  judge.on(sizes).number("9", "quadratic, all sizes: span of the porosity at the strain zero", span(sizes, "porosity_at_zero"), {.high = 0.015}, 4);
  judge.on(sizes).number("10", "quadratic, all sizes: span of the strength over the reference's", relative_span("strength"), {.high = 0.15}, 3);
  for (const double R : judge.radii()) {
    const std::string size = size_text(R);
    const MeasuredCurve* linear = judge.scaled(R, 1.0, 1.0);
    const MeasuredCurve* quadratic = judge.scaled(R, 1.0, 2.0);
    const MeasuredCurve* cubic = judge.scaled(R, 1.0, 3.0);
    judge.on({quadratic, ref}).number("8", size + " quadratic: strain at the end of loading over the reference's",
                 Judge::ratio(quadratic, ref, "strain_peak"), {0.88, 1.12}, 3);
    judge.on({quadratic, ref}).number("9", size + " quadratic: distance of the porosity at the strain zero from the reference's",
                 apart(quadratic, ref, "porosity_at_zero"), {.high = 0.015}, 4);
    judge.on({quadratic, ref}).number("10", size + " quadratic: strength over the reference's", Judge::ratio(quadratic, ref, "strength"),
                 {0.85, 1.15}, 3);
    judge.on({quadratic, ref}).number("10", size + " quadratic: initial stiffness over the reference's",
                 Judge::ratio(quadratic, ref, "initial_stiffness"), {0.85, 1.15}, 3);
    if (!judge.planned(R, 1.0, 1.0) && !judge.planned(R, 1.0, 3.0)) continue;
    // Spheres smaller than the reference turn the order round.
    const double sign = R > judge.part().plan->reference_radius ? 1.0 : -1.0;
    const auto ordered = [&](const std::string& figure, const std::string& what, const std::string& scalar,
                             double scale, int decimals) {
      const double a = Judge::mean(linear, scalar), b = Judge::mean(quadratic, scalar), c = Judge::mean(cubic, scalar);
      const std::string text =
          size + ": " + what + (sign > 0.0 ? ", linear < quadratic < cubic" : ", linear > quadratic > cubic");
      if (!std::isfinite(a + b + c)) return judge.on({linear, quadratic, cubic}).missing(figure, text);
      judge.on({linear, quadratic, cubic}).say(
          figure, text,
          fmt::format("{}, {}, {}", Judge::shown(linear, scalar, scale, decimals),
                      Judge::shown(quadratic, scalar, scale, decimals), Judge::shown(cubic, scalar, scale, decimals)),
          sign * (b - a) > 0.0 && sign * (c - b) > 0.0);
    };
    ordered("8", "strain at the end of loading [%]", "strain_peak", 100.0, 2);
    ordered("9", "porosity at the strain zero", "porosity_at_zero", 1.0, 4);
    ordered("10", "initial stiffness [kPa]", "initial_stiffness", 1e-3, 0);
    const double before = span({linear, quadratic, cubic}, "porosity_at_zero"), after = span({linear, quadratic, cubic}, "porosity_peak");
    judge.on({linear, quadratic, cubic}).number("9", size + ": span of the porosity at the end of loading", after, {.high = 0.02}, 4);
    judge.on({linear, quadratic, cubic}).number("9", size + ": converging, that span over the one at the strain zero", after / before, {.high = 1.0}, 3);
    // The bands are those of 3.75 mm against 2.5 mm; f0 over the quadratic one is (R/R_ref)^-1 or ^+1 [S3].
    const double steps = std::log(R / judge.part().plan->reference_radius) / std::log(1.5);
    const auto band = [&](double low, double high) {
      const double a = std::pow(low, steps), b = std::pow(high, steps);
      return Bounds{std::min(a, b), std::max(a, b)};
    };
    judge.on({linear, quadratic}).number("10", size + ": strength, linear over quadratic", Judge::ratio(linear, quadratic, "strength"), band(0.45, 0.8), 3);
    judge.on({cubic, quadratic}).number("10", size + ": strength, cubic over quadratic", Judge::ratio(cubic, quadratic, "strength"), band(1.25, 1.65), 3);
  }
  for (const MeasuredCurve* curve : judge.plain()) {
    const double f0 =
        judge.part().plan->base.particles.law.f0 *
        std::pow(curve->planned->radius / judge.part().plan->reference_radius, curve->planned->powers.adhesion);
    const double d = 2.0 * curve->planned->radius;
    const double x = Judge::mean(curve, "coordination_released") * (1.0 - Judge::mean(curve, "porosity_residual"));
    const double y = Judge::mean(curve, "strength") * d * d / std::abs(f0);
    if (!std::isfinite(x + y)) continue;
    packing.push_back(x);
    strength.push_back(y);
  }
  const std::string rumpf = "Rumpf: correlation over all curves of strength d^2/|f0| with CN (1 - porosity)";
  if (packing.size() < 3 || !judge.plain_are_there()) return judge.missing("10", rumpf);
  const double mx = mean_of(packing), my = mean_of(strength);
  double xy = 0.0, xx = 0.0, yy = 0.0;
  for (std::size_t k = 0; k < packing.size(); ++k) {
    xy += (packing[k] - mx) * (strength[k] - my);
    xx += (packing[k] - mx) * (packing[k] - mx);
    yy += (strength[k] - my) * (strength[k] - my);
  }
  judge.number("10", rumpf, xy / std::sqrt(xx * yy), {.low = 0.0}, 2);
}

void judge_figures_12_14(Judge& judge) {
  const MeasuredCurve* ref = judge.reference();
  for (const double R : judge.radii()) {
    const std::string size = size_text(R);
    const MeasuredCurve* scaled = judge.scaled(R, 1.0, std::nullopt);
    judge.on({scaled, ref}).number("12", size + ": strain at the end of loading over the reference's", Judge::ratio(scaled, ref, "strain_peak"),
                 {0.9, 1.1}, 3);
    judge.on({ref, scaled}).number("12", size + ": slightly lower peak strain, reference minus scaled", Judge::minus(ref, scaled, "strain_peak"),
                 {.low = 0.0}, 2, "%", 100.0);
    judge.on({ref, scaled}).number("13", size + ": largest difference of the porosity over all stresses",
                 largest_size(Judge::difference(ref, "porosity", scaled, "porosity")), {.high = 0.015}, 4);
    judge.on({ref, scaled}).number("13", size + ": the same while unloading",
                 largest_size(Judge::difference(ref, "porosity_unloading", scaled, "porosity_unloading")), {.high = 0.015}, 4);
    const double start = apart(scaled, ref, "porosity_start").value,
                 end = apart(scaled, ref, "porosity_peak").value;
    const std::string converging = size + ": the difference of the porosity shrinks with stress";
    if (std::isfinite(start + end))
      judge.on({scaled, ref}).say("13", converging, fmt::format("{:.4f} at 1 kPa, {:.4f} at the end", start, end), end <= start);
    else
      judge.on({scaled, ref}).missing("13", converging);
    judge.on({scaled, ref}).number("14", size + ": initial stiffness over the reference's", Judge::ratio(scaled, ref, "initial_stiffness"),
                 {0.85, 1.15}, 3);
    const Estimate strength = Judge::ratio(scaled, ref, "strength");
    judge.on({scaled, ref}).number("14", size + ": strength over the reference's, less one (the paper: -9.5 %)", {strength.value - 1.0, strength.error}, {-0.15, 0.15}, 1, "%", 100.0);
    judge.on({scaled, ref}).number("14", size + ": lower strength than the reference", {strength.value - 1.0, strength.error}, {.high = 0.0}, 1, "%", 100.0);
    judge.on({scaled, ref}).number("14", size + ": equal coordination number at the end of loading, difference",
                 apart(scaled, ref, "coordination_peak"), {.high = 0.12}, 3);
    const auto drop = [&](const MeasuredCurve* curve) {
      return Judge::mean(curve, "coordination_unloaded") - Judge::mean(curve, "coordination_released");
    };
    const std::string text =
        size + ": the coordination number drops more than the reference's when the sides are removed";
    if (std::isfinite(drop(scaled) + drop(ref)))
      judge.on({scaled, ref}).say("14", text, fmt::format("{:.3f} against {:.3f}", drop(scaled), drop(ref)), drop(scaled) > drop(ref));
    else
      judge.on({scaled, ref}).missing("14", text);
  }
}

}  // namespace platen
