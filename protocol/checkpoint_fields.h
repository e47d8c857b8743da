// The state of the experiment as JSON: every struct that outlives a check of the stages names its fields here once, for
// writing and for reading.
#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "core/plates.h"
#include "protocol/records.h"
#include "protocol/stages.h"

namespace platen::fields {

using Json = nlohmann::json;

// Visits a struct's fields: visit("name", member). One function a struct, for const and mutable alike.
template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, Ledger>
void each(V& v, T& l) {
  v("elastic", l.elastic_energy), v("adhesion", l.adhesion_energy), v("tangential", l.tangential_energy), v("plate", l.plate_energy);
  v("plastic", l.plastic_dissipation), v("viscous", l.viscous_dissipation), v("sliding", l.sliding_dissipation), v("rolling", l.rolling_dissipation);
  v("model", l.plate_model_work), v("work", l.plate_work), v("inserted", l.inserted_energy), v("removed", l.removed_energy);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, Measures>
void each(V& v, T& m) {
  v("step", m.step), v("time", m.time), v("height", m.height), v("stress_top", m.stress_top), v("stress_bottom", m.stress_bottom);
  v("porosity", m.porosity), v("coordination_number", m.coordination_number), v("contacts", m.contacts);
  v("kinetic_energy", m.kinetic_energy), v("potential_energy", m.potential_energy), v("support_force", m.support_force), v("weight", m.weight);
  v("energy_residual", m.energy_residual), v("highest_point", m.highest_point), v("farthest", m.farthest), v("fastest_spin", m.fastest_spin);
  v("deepest_overlap", m.deepest_overlap), v("top_touches", m.top_touches), v("ledger", m.ledger);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, SeriesRow>
void each(V& v, T& r) {
  v("stage", r.stage), v("strain", r.strain), v("inertial_number", r.inertial_number), v("kinetic_to_potential", r.kinetic_to_potential), v("measures", r.measures);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, StepRange>
void each(V& v, T& r) {
  v("smallest", r.smallest), v("largest", r.largest), v("dt_crit", r.dt_crit), v("dt_limit", r.dt_limit), v("largest_share", r.largest_share), v("ruled_by", r.ruled_by);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, BedStress>
void each(V& v, T& b) {
  v("stress", b.stress), v("fabric", b.fabric), v("principal", b.principal), v("principal_direction", b.principal_direction), v("pressure", b.pressure);
  v("deviator", b.deviator), v("fabric_deviator", b.fabric_deviator), v("mean_overlap", b.mean_overlap), v("largest_overlap", b.largest_overlap), v("volume", b.volume), v("pairs", b.pairs);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, StageResult>
void each(V& v, T& s) {
  v("name", s.name), v("kind", s.kind), v("end_reason", s.end_reason), v("reached", s.reached), v("first_step", s.first_step), v("last_step", s.last_step);
  v("time_begin", s.time_begin), v("time_end", s.time_end), v("wall_seconds", s.wall_seconds), v("particles", s.particles);
  v("strain_zero_height", s.strain_zero_height), v("strength", s.strength), v("strength_strain", s.strength_strain);
  v("initial_stiffness", s.initial_stiffness), v("peak_found", s.peak_found), v("time_step", s.time_step), v("residual_share", s.residual_share);
  v("bed", s.bed), v("warnings", s.warnings), v("last", s.last);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, PlaneMotion>
void each(V& v, T& p) {
  v("present", p.present), v("origin", p.origin), v("velocity", p.velocity), v("amplitude", p.amplitude), v("frequency", p.frequency), v("vibrated", p.vibrated);
  v("vibration_end", p.vibration_end), v("start", p.start), v("dt", p.dt);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, RestWatch::Sample>
void each(V& v, T& s) {
  v("time", s.time), v("coordination_number", s.coordination_number), v("quiet", s.quiet);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, RestWatch>
void each(V& v, T& r) {
  v("samples", r.samples), v("kinetic_at_start", r.kinetic_at_start), v("from_rest", r.from_rest);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, CrushStage::Point>
void each(V& v, T& p) {
  v("time", p.time), v("strain", p.strain), v("stress", p.stress);
}

// Stages; those without memory have no fields.
template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, VibrateStage> || std::is_same_v<std::remove_const_t<T>, RunStage>
void each(V&, T&) {}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, FillStage>
void each(V& v, T& s) {
  v("landed_since", s.landed_since);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, SettleStage>
void each(V& v, T& s) {
  v("rest", s.rest);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, ReleaseStage>
void each(V& v, T& s) {
  v("rest", s.rest), v("height_before", s.height_before);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, PressStage>
void each(V& v, T& s) {
  v("direction", s.direction), v("start_position", s.start_position);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, HoldStage>
void each(V& v, T& s) {
  v("modulus", s.modulus), v("window_begin", s.window_begin), v("stress_sum", s.stress_sum), v("height_sum", s.height_sum), v("looks", s.looks);
  v("stress_before", s.stress_before), v("height_before", s.height_before);
}

template <class V, class T>
  requires std::is_same_v<std::remove_const_t<T>, CrushStage>
void each(V& v, T& s) {
  v("press", s.press), v("curve", s.curve), v("window_sum", s.window_sum), v("window_begin", s.window_begin), v("smooth", s.smooth), v("peak", s.peak);
  v("peak_strain", s.peak_strain), v("low_since", s.low_since), v("dropped", s.dropped);
}

// ---- values ---------------------------------------------------------------------------------------------------------
// Doubles come back to the bit: JSON text of a finite one is its shortest form that reads back; the others are words.

template <class T>
concept List = requires(T& t) { t.push_back(t.front()); } && !std::is_same_v<T, std::string>;

template <class T>
concept FixedList = requires { std::tuple_size<T>::value; };

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;

template <class T>
Json to_json(const T& x);
template <class T>
void from_json(const Json& j, T& x);

struct Writer {
  Json& object;
  template <class T>
  void operator()(const char* name, const T& x) {
    object[name] = to_json(x);
  }
};

struct Reader {
  const Json& object;
  template <class T>
  void operator()(const char* name, T& x) {
    from_json(object.at(name), x);
  }
};

template <class T>
Json to_json(const T& x) {
  if constexpr (std::is_same_v<T, double>) {
    if (std::isnan(x)) return "nan";
    if (std::isinf(x)) return x > 0.0 ? "inf" : "-inf";
    return x;
  } else if constexpr (std::is_enum_v<T>) {
    return static_cast<int>(x);
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    return x;
  } else if constexpr (is_optional<T>) {
    return x ? to_json(*x) : Json();
  } else if constexpr (List<T> || FixedList<T>) {
    Json list = Json::array();
    for (const auto& one : x) list.push_back(to_json(one));
    return list;
  } else {
    Json object = Json::object();
    Writer writer{object};
    each(writer, x);
    return object;
  }
}

// Throws nlohmann::json::exception, or std::invalid_argument for a number that is none.
template <class T>
void from_json(const Json& j, T& x) {
  if constexpr (std::is_same_v<T, double>) {
    if (!j.is_string()) {
      x = j.get<double>();
      return;
    }
    const auto word = j.get<std::string>();
    if (word != "nan" && word != "inf" && word != "-inf") throw std::invalid_argument("\"" + word + "\" is not a number");
    x = word == "nan" ? std::numeric_limits<double>::quiet_NaN() : word == "inf" ? std::numeric_limits<double>::infinity() : -std::numeric_limits<double>::infinity();
  } else if constexpr (std::is_enum_v<T>) {
    x = static_cast<T>(j.get<int>());
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    x = j.get<T>();
  } else if constexpr (is_optional<T>) {
    x.reset();
    if (j.is_null()) return;
    typename T::value_type value{};
    from_json(j, value);
    x = std::move(value);
  } else if constexpr (FixedList<T>) {
    if (j.size() != std::tuple_size<T>::value) throw std::invalid_argument("a list of another length");
    for (std::size_t k = 0; k < j.size(); ++k) from_json(j.at(k), x[k]);
  } else if constexpr (List<T>) {
    x.clear();
    for (const Json& one : j) {
      typename T::value_type value{};
      from_json(one, value);
      x.push_back(std::move(value));
    }
  } else {
    Reader reader{j};
    each(reader, x);
  }
}

}  // namespace platen::fields
