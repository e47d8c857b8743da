#include "protocol/case_overrides.h"

#include <charconv>
#include <optional>

#include <fmt/format.h>

#include "protocol/case_file.h"

namespace platen {
namespace {

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\r\n");
  if (begin == std::string::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r\n") - begin + 1);
}

void place(CaseValue& value, const Position& where) {
  value.where = where;
  for (CaseValue& item : value.items) place(item, where);
  for (CaseEntry& entry : value.entries) {
    entry.where = where;
    place(entry.value, where);
  }
}

// The single value of a TOML text `value = ...`, or nothing if it is not one.
std::optional<CaseValue> single_value(const std::string& toml) {
  try {
    CaseValue root = parse_document("value = " + toml, "");
    if (root.entries.size() != 1 || root.entries.front().key != "value") return std::nullopt;
    return std::move(root.entries.front().value);
  } catch (const CaseError&) {
    return std::nullopt;
  }
}

std::optional<CaseValue> read_value(const std::string& text) {
  if (std::optional<CaseValue> value = single_value(text)) return value;
  CaseValue guess;
  guess.type = CaseValue::Type::text;
  guess.text = text;
  // Through the parser once more: it refuses what is not UTF-8.
  std::optional<CaseValue> value = single_value(to_toml_value(guess));
  if (value) value->guessed = true;
  return value;
}

std::string known_stages(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i) out += fmt::format("{}{} {}", i == 0 ? "" : ", ", i + 1, names[i]);
  return out.empty() ? "none" : out;
}

CaseValue* find_stage(CaseValue& root, const std::string& word, const Position& where, Problems& problems) {
  CaseEntry* const list = root.find("stage");
  if (list == nullptr || list->value.type != CaseValue::Type::list) {
    problems.add(where, "stage", "the case has no [[stage]]; allowed: keys of the tables that it has");
    return nullptr;
  }
  const std::vector<std::string> names = stage_names(list->value);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == word) return &list->value.items[i];
  }
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error == std::errc() && end == word.data() + word.size() && number >= 1 && number <= names.size()) {
    return &list->value.items[number - 1];
  }
  const std::string near = nearest_word(word, names);
  problems.add(where, "stage." + word,
               fmt::format("there is no such stage; allowed: {}{}", known_stages(names),
                           near.empty() ? "" : "; nearest known stage: " + near));
  return nullptr;
}

}  // namespace

void apply_override(CaseValue& root, const std::string& override_text, Problems& problems) {
  const Position where{"--set " + override_text, 0, 0};
  const std::size_t equals = override_text.find('=');
  if (equals == std::string::npos) {
    problems.add(where, "", "there is no value; allowed: KEY.PATH=VALUE, as time.step=1e-5");
    return;
  }
  std::vector<std::string> path(1);
  for (const char c : override_text.substr(0, equals)) {
    if (c == '.')
      path.emplace_back();
    else
      path.back() += c;
  }
  for (std::string& part : path) {
    part = trimmed(part);
    if (part.empty()) {
      problems.add(where, "", "the key is empty; allowed: KEY.PATH=VALUE, as time.step=1e-5");
      return;
    }
  }
  const std::string value_text = trimmed(override_text.substr(equals + 1));
  if (value_text.empty()) {
    problems.add(where, "", "there is no value; allowed: KEY.PATH=VALUE, as time.step=1e-5");
    return;
  }
  std::optional<CaseValue> value = read_value(value_text);
  if (!value) {
    problems.add(where, "", "the value is not UTF-8 text; allowed: a TOML value");
    return;
  }
  place(*value, where);

  CaseValue* table = &root;
  std::size_t next = 0;
  if (path[0] == "stage" && path.size() > 1) {
    table = find_stage(root, path[1], where, problems);
    if (table == nullptr) return;
    if (path.size() == 2) {
      problems.add(where, "stage." + path[1], "is a whole stage; allowed: one of its keys, as stage.compress.speed");
      return;
    }
    next = 2;
  }
  for (; next + 1 < path.size(); ++next) {
    if (table->find(path[next]) == nullptr) {
      CaseValue made;
      made.where = where;
      table->entries.push_back({path[next], where, std::move(made)});
    }
    table = &table->find(path[next])->value;
    if (table->type != CaseValue::Type::table) break;
  }
  if (table->type != CaseValue::Type::table) {
    path.resize(next + 1);
    problems.add(where, fmt::format("{}", fmt::join(path, ".")),
                 fmt::format("is {} and has no keys; allowed: set it as a whole", type_name(table->type)));
    return;
  }
  if (CaseEntry* const old = table->find(path.back())) {
    old->where = where;
    old->value = std::move(*value);
  } else {
    table->entries.push_back({path.back(), where, std::move(*value)});
  }
}

}  // namespace platen
