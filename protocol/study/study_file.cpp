#include "protocol/study/study_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "protocol/case_overrides.h"
#include "protocol/case_reader.h"
#include "protocol/output/files.h"
#include "protocol/study/observables.h"
#include "protocol/study/statements.h"

namespace platen {
namespace {

namespace fs = std::filesystem;

std::string quoted(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& w : words) out += (out.empty() ? "\"" : ", \"") + w + "\"";
  return out;
}

// A list of strings; one string counts as a list of one.
bool texts(TableReader& table, std::string_view key, std::vector<std::string>& out) {
  const CaseEntry* const entry = table.entry(key);
  if (entry == nullptr) return false;
  std::vector<std::string> found;
  const CaseValue& value = entry->value;
  if (value.type == CaseValue::Type::text)
    found.push_back(value.text);
  else if (value.type == CaseValue::Type::list)
    for (const CaseValue& item : value.items)
      if (item.type == CaseValue::Type::text) found.push_back(item.text);
  const bool whole =
      value.type == CaseValue::Type::text ||
      (value.type == CaseValue::Type::list && !value.items.empty() && found.size() == value.items.size());
  if (!whole) {
    table.error(key,
                fmt::format("is {}, wrong type; allowed: a string or a list of strings",
                            value.type == CaseValue::Type::list ? "not a list of strings" : type_name(value.type)));
    return false;
  }
  out = std::move(found);
  return true;
}

// As `texts`, of known words only.
bool words(TableReader& table, std::string_view key, const std::vector<std::string>& known,
           std::vector<std::string>& out) {
  std::vector<std::string> found;
  if (!texts(table, key, found)) return false;
  bool good = true;
  for (const std::string& word : found)
    if (std::find(known.begin(), known.end(), word) == known.end()) {
      const std::string near = nearest_word(word, known);
      table.error(key, fmt::format("\"{}\" is unknown; allowed: {}{}", word, quoted(known),
                                   near.empty() ? "" : "; nearest known word: " + near));
      good = false;
    }
  if (good) out = std::move(found);
  return good;
}

// A number or a list of them.
void powers(TableReader& table, std::string_view key, std::vector<double>& out) {
  const CaseEntry* const entry = table.entry(key);
  if (entry == nullptr) return;
  constexpr Range sensible{-10.0, 10.0};
  double one = 0.0;
  if (entry->value.type == CaseValue::Type::list)
    table.numbers(key, sensible, Need::optional, out);
  else if (table.number(key, sensible, Need::optional, one))
    out = {one};
}

// Names become names of files.
bool good_name(TableReader& table, std::string_view key, const std::string& name) {
  constexpr std::string_view forbidden = "/\\\"'`$\n\r\t,;";
  if (!name.empty() && name.front() != '.' && name.find_first_of(forbidden) == std::string::npos) return true;
  table.error(key, fmt::format("\"{}\" is not a usable name; allowed: a text without / \\ quotes $ , ; that does not "
                               "begin with a point",
                               name));
  return false;
}

void read_vary(TableReader& curve, std::vector<VariedKey>& out) {
  const CaseEntry* const entry = curve.entry("vary");
  if (entry == nullptr) return;
  if (entry->value.type != CaseValue::Type::table) {
    curve.error(
        "vary",
        fmt::format("is {}, wrong type; allowed: a table of lists, as {{ \"particles.law.friction\" = [0.3, 0.5] }}",
                    type_name(entry->value.type)));
    return;
  }
  for (const CaseEntry& varied : entry->value.entries) {
    if (varied.value.type != CaseValue::Type::list || varied.value.items.empty()) {
      curve.error("vary",
                  fmt::format("{} is not a list of values; allowed: keys of a case in quotes, each with a list, as "
                              "{{ \"particles.law.friction\" = [0.3, 0.5] }}",
                              varied.key));
      continue;
    }
    VariedKey key{varied.key, {}};
    for (const CaseValue& value : varied.value.items) key.values.push_back(to_toml_value(value));
    out.push_back(std::move(key));
  }
}

CurveSpec read_curve(TableReader& table) {
  CurveSpec curve;
  curve.where = table.where("");
  if (table.text("name", Need::required, curve.name)) good_name(table, "name", curve.name);
  double radius = 0.0;
  if (table.has("radius") && table.has("radii")) table.error("radii", "is given beside radius; allowed: one of them");
  if (table.quantity("radius", Quantity::length, positive, Need::optional, radius)) curve.radii = {radius};
  table.quantities("radii", Quantity::length, positive, Need::optional, curve.radii);
  powers(table, "stiffness", curve.stiffness);
  powers(table, "adhesion", curve.adhesion);
  powers(table, "time_step", curve.time_step);
  table.number("dashpots", Range{-10.0, 10.0}, Need::optional, curve.dashpots);
  read_vary(table, curve.vary);
  texts(table, "set", curve.set);
  table.text("against", Need::optional, curve.against);
  table.refuse_unknown("a curve");
  return curve;
}

// Calls `read` for each table of the list `key`.
template <class Read>
void tables(TableReader& root, std::string_view key, Problems& problems, Read&& read) {
  const CaseEntry* const entry = root.entry(key);
  if (entry == nullptr) return;
  if (entry->value.type != CaseValue::Type::list) {
    root.error(key, fmt::format("is {}, wrong type; allowed: tables [[{}]]", type_name(entry->value.type), key));
    return;
  }
  for (const CaseValue& item : entry->value.items) {
    if (item.type != CaseValue::Type::table) {
      problems.add(item.where, std::string(key),
                   fmt::format("is {}, wrong type; allowed: a table [[{}]]", type_name(item.type), key));
      continue;
    }
    TableReader table(&item, std::string(key), item.where, problems);
    read(table);
  }
}

void read_seeds(TableReader& table, std::vector<std::uint64_t>& out) {
  const CaseEntry* const entry = table.entry("seeds");
  if (entry == nullptr) return;
  std::vector<std::uint64_t> seeds;
  bool good = entry->value.type == CaseValue::Type::list && !entry->value.items.empty();
  for (const CaseValue& item : entry->value.items) {
    good = good && item.type == CaseValue::Type::integer && item.integer >= 0;
    seeds.push_back(static_cast<std::uint64_t>(item.integer));
  }
  if (!good || std::set<std::uint64_t>(seeds.begin(), seeds.end()).size() != seeds.size()) {
    table.error("seeds", "is not a list of different seeds; allowed: whole numbers >= 0, as [1, 2, 3]");
    return;
  }
  out = std::move(seeds);
}

void read_match(TableReader match, std::optional<PorosityMatch>& out) {
  if (!match.present()) return;
  PorosityMatch found;
  found.where = match.where("");
  match.number("tolerance", Range{0.0, 0.1, false, true}, Need::required, found.tolerance);
  std::size_t adjust = 0;
  const bool known = match.word("adjust", {"vibration", "growth"}, Need::required, adjust);
  found.adjust = adjust == 0 ? PorosityMatch::Adjust::vibration : PorosityMatch::Adjust::growth;
  std::vector<double> range;
  if (!known)
    match.has("range");  // what it means is not known
  else if (adjust == 0 ? match.quantities("range", Quantity::time, positive, Need::optional, range)
                       : match.numbers("range", fraction, Need::optional, range)) {
    if (range.size() == 2 && range[0] < range[1])
      found.range = {range[0], range[1]};
    else
      match.error("range", std::string("is not a range; allowed: the least and the largest ") +
                               (adjust == 0 ? "duration of the vibration, as [\"0.1 s\", \"8 s\"]" : "porosity of the growth, as [0.38, 0.45]"));
  }
  std::int64_t most_tries = found.most_tries;
  match.integer("most_tries", 1, 1000, Need::optional, most_tries);
  found.most_tries = static_cast<int>(most_tries);
  match.refuse_unknown("match_porosity");
  out = found;
}

// What has a meaning only where there are runs of its own.
void read_own(TableReader& root, TableReader& head, Study& study, Problems& problems) {
  std::string base;
  if (head.text("base", Need::required, base)) {
    study.base_where = head.where("base");
    study.base = study.file.parent_path() / base;
    std::error_code ignored;
    if (base.empty() || !fs::is_regular_file(study.base, ignored))
      head.error(
          "base",
          fmt::format("the base case \"{}\" does not exist ({}); allowed: a case file, relative to the study file",
                      base, study.base.lexically_normal().string()));
  }
  head.quantity("reference_radius", Quantity::length, positive, Need::optional, study.reference_radius);
  texts(head, "set", study.set);
  for (const ObservableKind& kind : observable_kinds()) study.observables.push_back(kind.name);
  const std::vector<std::string> known = study.observables;
  words(head, "observables", known, study.observables);
  head.quantity("strain_zero", Quantity::stress, positive, Need::optional, study.strain_zero);
  words(head, "statements", statement_groups(), study.statements);
  head.flag("timed", study.timed);
  std::int64_t repeats = 1, threads = 1;
  if (head.integer("repeats", 1, 1000, Need::optional, repeats) && !study.timed && repeats > 1)
    head.error("repeats", "only timed runs are repeated; allowed: with timed = true");
  head.integer("threads", 1, 4096, Need::optional, threads);
  study.repeats = static_cast<int>(repeats);
  study.threads = static_cast<int>(threads);
  read_match(head.table("match_porosity"), study.match_porosity);
  if (study.match_porosity && study.timed)
    head.error("match_porosity", "samples of timed runs are not matched; allowed: without timed = true");

  std::vector<std::string> names;
  tables(root, "curve", problems, [&](TableReader& table) {
    study.curves.push_back(read_curve(table));
    const std::string& name = study.curves.back().name;
    if (std::find(names.begin(), names.end(), name) != names.end())
      table.error("name", fmt::format("\"{}\" is there already; allowed: a name for each curve of its own", name));
    names.push_back(name);
  });
  if (study.curves.empty())
    root.error("curve", "is missing; allowed: at least one [[curve]], the first is the reference");
  for (std::size_t k = 0; k < study.curves.size(); ++k)
    if (!study.curves[k].against.empty() &&
        std::find(names.begin(), names.end(), study.curves[k].against) == names.end()) {
      const std::string near = nearest_word(study.curves[k].against, names);
      problems.add(study.curves[k].where, "curve.against",
                   fmt::format("there is no curve \"{}\"; allowed: {}{}", study.curves[k].against, quoted(names),
                               near.empty() ? "" : "; nearest known word: " + near));
    }
  std::set<std::string> figure_names;
  tables(root, "figure", problems, [&](TableReader& table) {
    FigureSpec figure;
    if (table.text("name", Need::required, figure.name) && good_name(table, "name", figure.name) &&
        !figure_names.insert(figure.name).second)
      table.error("name",
                  fmt::format("\"{}\" is there already; allowed: a name for each figure of its own", figure.name));
    table.text("title", Need::optional, figure.title);
    if (!table.has("observables")) table.error("observables", "is missing; allowed: " + quoted(known));
    words(table, "observables", known, figure.observables);
    const bool mixed = std::any_of(figure.observables.begin(), figure.observables.end(), [&](const std::string& o) {
      return observable_kind(o).y_label != observable_kind(figure.observables.front()).y_label;
    });
    if (mixed)
      table.error("observables", "have different axes; allowed: one observable, or its loading and unloading branch");
    words(table, "curves", names, figure.curves);
    table.refuse_unknown("a figure");
    study.figures.push_back(std::move(figure));
  });
  tables(root, "scan", problems, [&](TableReader& table) {
    ScanSpec scan;
    std::size_t power = 0;
    table.word("power", {"stiffness", "adhesion"}, Need::required, power);
    scan.where = table.where("");
    scan.power = power == 0 ? ScanSpec::Power::stiffness : ScanSpec::Power::adhesion;
    words(table, "curves", names, scan.curves);
    words(table, "observables", known, scan.observables);
    table.refuse_unknown("a scan");
    study.scans.push_back(std::move(scan));
  });
}

Study read_one(const fs::path& file, const std::vector<std::string>& overrides, bool may_include,
               const std::optional<std::vector<std::uint64_t>>& seeds, Problems& problems) {
  Study study;
  study.file = file;
  study.name = file.stem().string();
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) throw CaseError(file.string() + ": does not exist; allowed: a study file");
  study.text = read_whole_file(file);
  CaseValue document = parse_document(study.text, file.string());
  for (const std::string& text : overrides) apply_override(document, text, problems);
  if (!overrides.empty()) study.text = to_toml(document);
  TableReader root(&document, "", {file.string(), 1, 1}, problems);
  TableReader head = root.table("study", Need::required);
  head.text("title", Need::optional, study.title);
  const bool own_seeds = head.has("seeds");
  read_seeds(head, study.seeds);
  std::vector<std::string> included;
  if (head.has("include") && !may_include)
    head.error("include", "an included study includes others; allowed: one level");
  if (may_include && texts(head, "include", included)) {
    for (const std::string& name : included) {
      const fs::path path = file.parent_path() / name;
      if (!fs::is_regular_file(path, ignored)) {
        head.error("include",
                   fmt::format("the study \"{}\" does not exist ({}); allowed: study files, relative to this one", name,
                               path.lexically_normal().string()));
        continue;
      }
      std::optional<std::vector<std::uint64_t>> given;
      if (own_seeds) given = study.seeds;
      Study part = read_one(path, {}, false, given, problems);
      for (const Study& other : study.parts)
        if (other.name == part.name)
          head.error("include", fmt::format("\"{}\" is there twice; allowed: studies with different names", part.name));
      study.parts.push_back(std::move(part));
    }
    head.refuse_unknown("a study that includes others");
    root.refuse_unknown("a study that includes others");
    return study;
  }
  if (head.present())
    read_own(root, head, study, problems);
  else
    for (const char* key : {"curve", "figure", "scan"}) root.has(key);
  // Run times need repetitions, not other beds: a timed part keeps its own.
  if (seeds && !study.timed) study.seeds = *seeds;
  head.refuse_unknown("study");
  root.refuse_unknown("a study");
  return study;
}

}  // namespace

Study read_study(const fs::path& file, const std::vector<std::string>& overrides) {
  Problems problems;
  Study study = read_one(file, overrides, true, std::nullopt, problems);
  if (!problems.empty()) throw CaseError(problems.text());
  return study;
}

}  // namespace platen
