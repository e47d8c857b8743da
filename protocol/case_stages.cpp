// The list of stages: which keys each kind takes.
#include <algorithm>
#include <array>
#include <map>

#include <fmt/format.h>

#include "protocol/case_sections.h"

namespace platen {
namespace {

constexpr std::array all_kinds{StageKind::fill,     StageKind::vibrate, StageKind::settle,
                               StageKind::compress, StageKind::unload,  StageKind::hold,
                               StageKind::release,  StageKind::crush,   StageKind::run};

constexpr double default_max_duration = 60.0;

// Goals in `until` that any plate-driven stage may have, and those of some kinds.
void read_drive_goals(TableReader& until, StageKind kind, Until& out) {
  if (kind == StageKind::unload) {
    until.quantity("stress", Quantity::stress, not_negative, Need::optional, out.stress);
    until.number("strain", {-infinite, 1.0, false, false}, Need::optional, out.strain);
  } else {
    until.quantity("stress", Quantity::stress, positive, Need::optional, out.stress);
    until.number("strain", fraction, Need::optional, out.strain);
  }
  if (kind == StageKind::compress) until.number("porosity", fraction, Need::optional, out.porosity);
  if (kind == StageKind::crush) until.number("drop", fraction, Need::optional, out.drop);
  until.quantity("displacement", Quantity::length, positive, Need::optional, out.displacement);
  until.quantity("duration", Quantity::time, positive, Need::optional, out.duration);
}

void read_settle_goals(TableReader& until, Until& out) {
  until.number("kinetic_to_potential", positive, Need::optional, out.kinetic_to_potential);
  until.number("coordination_change", not_negative, Need::optional, out.coordination_change);
  until.quantity("window", Quantity::time, positive, Need::optional, out.window);
}

// compress, unload, crush
void read_drive(TableReader& stage, const std::string& who, StageSpec& out) {
  stage.quantity("speed", Quantity::speed, positive, Need::required, out.speed);
  if (out.kind != StageKind::unload) {
    out.strain_zero = out.kind == StageKind::compress ? 5e3 : 20.0;
    out.own_strain_zero = stage.has("strain_zero");
    stage.quantity("strain_zero", Quantity::stress, not_negative, Need::optional, out.strain_zero);
    stage.quantity("start_gap", Quantity::length, not_negative, Need::optional, out.start_gap);
  }
  const bool given = stage.has("until");
  TableReader until = stage.table("until");
  read_drive_goals(until, out.kind, out.until);
  until.refuse_unknown("until of " + who);
  // Counted by what is written, so that a goal with a bad value is not reported as missing too.
  const bool any = until.has("stress") || until.has("strain") || until.has("porosity") || until.has("drop") ||
                   until.has("displacement") || until.has("duration");
  if (any || (given && !until.present())) return;
  if (out.kind == StageKind::unload) {
    out.until.stress = 0.0;
  } else {
    stage.error("until", fmt::format("is missing or empty, the stage can never end; allowed: {}",
                                     out.kind == StageKind::compress
                                         ? "until = { stress | strain | porosity | displacement | duration }"
                                         : "until = { strain | drop | stress | displacement | duration }"));
  }
}

void read_fill(TableReader& stage, StageSpec& out) {
  std::size_t method = 0;
  const bool method_good = stage.word("method", {"rain", "grow"}, Need::optional, method) || !stage.has("method");
  out.method = method == 0 ? FillMethod::rain : FillMethod::grow;
  // Keys of the other method are unknown here; with a bad method both are let through.
  if (!method_good || out.method == FillMethod::rain) {
    stage.quantity("drop_speed", Quantity::speed, not_negative, Need::optional, out.drop_speed);
    stage.quantity("duration", Quantity::time, positive, Need::optional, out.duration);
    stage.quantity("outlet", Quantity::length, positive, Need::optional, out.outlet);
    if (stage.has("outlet") && !stage.has("duration")) stage.error("outlet", "is given without duration; allowed: both, or neither, where all spheres fall at once");
    if (stage.has("duration") && out.drop_speed == 0.0) stage.error("drop_speed", "is 0, so that nothing would come out in any duration; allowed: > 0");
  }
  if (!method_good || out.method == FillMethod::grow) {
    stage.number("porosity", fraction, method_good ? Need::required : Need::optional, out.porosity);
  }
}

void read_vibrate(TableReader& stage, StageSpec& out) {
  const bool frequency = stage.quantity("frequency", Quantity::frequency, positive, Need::required, out.frequency);
  stage.quantity("amplitude", Quantity::length, positive, Need::required, out.amplitude);
  const bool duration = stage.quantity("duration", Quantity::time, positive, Need::required, out.duration);
  // A hair below 1 is rounding of the user's own arithmetic.
  if (frequency && duration && out.frequency * *out.duration < 1.0 - 1e-9) {
    stage.error("duration", fmt::format("holds {:.3g} of a period; allowed: frequency * duration >= 1",
                                        out.frequency * *out.duration));
  }
}

void read_run(TableReader& stage, const std::string& who, StageSpec& out) {
  stage.quantity("duration", Quantity::time, positive, Need::optional, out.duration);
  TableReader until = stage.table("until");
  until.quantity("duration", Quantity::time, positive, Need::optional, out.until.duration);
  until.refuse_unknown("until of " + who);
  if (stage.has("duration") && until.has("duration")) {
    stage.error("duration", "is given twice; allowed: duration or until = { duration }, not both");
  } else if (!stage.has("duration") && !until.has("duration")) {
    stage.error("duration",
                "is missing, the stage can never end; allowed: duration or until = { duration }, a time > 0");
  }
  if (out.until.duration) out.duration = out.until.duration;
  out.until.duration = out.duration;  // both places say the same
}

void read_by_kind(TableReader& stage, const std::string& who, StageSpec& out) {
  switch (out.kind) {
    case StageKind::fill:
      read_fill(stage, out);
      break;
    case StageKind::vibrate:
      read_vibrate(stage, out);
      break;
    case StageKind::settle:
    case StageKind::release: {
      TableReader until = stage.table("until");
      read_settle_goals(until, out.until);
      until.refuse_unknown("until of " + who);
      break;
    }
    case StageKind::compress:
    case StageKind::unload:
    case StageKind::crush:
      read_drive(stage, who, out);
      break;
    case StageKind::hold:
      stage.quantity("stress", Quantity::stress, positive, Need::required, out.stress);
      stage.quantity("duration", Quantity::time, positive, Need::required, out.duration);
      break;
    case StageKind::run:
      read_run(stage, who, out);
      break;
  }
}

// Names become names of groups in results.h5, cells of series.csv and parts of --set.
bool is_good_name(const std::string& name) {
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  return !name.empty() && name.size() <= 64 && letter(name.front()) && name.back() != ' ' &&
         std::all_of(name.begin(), name.end(),
                     [&](char c) { return letter(c) || (c >= '0' && c <= '9') || c == '-' || c == '_' || c == ' '; });
}

void read_stage(const CaseValue& value, const std::string& name, std::size_t number, Case& c, CaseFacts& facts,
                Problems& problems) {
  const std::string path = is_good_name(name) ? "stage." + name : fmt::format("stage.{}", number);
  StageSpec out;
  out.name = name;
  TableReader stage(&value, path, value.where, problems);
  std::vector<std::string> kinds;
  for (const StageKind kind : all_kinds) kinds.emplace_back(to_string(kind));
  std::size_t kind = 0;
  const bool kind_good = stage.word("kind", kinds, Need::required, kind);
  std::string written;
  if (stage.text("name", Need::optional, written) && !is_good_name(written)) {
    stage.error("name", "is not a good name; allowed: a letter, then letters, digits, spaces, - and _, at most 64, no space at the end");
  }
  facts.stage.push_back(stage.where("kind"));
  facts.stage_good.push_back(kind_good);
  facts.stage_path.push_back(path);
  if (kind_good) {
    out.kind = all_kinds[kind];
    const std::string who = fmt::format("a {} stage", kinds[kind]);
    const bool has_limit = stage.quantity("max_duration", Quantity::time, positive, Need::optional, out.max_duration);
    std::optional<double> frames;
    if (stage.quantity_or("frames", Quantity::time, positive, "off", frames)) out.frames = frames.value_or(0.0);
    read_by_kind(stage, who, out);
    const double wanted = std::max(out.duration.value_or(0.0), out.until.duration.value_or(0.0));
    const double to_land = out.kind == StageKind::fill ? 10.0 : 0.0;  // behind the last sphere of a rain
    if (!has_limit) out.max_duration = std::max(default_max_duration, 1.01 * wanted + to_land);
    stage.refuse_unknown(who);
  }
  c.stages.push_back(std::move(out));
}

}  // namespace

const char* to_string(StageKind kind) {
  switch (kind) {
    case StageKind::fill:
      return "fill";
    case StageKind::vibrate:
      return "vibrate";
    case StageKind::settle:
      return "settle";
    case StageKind::compress:
      return "compress";
    case StageKind::unload:
      return "unload";
    case StageKind::hold:
      return "hold";
    case StageKind::release:
      return "release";
    case StageKind::crush:
      return "crush";
    case StageKind::run:
      return "run";
  }
  return "";
}

void read_stages(const CaseEntry* entry, Case& c, CaseFacts& facts, Problems& problems) {
  if (entry == nullptr || (entry->value.type == CaseValue::Type::list && entry->value.items.empty())) {
    if (facts.use != CaseUse::law_only) {
      problems.add(entry == nullptr ? facts.file : entry->value.where, "stage",
                   "there are no stages; allowed: at least one [[stage]]");
    }
    return;
  }
  const CaseValue& list = entry->value;
  const bool tables = list.type == CaseValue::Type::list &&
                      std::all_of(list.items.begin(), list.items.end(),
                                  [](const CaseValue& item) { return item.type == CaseValue::Type::table; });
  if (!tables) {
    problems.add(entry->where, "stage",
                 fmt::format("is {}, wrong type; allowed: [[stage]] with double brackets, one "
                             "for each stage",
                             type_name(list.type)));
    facts.stage.clear();
    return;
  }
  const std::vector<std::string> names = stage_names(list);
  std::map<std::string, std::size_t> first;
  for (std::size_t i = 0; i < list.items.size(); ++i) {
    read_stage(list.items[i], names[i], i + 1, c, facts, problems);
    if (names[i].empty()) continue;
    const auto [place, fresh] = first.emplace(names[i], i);
    if (!fresh) {
      const CaseEntry* const name = list.items[i].find("name");
      problems.add(name == nullptr ? list.items[i].where : name->value.where, facts.stage_path[i] + ".name",
                   fmt::format("stage {} has the name \"{}\" of stage {}; allowed: each name once", i + 1, names[i],
                               place->second + 1));
    }
  }
}

}  // namespace platen
