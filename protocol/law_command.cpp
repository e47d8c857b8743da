#include "protocol/law_command.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string_view>

#include "core/law_constants.h"
#include "kernels/eepa.h"
#include "kernels/hertz_mindlin.h"
#include "kernels/real.h"
#include "protocol/case_file.h"
#include "protocol/experiment.h"
#include "protocol/output/files.h"
#include "protocol/units.h"

namespace platen {
namespace {

// Adhesion and plasticity are neutral where the case has none: the same bits as the narrower scene.
template <Exponent n>
constexpr SceneTraits full_scene{n, true, true, Rolling::none, true, false};

Branch branch_of(double s, double sp, const LawConstants& c) {
  // Eq. 2 in terms of s_p: k2 (s - s_p) >= k1 s and k2 (s - s_p) <= -k_adh s.
  if (sp <= c.sp_lower * s) return Branch::loading;
  return sp >= c.sp_upper * s ? Branch::adhesive : Branch::elastic;
}

template <Exponent n>
std::vector<LawRow> drive(const LawConstants& c, const std::vector<double>& overlaps) {
  std::vector<LawRow> rows;
  rows.reserve(overlaps.size());
  double sp = 0.0;
  for (const double delta : overlaps) {
    LawRow row;
    row.overlap = delta;
    if (delta > 0.0) {
      const double s = overlap_power<Scalar, n>(delta, c);
      row.branch = branch_of(s, sp, c);
      const NormalResponse<Scalar> normal = normal_response<Scalar, full_scene<n>>(s, sp, c);
      sp = normal.sp;
      row.f_hys = normal.f_hys;
      row.plastic_overlap = n == Exponent::one ? sp : power(sp, 1.0 / c.exponent);
      row.friction_limit = c.mu * std::fabs(normal.height);
    } else {
      sp = 0.0;  // the surfaces are like new
    }
    rows.push_back(row);
  }
  return rows;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view space = " \t\r\n\v\f";
  const auto first = text.find_first_not_of(space);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(space) - first + 1);
}

// A plain number, or one with a unit. Throws UnitError.
double overlap_of(std::string_view text) {
  std::string_view digits = text;
  if (digits.size() > 1 && digits.front() == '+' && digits[1] != '-') digits.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc{} && end == digits.data() + digits.size() && std::isfinite(value)) return value;
  return to_si(text, Quantity::length);
}

const char* name_of(Branch branch) {
  switch (branch) {
    case Branch::none: return "none";
    case Branch::loading: return "loading";
    case Branch::elastic: return "elastic";
    case Branch::adhesive: return "adhesive";
  }
  return "";
}

std::string read_overlap_text(const std::string& file) {
  if (file == "-") return std::string(std::istreambuf_iterator<char>(std::cin), std::istreambuf_iterator<char>());
  std::error_code error;
  std::ifstream in;
  if (!std::filesystem::is_directory(file, error)) in.open(file, std::ios::binary);
  if (!in.is_open()) {
    const bool there = std::filesystem::exists(file, error);
    throw CaseError(file + (there ? ": cannot be read" : ": does not exist") + "; allowed: a file of overlaps, or -");
  }
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (in.bad()) throw CaseError(file + ": cannot be read to its end; allowed: a file of overlaps, or -");
  return text;
}

}  // namespace

std::vector<LawRow> drive_pair(const PairLaw& law, const std::vector<double>& overlaps) {
  const LawConstants c = pair_constants(law);
  if (law.exponent == 1.0) return drive<Exponent::one>(c, overlaps);
  if (law.exponent == 1.5) return drive<Exponent::three_halves>(c, overlaps);
  return drive<Exponent::any>(c, overlaps);
}

std::vector<LawRow> drive_plate(const PlateLaw& law, double R, const std::vector<double>& overlaps) {
  const PlateConstants c = plate_constants(law);
  const Vec3<Scalar> still{0.0, 0.0, 0.0};
  std::vector<LawRow> rows;
  rows.reserve(overlaps.size());
  for (const double delta : overlaps) {
    LawRow row;
    row.overlap = delta;
    if (delta > 0.0) {
      // Quasi-static: no velocity, so the mass does not matter.
      row.f_hys = plate_response<Scalar, true>(delta, R, 1.0, 0.0, still, still, c).spring_force;
      row.friction_limit = c.mu * row.f_hys;
      row.branch = Branch::loading;
    }
    rows.push_back(row);
  }
  return rows;
}

std::vector<double> cycle_overlaps(const PairLaw& law, double delta_max) {
  const double n = law.exponent, top = 1.5 * delta_max;
  const double half_force = delta_max * std::pow(1.0 - law.k1 / (2.0 * law.k2), 1.0 / n);
  const double adhesive = top * std::pow((law.k2 - law.k1) / (law.k2 + law.k_adh), 1.0 / n);  // delta_min
  const double low = 0.3 * (adhesive > 0.0 ? adhesive : top);
  constexpr int points = 36;  // of a leg
  std::vector<double> path{0.0};
  for (const double turn : {delta_max, half_force, top, low, 0.75 * top, -0.02 * top}) {
    const double from = path.back();
    for (int k = 1; k < points; ++k) path.push_back(from + (turn - from) * k / points);
    path.push_back(turn);
  }
  return path;
}

std::vector<double> parse_overlaps(const std::string& text, const std::string& name) {
  std::vector<double> overlaps;
  std::string problems;
  int line_number = 0, found = 0;
  std::string_view rest = text;
  while (!rest.empty()) {
    const auto end = rest.find('\n');
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    ++line_number;
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    try {
      overlaps.push_back(overlap_of(line));
    } catch (const UnitError& error) {
      constexpr int most = 20;
      if (++found <= most)
        problems += fmt::format("{}{}:{}: {}; allowed: one overlap a line, in metres or with a unit (\"10 um\")",
                                problems.empty() ? "" : "\n", name, line_number, error.what());
      else if (found == most + 1)
        problems += fmt::format("\n{}: more bad lines follow", name);
    }
  }
  if (!problems.empty()) throw CaseError(problems);
  if (overlaps.empty()) throw CaseError(name + ": holds no overlap; allowed: one a line, in metres or with a unit");
  return overlaps;
}

std::string law_csv(const std::vector<LawRow>& rows) {
  std::string text = "overlap,f_hys,plastic_overlap,friction_limit,branch\n";
  for (const LawRow& row : rows)
    text += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g},{}\n", row.overlap, row.f_hys, row.plastic_overlap,
                        row.friction_limit, name_of(row.branch));
  return text;
}

int law_command(const LawCommand& command) {
  const Case c = read_case(command.case_file, command.overrides, CaseUse::law_only);
  // A file of particles is not read here, and of a distribution the largest sphere is taken.
  const double R = command.radius.value_or(c.particles.sizes.largest());
  if (command.plate && !(R > 0.0))
    throw CaseError(command.case_file.string() +
                    ": particles.radius: is missing, and the force at a plate depends on it; allowed: a radius in the "
                    "case, or --radius");
  constexpr double default_cycle = 1e-4;  // [m]
  const double delta_max = R > 0.0 ? 0.05 * R : default_cycle;
  PairLaw cycled = c.particles.law;
  if (command.plate) cycled.k1 = cycled.k2;  // nothing plastic: the path only has to go up and down
  const std::vector<double> overlaps =
      command.overlap_file.empty()
          ? cycle_overlaps(cycled, delta_max)
          : parse_overlaps(read_overlap_text(command.overlap_file),
                           command.overlap_file == "-" ? "standard input" : command.overlap_file);
  const std::string csv = law_csv(command.plate ? drive_plate(c.plates.law, R, overlaps)
                                                : drive_pair(c.particles.law, overlaps));
  if (command.output.empty())
    std::fwrite(csv.data(), 1, csv.size(), stdout);
  else
    write_whole_file(command.output, csv);
  return exit_done;
}

}  // namespace platen
