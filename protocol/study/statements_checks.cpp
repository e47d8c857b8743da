// The statements on run time, quasi-static loading, similarity, and the checks that every case must pass.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "protocol/study/judge.h"

namespace platen {
namespace {

double median(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return no_value;
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

// Is a change inside the scatter over seeds of what it changes? Its own standard error stands beside it.
void inside_scatter(Judge& judge, const std::string& figure, const MeasuredCurve& curve, const MeasuredCurve& reference,
                    const std::string& scalar, const std::string& what, double scale, const std::string& unit) {
  const Estimate found = Judge::minus(&curve, &reference, scalar);
  const double change = found.value;
  const std::string text = fmt::format("{}: change of the {} below the scatter over seeds", curve.planned->label, what);
  if (!std::isfinite(change)) return;  // this case has no such stage
  const double scatter = Judge::deviation(&reference, scalar);
  if (!std::isfinite(scatter))
    return judge.say(figure, text, fmt::format("{:+.3g} {} (scatter unknown, needs two seeds)", scale * change, unit),
                     std::nullopt);
  const std::string error = std::isfinite(found.error) ? fmt::format(" ± {:.2g}", scale * found.error) : "";
  judge.say(figure, text, fmt::format("{:+.3g}{} {}, scatter {:.3g} {}", scale * change, error, unit, scale * scatter, unit),
            std::abs(change) <= scatter);
}

// Of the plate in the first compression.
double loading_speed(const StudyPlan& plan, const MeasuredCurve& curve) {
  for (const StageSpec& stage : plan.jobs[curve.planned->jobs.front()].c.stages)
    if (stage.kind == StageKind::compress) return stage.speed;
  return no_value;
}

// Strain over stress from the stress `zero` on, by the porosity: solid volume and area are constant, so that
// h ~ 1/(1 - porosity).
Curve strain_by_porosity(const Curve& porosity, double zero) {
  Curve out;
  const double p0 = value_at(porosity, zero);
  for (std::size_t k = 0; k < porosity.x.size(); ++k) {
    if (porosity.x[k] < zero) continue;
    out.x.push_back(porosity.x[k]);
    out.y.push_back(1.0 - (1.0 - p0) / (1.0 - porosity.y[k]));
  }
  return std::isfinite(p0) ? out : Curve{};
}

}  // namespace

void judge_figure_11(Judge& judge, const StudyPlan& plan) {
  std::map<double, std::map<double, const MeasuredCurve*>> by_step;  // power of the time step -> radius -> curve
  for (const MeasuredCurve* curve : judge.plain()) {
    by_step[curve->planned->powers.time_step][curve->planned->radius] = curve;
    // The reference has the same step under every power.
    if (curve->planned->radius == judge.part().plan->reference_radius)
      for (const MeasuredCurve* other : judge.plain())
        by_step[other->planned->powers.time_step][curve->planned->radius] = curve;
  }
  for (const auto& [power, curves] : by_step) {
    const std::string how = power == 0.0 ? "equal time steps" : fmt::format("time step ~ R^{:g}", power);
    if (curves.size() < 2) {
      judge.missing("11", how + ": run time falls with R");
      continue;
    }
    std::string times;
    bool falls = true;
    double last = no_value, steal = 0.0;
    for (const auto& [R, curve] : curves) {
      const double t = median(curve->wall_seconds);
      times += fmt::format("{}{:g} mm: {:.4g} s", times.empty() ? "" : ", ", 1e3 * R, t);
      falls = falls && !(t >= last);
      last = t;
      for (const double s : curve->steal_seconds) steal = std::max(steal, s);
    }
    judge.say("11", how + ": run time falls with R (medians)",
              times + fmt::format("; steal time of a run at most {:.1f} s", steal), falls);
    const MeasuredCurve* small = curves.begin()->second;
    const MeasuredCurve* large = curves.rbegin()->second;
    const auto count = [&](const MeasuredCurve* c) {
      return static_cast<double>(plan.jobs[c->jobs.front()].c.particles.count);
    };
    const std::string text =
        fmt::format("{}: run time from {:g} to {:g} mm falls more than sevenfold (spheres alone: {:.2f})", how,
                    1e3 * small->planned->radius, 1e3 * large->planned->radius, count(small) / count(large));
    const double ratio = median(small->wall_seconds) / median(large->wall_seconds);
    if (std::isfinite(ratio))
      judge.say("11", text, fmt::format("{:.2f}", ratio), ratio > 7.0);
    else
      judge.missing("11", text);
  }
}

void judge_quasi_static(Judge& all, const StudyPlan& plan) {
  for (const MeasuredCurve& curve : all.part().curves) {
    Judge judge = all.on({&curve});
    if (curve.runs.empty()) {
      judge.missing("quasi-static", curve.planned->label + ": strain rate, inertial number");
      continue;
    }
    judge.number("quasi-static", curve.planned->label + ": strain rate", Judge::mean(&curve, "strain_rate"),
                 {.high = 0.1}, 4, "1/s");
    const double from = Judge::mean(&curve, "quasi_static_stress");
    const std::string text = curve.planned->label + ": inertial number below 1e-4 at the end of loading";
    const double inertial = Judge::mean(&curve, "inertial_peak"), at_start = Judge::mean(&curve, "inertial_start");
    if (std::isfinite(inertial))
      judge.say("quasi-static", text,
                fmt::format("{:.2g}{}, below 1e-4 {}", inertial,
                            std::isfinite(at_start) ? fmt::format(" ({:.2g} at the start)", at_start) : "",
                            std::isfinite(from) ? fmt::format("from {:.2f} kPa on", 1e-3 * from) : "nowhere"),
                inertial < 1e-4);
    const MeasuredCurve& reference = judge.part().curves[curve.planned->reference];
    if (&reference == &curve || judge.is_plain(curve) || reference.runs.empty()) continue;
    Judge both = all.on({&curve, &reference});
    inside_scatter(both, "quasi-static", curve, reference, "strain_peak", "strain at the end of loading", 100.0, "%");
    inside_scatter(both, "quasi-static", curve, reference, "strength", "strength", 1e-3, "kPa");
    inside_scatter(both, "quasi-static", curve, reference, "initial_stiffness", "initial stiffness", 1e-3, "kPa");
    const double change = std::abs(Judge::mean(&curve, "strain_peak") / Judge::mean(&reference, "strain_peak") - 1.0);
    if (loading_speed(plan, curve) < loading_speed(plan, reference))
      both.number("quasi-static", curve.planned->label + ": change of the strain at the end of loading, of it", change,
                   {.high = 0.02}, 2, "%", 100.0);
  }
}

// The unscaled bed of a size: the plain one; where none is planned, one with keys of its own, as gravity scaled with the stiffness.
const MeasuredCurve* unscaled_bed(const Judge& judge, double R) {
  const MeasuredCurve* special = nullptr;
  for (const MeasuredCurve& curve : judge.part().curves) {
    if (curve.planned->radius != R || curve.planned->powers.stiffness != 0.0) continue;
    if (judge.is_plain(curve)) return judge.scaled(R, 0.0, std::nullopt);
    if (special == nullptr && !curve.runs.empty()) special = &curve;
  }
  return special;
}

void judge_similarity_2(Judge& judge) {
  const Case& base = judge.part().plan->base;
  double zero = judge.part().plan->study->strain_zero.value_or(no_value);
  for (const StageSpec& stage : base.stages)
    if (stage.kind == StageKind::compress && !std::isfinite(zero)) zero = stage.strain_zero;
  for (const double R : judge.radii()) {
    const double lambda = R / judge.part().plan->reference_radius;
    const MeasuredCurve* scaled = judge.scaled(R, 1.0, std::nullopt);
    const MeasuredCurve* unscaled = unscaled_bed(judge, R);
    const std::string text = fmt::format(
        "{}: the unscaled bed at a stress has the strain of the scaled bed at {:g} times the "
        "stress, RMS distance below the scatter over seeds",
        size_text(R), lambda);
    if (scaled == nullptr || unscaled == nullptr) {
      judge.missing("S2", text);
      continue;
    }
    std::vector<Curve> expected, found;
    for (const Curve& porosity : scaled->curves("porosity")) expected.push_back(strain_by_porosity(porosity, zero));
    for (Curve porosity : unscaled->curves("porosity")) {
      for (double& stress : porosity.x) stress *= lambda;
      found.push_back(strain_by_porosity(porosity, zero));
    }
    const auto error = collapse_error(expected, found);
    if (!error)
      judge.missing("S2", text);
    else if (!error->in_scatter)
      judge.on({scaled, unscaled}).say("S2", text, fmt::format("{:.3f} % strain (scatter unknown, needs two seeds)", 100.0 * error->of_means),
                std::nullopt);
    else {
      const double sigma = error->error / *error->in_scatter;
      judge.on({scaled, unscaled}).say("S2", text, fmt::format("{:.3f} % strain, scatter {:.3f} %", 100.0 * error->of_means, 100.0 * sigma),
                error->of_means <= sigma);
    }
  }
}

void judge_similarity_3(Judge& all) {
  for (const CollapseRow& row : all.part().collapse) {
    Judge judge = all.on({&all.part().curves[row.curve], &all.part().curves[row.reference]});
    const std::string text = fmt::format("\"{}\" equals \"{}\" in {}, RMS distance below the scatter over seeds",
                                         judge.part().curves[row.curve].planned->label,
                                         judge.part().curves[row.reference].planned->label, row.observable);
    const std::string unit = observable_kind(row.observable).y_unit == "Pa" ? " Pa" : "";
    if (!row.error.in_scatter) {
      judge.say("S3", text, fmt::format("{:.3g}{} (scatter unknown, needs two seeds)", row.error.of_means, unit),
                std::nullopt);
      continue;
    }
    const double sigma = row.error.error / *row.error.in_scatter;
    judge.say("S3", text, fmt::format("{:.3g}{}, scatter {:.3g}{}", row.error.of_means, unit, sigma, unit),
              row.error.of_means <= sigma);
  }
}

// What Eq. 10 adds to mu |f_hys|: without it the strength falls by more than a quarter [Thakur2014, Fig. 22].
void judge_friction_limit(Judge& judge) {
  for (const MeasuredCurve& curve : judge.part().curves) {
    const MeasuredCurve& reference = judge.part().curves[curve.planned->reference];
    if (&reference == &curve) continue;
    const std::string text = fmt::format("{}: strength over that of {}", curve.planned->label, reference.planned->label);
    judge.on({&curve, &reference}).number("friction limit", text, Judge::ratio(&curve, &reference, "strength"), {.high = 0.75}, 2);
  }
}

// Does a curve answer as the one that it is compared with, by the bands of Fig. 8 and 10? Only curves that follow the scaling law are
// judged; for the others the figure stands without a bar. Where sizes alone differ: how coarse may spheres be?
void judge_like_reference(Judge& judge) {
  const std::string figure = "like the reference";
  const PlannedPart& plan = *judge.part().plan;
  const double wanted = 2.0 - plan.base.particles.law.exponent;  // docs/scaling.md
  struct Quantity {
    const char *scalar, *name;
    double band;
  };
  for (const Quantity& q : {Quantity{"strain_peak", "strain at the end of loading", 0.12}, Quantity{"strength", "unconfined strength", 0.15}}) {
    std::map<double, std::optional<bool>> coarser;  // radius -> of curves that differ in nothing else; empty: no data
    for (const MeasuredCurve& curve : judge.part().curves) {
      const MeasuredCurve& reference = judge.part().curves[curve.planned->reference];
      if (&reference == &curve) continue;
      const std::string text = fmt::format("{}: {} over that of {}", curve.planned->label, q.name, reference.planned->label);
      const Estimate ratio = Judge::ratio(&curve, &reference, q.scalar);
      const bool lawful = judge.is_plain(curve) && curve.planned->powers.stiffness == wanted && curve.planned->powers.adhesion == 2.0;
      Judge both = judge.on({&curve, &reference});
      if (lawful) {
        both.number(figure, text, ratio, {1.0 - q.band, 1.0 + q.band}, 3);
        if (curve.planned->radius > plan.reference_radius && reference.planned->radius == plan.reference_radius)
          coarser[curve.planned->radius] = std::isfinite(ratio.value) ? std::optional(std::abs(ratio.value - 1.0) <= q.band) : std::nullopt;
      } else if (std::isfinite(ratio.value)) {
        both.say(figure, text, fmt::format("{:.3f}{}", ratio.value, std::isfinite(ratio.error) ? fmt::format(" ± {:.3f}", ratio.error) : ""), std::nullopt);
      } else {
        both.missing(figure, text);
      }
    }
    if (coarser.size() < 2) continue;
    double coarsest = 0.0;
    bool all = true;
    for (const auto& [R, holds] : coarser) {
      all = all && holds.value_or(false);
      if (!all) break;
      coarsest = R;
    }
    const BoxSpec& box = plan.base.box;
    // Radii of a distribution are stretched alike.
    const double largest = plan.base.particles.sizes.largest() / plan.reference_radius;
    judge.say(figure, fmt::format("coarsest size of those tried up to which the {} stays within {:g} %", q.name, 100.0 * q.band),
              coarsest > 0.0 ? fmt::format("{}{}, box over largest diameter {:.3g}", all ? "at least " : "", size_text(coarsest),
                                           std::min(box.width, box.depth) / (2.0 * coarsest * largest))
                             : "none",
              std::nullopt);
  }
}

void judge_cross_checks(Judge& all) {
  for (const MeasuredCurve& curve : all.part().curves) {
    Judge judge = all.on({&curve});
    const std::string& label = curve.planned->label;
    if (curve.runs.empty()) {
      judge.missing("checks", label + ": weight on the bottom, overlaps");
      continue;
    }
    const double weight = Judge::mean(&curve, "weight_over_area");
    const auto check = [&](const char* scalar, const std::string& text) {
      const Estimate e = Judge::estimate(&curve, scalar);
      if (std::isfinite(e.value)) judge.number("checks", label + ": " + text, {e.value / weight, e.error / weight}, {0.98, 1.02}, 4);
    };
    check("stress_difference", "bottom minus top stress over weight/area, loading while the inertial number is below 1e-4");
    check("stress_difference_unloaded", "bottom minus top stress over weight/area, unloading while the inertial number is below 1e-4");
    const double top = Judge::mean(&curve, "stress_top_unloaded");
    if (std::isfinite(top)) judge.number("checks", label + ": top stress after unloading", top, {.high = 0.0}, 1, "Pa");
    check("stress_bottom_released", "bottom stress over weight/area, freed and at rest");
    const double overlap = Judge::mean(&curve, "largest_overlap");
    if (std::isfinite(overlap))
      judge.number("checks", label + ": largest overlap over the diameter", overlap, {.high = 0.25}, 1, "%", 100.0);
  }
}

void judge_scans(Judge& judge) {
  for (const ScanResult& scan : judge.part().scans) {
    const bool stiffness = scan.power == ScanSpec::Power::stiffness;
    const double wanted = stiffness ? 2.0 - judge.part().plan->base.particles.law.exponent : 2.0;  // docs/scaling.md
    const std::string what = fmt::format("{} of {}, {}", stiffness ? "stiffness power" : "adhesion power",
                                         size_text(scan.radius), scan.observable);
    if (std::find(scan.powers.begin(), scan.powers.end(), wanted) != scan.powers.end())
      judge.say("scan", fmt::format("{}: {:g} has the least collapse error of the tried ones", what, wanted),
                fmt::format("{:g}", scan.best_tried), scan.best_tried == wanted);
    const std::string text = fmt::format("{}: the minimum lies at {:g}, within its 95 % interval", what, wanted);
    if (!scan.minimum || !scan.minimum->inside)
      judge.say("scan", text, "no minimum inside the scan", scan.minimum && scan.minimum->degrees == 0 ? std::nullopt : std::optional(false));
    else if (!std::isfinite(scan.minimum->uncertainty) || scan.minimum->degrees == 0)
      judge.say("scan", text, fmt::format("{:.3f} (uncertainty unknown)", scan.minimum->power), std::nullopt);
    else {
      const auto [least, most] = std::minmax_element(scan.powers.begin(), scan.powers.end());
      const double half_width = student_975(scan.minimum->degrees) * scan.minimum->uncertainty;
      // An interval wider than what was tried says nothing of any power.
      const std::optional<bool> holds = 2.0 * half_width > *most - *least ? std::nullopt : std::optional(std::abs(scan.minimum->power - wanted) <= half_width);
      judge.say("scan", text, fmt::format("{:.3f} ± {:.3f}", scan.minimum->power, scan.minimum->uncertainty), holds);
    }
  }
}

}  // namespace platen
