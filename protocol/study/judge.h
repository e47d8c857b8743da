// What the statements are made of: finding curves by their powers, numbers with their scatter, bands.
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "protocol/study/statements.h"

namespace platen {

inline constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

struct Bounds {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
};

// A number between means over seeds, with its standard error; NaN where it is not known.
struct Estimate {
  double value = no_value, error = no_value;
  Estimate() = default;
  Estimate(double v) : value(v) {}
  Estimate(double v, double e) : value(v), error(e) {}
};

class Judge {
 public:
  Judge(const PartResults& part, std::vector<Statement>& out) : part_(part), out_(&out) {}

  const PartResults& part() const { return part_; }

  // The same judge for statements on these curves alone, the fewest seeds of which are what is said beside them; nullptr: none.
  Judge on(std::vector<const MeasuredCurve*> curves) const {
    Judge other = *this;
    other.curves_ = std::move(curves);
    return other;
  }

  // Unvaried curves, the first planned one; nullptr where there is none or none of its runs is done.
  const MeasuredCurve* reference() const;
  const MeasuredCurve* scaled(double radius, std::optional<double> a, std::optional<double> b) const;
  bool planned(double radius, double a, double b) const;  // an unvaried curve of these powers, with runs or not
  std::vector<double> radii() const;                // planned ones of unvaried curves, without the reference's, increasing
  std::vector<const MeasuredCurve*> plain() const;  // all unvaried curves with runs
  bool plain_are_there() const;                     // every unvaried curve has runs
  bool is_plain(const MeasuredCurve& curve) const;  // nothing but radius and powers differs from the base

  // Mean over seeds of a scalar; NaN for nullptr and where no run has it.
  static double mean(const MeasuredCurve* curve, const std::string& scalar);
  static double deviation(const MeasuredCurve* curve, const std::string& scalar);  // over seeds; NaN below two
  static Estimate estimate(const MeasuredCurve* curve, const std::string& scalar);
  static Estimate ratio(const MeasuredCurve* a, const MeasuredCurve* b, const std::string& scalar);  // a over b
  static Estimate minus(const MeasuredCurve* a, const MeasuredCurve* b, const std::string& scalar);  // a - b
  static std::string shown(const MeasuredCurve* curve, const std::string& scalar, double scale, int decimals);

  // A number that must lie in a band.
  void number(const std::string& figure, const std::string& text, Estimate value, Bounds bounds, int decimals,
              const std::string& unit = "", double scale = 1.0);
  void say(const std::string& figure, const std::string& text, const std::string& number, std::optional<bool> holds);
  void missing(const std::string& figure, const std::string& text) { say(figure, text, "no data", std::nullopt); }

  // RMS distance, unit of the observable, between the means of two curves; NaN without data.
  static double distance(const MeasuredCurve* a, const MeasuredCurve* b, const std::string& observable);
  // b - a on the common axis, of the means over seeds; empty without data.
  static std::vector<double> difference(const MeasuredCurve* a, const std::string& of_a, const MeasuredCurve* b,
                                        const std::string& of_b);

 private:
  const MeasuredCurve* first(const std::function<bool(const PlannedCurve&)>& wanted) const;
  const PartResults& part_;
  std::vector<Statement>* out_;
  std::vector<const MeasuredCurve*> curves_;  // that statements are on; empty: all with runs
};

std::string size_text(double radius);  // "R = 3.75 mm"

// One group each.
void judge_figures_4_7(Judge& judge);
void judge_figures_8_10(Judge& judge);
void judge_figure_11(Judge& judge, const StudyPlan& plan);
void judge_figures_12_14(Judge& judge);
void judge_quasi_static(Judge& judge, const StudyPlan& plan);
void judge_similarity_2(Judge& judge);
void judge_similarity_3(Judge& judge);
void judge_friction_limit(Judge& judge);
void judge_like_reference(Judge& judge);
void judge_cross_checks(Judge& judge);
void judge_scans(Judge& judge);

}  // namespace platen
