#include "protocol/study/plan.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <stdexcept>
#include <tuple>

#include "core/simulation.h"
#include "protocol/case_document.h"
#include "protocol/case_reader.h"
#include "protocol/expected_time.h"
#include "protocol/experiment.h"
#include "protocol/study/porosity_match.h"

namespace platen {
namespace {

// A text as part of a folder's name.
std::string path_part(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
                       c == '-' || c == '+' || c == '=' || c == '_';
    if (plain) out += c;
  }
  return out;
}

std::string last_key(const std::string& path) { return path.substr(path.rfind('.') + 1); }

// A key as a part of a folder's name: enough of it that two keys with the same ending never share a name, which would then depend on the
// order of the curves.
std::string folder_key(const std::string& key) {
  if (key.starts_with("particles.law.")) return last_key(key);
  const std::size_t last = key.rfind('.'), before = last == std::string::npos || last == 0 ? std::string::npos : key.rfind('.', last - 1);
  return before == std::string::npos ? key : key.substr(before + 1);
}

std::string plain_value(std::string toml) {
  std::erase(toml, '"');
  return toml;
}

// File systems take names of 255 bytes. A long one ends in a hash of all of it, so that it stays one case's, whatever else is planned.
std::string short_enough(const std::string& name) {
  constexpr std::size_t most = 200, kept = 160;
  return name.size() <= most ? name : name.substr(0, kept) + fmt::format("-{:016x}", XXH3_64bits(name.data(), name.size()));
}

std::string radius_text(double R) { return fmt::format("{:g} mm", 1e3 * R); }

class Planner {
 public:
  explicit Planner(StudyPlan& plan) : plan_(plan) {}

  void add_part(const Study& study) {
    PlannedPart part;
    part.study = &study;
    try {
      part.base = read_case(study.base, study.set);
    } catch (const CaseError& error) {
      problem(study.base_where, "study.base", std::string("the base case is wrong:\n") + error.what());
      return;
    }
    const SizeDistribution& sizes = part.base.particles.sizes;
    if (study.reference_radius)
      part.reference_radius = *study.reference_radius;
    else if (sizes.kind == SizeDistribution::Kind::mono && sizes.radius > 0.0)
      part.reference_radius = sizes.radius;
    else {
      problem(study.base_where, "study.reference_radius",
              "is missing; allowed: the radius that the base case of a size "
              "distribution or of a particle file stands for");
      return;
    }
    if (study.reference_radius && sizes.kind == SizeDistribution::Kind::mono &&
        sizes.radius != *study.reference_radius) {
      problem(study.base_where, "study.reference_radius",
              fmt::format("is {}, but the base case has spheres of {}; allowed: leave it out, or the same",
                          radius_text(*study.reference_radius), radius_text(sizes.radius)));
      return;
    }
    if (study.match_porosity) try {
        knob_of(*study.match_porosity, part.base);
      } catch (const CaseError& error) {
        problem(study.match_porosity->where, "study.match_porosity", std::string("does not fit the base case: ") + error.what());
        return;
      }
    for (const CurveSpec& spec : study.curves) add_block(part, spec);
    std::set<std::string> labels;
    for (const PlannedCurve& curve : part.curves)
      if (!labels.insert(curve.label).second)
        problem(spec_of(part, curve).where, "curve", fmt::format("there are two curves \"{}\"; allowed: values that differ, in the digits shown too", curve.label));
    if (labels.size() < part.curves.size()) return;
    scans_have_powers(part);
    find_references(part);
    std::vector<std::size_t> order(part.curves.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    if (study.match_porosity) {
      if (!references_are_not_matched(part)) return;
      std::stable_partition(order.begin(), order.end(), [&](std::size_t k) { return part.curves[k].reference == k; });
    }
    for (const std::size_t k : order) add_jobs(part, k);
    plan_.parts.push_back(std::move(part));
  }

  void finish() const {
    if (!problems_.empty()) throw CaseError(problems_.text());
  }

 private:
  void problem(const Position& where, const std::string& key, const std::string& what) {
    problems_.add(where, key, what);
  }

  void add_block(PlannedPart& part, const CurveSpec& spec) {
    const std::vector<double> radii = spec.radii.empty() ? std::vector{part.reference_radius} : spec.radii;
    std::vector<std::map<std::string, std::string>> variants(1);
    for (const VariedKey& key : spec.vary) {
      std::vector<std::map<std::string, std::string>> more;
      for (const auto& variant : variants)
        for (const std::string& value : key.values) {
          more.push_back(variant);
          more.back()[key.key] = value;
        }
      variants = std::move(more);
    }
    for (const double R : radii)
      for (const double a : spec.stiffness)
        for (const double b : spec.adhesion)
          for (const double c : spec.time_step)
            for (const auto& variant : variants) {
              PlannedCurve curve;
              curve.block = spec.name;
              curve.radius = R;
              curve.powers = {a, b, spec.dashpots, c};
              curve.varied = variant;
              curve.label = spec.name;
              if (radii.size() > 1) curve.label += " R=" + radius_text(R);
              if (spec.stiffness.size() > 1) curve.label += fmt::format(" a={:g}", a);
              if (spec.adhesion.size() > 1) curve.label += fmt::format(" b={:g}", b);
              if (spec.time_step.size() > 1) curve.label += fmt::format(" dt~R^{:g}", c);
              std::string varied;
              for (const VariedKey& key : spec.vary)
                if (key.values.size() > 1)
                  varied += fmt::format("{}{}={}", varied.empty() ? "" : " ", last_key(key.key), plain_value(variant.at(key.key)));
              // A curve named after what it varies is called "f0=-0.3", not "f0 f0=-0.3".
              const bool named = curve.label == spec.name && varied.starts_with(spec.name + "=");
              if (!varied.empty()) curve.label = named ? varied : curve.label + " " + varied;
              part.curves.push_back(std::move(curve));
            }
  }

  // At least three powers of the same size, else there is no minimum to look for.
  void scans_have_powers(const PlannedPart& part) {
    for (const ScanSpec& scan : part.study->scans) {
      const bool stiffness = scan.power == ScanSpec::Power::stiffness;
      std::map<std::tuple<double, double, std::map<std::string, std::string>>, std::set<double>> powers;
      std::size_t most = 0;
      for (const PlannedCurve& curve : part.curves) {
        if (curve.radius == part.reference_radius || (!scan.curves.empty() && std::find(scan.curves.begin(), scan.curves.end(), curve.block) == scan.curves.end())) continue;
        auto& own = powers[{curve.radius, stiffness ? curve.powers.adhesion : curve.powers.stiffness, curve.varied}];
        own.insert(stiffness ? curve.powers.stiffness : curve.powers.adhesion);
        most = std::max(most, own.size());
      }
      if (most < 3)
        problem(scan.where, "scan.power", fmt::format("has {} values of the {} power at one size; allowed: at least three, at another radius than the reference's", most, stiffness ? "stiffness" : "adhesion"));
    }
  }

  // A chain of matches would add up their tolerances.
  bool references_are_not_matched(const PlannedPart& part) {
    for (const PlannedCurve& curve : part.curves) {
      const PlannedCurve& reference = part.curves[curve.reference];
      if (&part.curves[reference.reference] == &reference) continue;
      problem(spec_of(part, curve).where, "curve.against",
              fmt::format("\"{}\" is compared with \"{}\", which is compared with another curve; allowed with match_porosity: "
                          "a curve that is compared with itself",
                          curve.label, reference.label));
      return false;
    }
    return true;
  }

  static const CurveSpec& spec_of(const PlannedPart& part, const PlannedCurve& curve) {
    return *std::find_if(part.study->curves.begin(), part.study->curves.end(),
                         [&](const CurveSpec& s) { return s.name == curve.block; });
  }

  void add_jobs(PlannedPart& part, std::size_t number) {
    PlannedCurve& curve = part.curves[number];
    const Study& study = *part.study;
    const CurveSpec& spec = spec_of(part, curve);
    std::vector<std::string> changes = study.set;
    changes.insert(changes.end(), spec.set.begin(), spec.set.end());
    for (const auto& [key, value] : curve.varied) changes.push_back(key + "=" + value);
    for (const std::uint64_t seed : study.seeds) try {
        const double lambda = curve.radius / part.reference_radius;
        std::vector<std::string> all = changes;
        const Case unscaled = read_case(study.base, all);
        for (std::string& change : scaling_overrides(unscaled, curve.powers, lambda)) all.push_back(std::move(change));
        all.push_back("case.seed=" + std::to_string(seed));
        // A default that another version changes makes it another run.
        if (!unscaled.time.step) all.push_back(fmt::format("time.safety={}", unscaled.time.safety));
        if (!unscaled.particles.file.empty())  // the case moves to another folder
          all.push_back("particles.file=\"" +
                        std::filesystem::absolute(study.base.parent_path() / unscaled.particles.file).string() + "\"");
        Case c = read_case(study.base, all);
        // Without the comments on overrides: how a case came about must not make it another run.
        const std::string text = to_toml(parse_document(c.text, "case.toml"));
        c = parse_case(text, study.base.string(), {}, {});
        refuse_unstable_step(c);
        std::optional<std::size_t> matched_to;
        if (study.match_porosity && curve.reference != number) {
          const std::vector<std::size_t>& references = part.curves[curve.reference].jobs;
          if (references.size() <= curve.jobs.size()) return;  // the reference is wrong and has been reported
          knob_of(*study.match_porosity, c);
          matched_to = references[curve.jobs.size()];
        }
        for (int repeat = 1; repeat <= study.repeats; ++repeat) {
          curve.seeds.push_back(seed);
          curve.jobs.push_back(job(part, spec, curve, c, seed, study.timed ? repeat : 0, matched_to));
        }
      } catch (const CaseError& error) {
        problem(spec.where, "curve", fmt::format("\"{}\" is not a possible case:\n{}", curve.label, error.what()));
        return;  // the other seeds would say the same
      } catch (const std::domain_error& error) {
        problem(spec.where, "curve", fmt::format("\"{}\" is not a possible case: {}", curve.label, error.what()));
        return;
      }
  }

  // The job of this case; a new one only if no other curve needs it. repeat 0: not timed.
  std::size_t job(const PlannedPart& part, const CurveSpec& spec, const PlannedCurve& curve, const Case& c,
                  std::uint64_t seed, int repeat, std::optional<std::size_t> matched_to) {
    const Study& study = *part.study;
    if (matched_to && plan_.jobs[*matched_to].c.text == c.text) return *matched_to;  // the reference itself, under another name
    std::string identity = c.text + fmt::format("\n#{} {}", repeat, repeat > 0 ? study.name + study.base.string() : "");
    if (matched_to) {
      const PorosityMatch& m = *study.match_porosity;
      const auto [low, high] = m.range.value_or(std::pair(0.0, 0.0));
      identity += fmt::format("\n#matched {} {} {} {} {} {}", *matched_to, static_cast<int>(m.adjust), m.tolerance, low, high, m.most_tries);
    }
    if (const auto known = known_.find(identity); known != known_.end()) return known->second;
    std::string name = (repeat > 0 ? "timed-" : "") + path_part(study.base.stem().string()) +
                       fmt::format("-R{:g}mm", 1e3 * curve.radius);
    const bool scaled = curve.radius != part.reference_radius;
    if (scaled) name += fmt::format("-a{:g}-b{:g}", curve.powers.stiffness, curve.powers.adhesion);
    if (scaled && curve.powers.time_step != 0.0) name += fmt::format("-dt{:g}", curve.powers.time_step);
    for (const auto& [key, value] : curve.varied) name += "-" + path_part(folder_key(key) + "=" + plain_value(value));
    for (const std::string& text : spec.set)
      name += "-" + path_part(folder_key(text.substr(0, text.find('='))) + "=" + plain_value(text.substr(text.find('=') + 1)));
    name = short_enough(name);
    if (matched_to) name += "-matched";
    name += fmt::format("-s{}", seed);
    if (repeat > 0) name += fmt::format("-t{}", repeat);
    std::string unique = name;
    for (int k = 2; !names_.insert(unique).second; ++k) unique = fmt::format("{}-{}", name, k);
    Job added;
    added.name = unique;
    added.c = c;
    if (matched_to) added.match = JobMatch{&*study.match_porosity, *matched_to, c};
    added.weight = expected_particle_steps(c);
    added.timed = repeat > 0;
    added.threads = study.threads;
    plan_.jobs.push_back(std::move(added));
    return known_[identity] = plan_.jobs.size() - 1;
  }

  // The member of the reference's block that agrees in every varied key that both have.
  void find_references(PlannedPart& part) {
    for (PlannedCurve& curve : part.curves) {
      const CurveSpec& spec = spec_of(part, curve);
      const std::string& wanted = spec.against.empty() ? part.study->curves.front().name : spec.against;
      std::vector<std::size_t> found;
      for (std::size_t k = 0; k < part.curves.size(); ++k) {
        const PlannedCurve& other = part.curves[k];
        const bool agrees = std::all_of(other.varied.begin(), other.varied.end(), [&](const auto& entry) {
          const auto own = curve.varied.find(entry.first);
          return own == curve.varied.end() || own->second == entry.second;
        });
        if (other.block == wanted && agrees) found.push_back(k);
      }
      const bool several = std::any_of(found.begin(), found.end(), [&](std::size_t k) { return part.curves[k].varied != part.curves[found.front()].varied; });
      if (several) {
        problem(spec.where, "curve.against", fmt::format("\"{}\" varies keys that \"{}\" does not, so that several of its members would do; allowed: a block that varies the same keys, or none", wanted, curve.label));
      } else if (!found.empty()) {
        curve.reference = found.front();
      } else if (std::any_of(part.curves.begin(), part.curves.end(), [&](const PlannedCurve& other) { return other.block == wanted; })) {
        problem(spec.where, "curve.against", fmt::format("\"{}\" has no member with the varied values of \"{}\"; allowed: a block that varies these keys over the same values, written alike, or not at all", wanted, curve.label));
      }  // else the block itself was wrong and has been reported
    }
  }

  StudyPlan& plan_;
  Problems problems_;
  std::map<std::string, std::size_t> known_;
  std::set<std::string> names_;
};

}  // namespace

StudyPlan make_plan(const Study& study) {
  StudyPlan plan;
  plan.study = &study;
  Planner planner(plan);
  if (study.parts.empty()) planner.add_part(study);
  for (const Study& part : study.parts) planner.add_part(part);
  planner.finish();
  return plan;
}

}  // namespace platen
