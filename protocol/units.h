// Numbers with units, as users write them in case files: "2.5 mm", "5 kN/m", "1e-5 s".
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace platen {

// What a number measures; decides which units it may have.
enum class Quantity { length, time, density, stress, force, stiffness, speed, acceleration, frequency };

// A text that is not a number with a unit of the wanted dimension. what() says what is wrong, without the key.
class UnitError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The value of `text` in SI units. The dimension is checked exactly: "60 s" is not a frequency, though UDUNITS-2 would
// convert one into the other, and "rpm" is not one either because it counts angles.
// Where the unit is a power of ten of the SI unit the result has the bits of the SI number written in decimals:
// to_si("1.1 mm") == 1.1e-3.
// Throws UnitError for texts that cannot be read, numbers that are not finite, units of another dimension, units with an
// offset or a logarithm, and std::runtime_error when the unit database of UDUNITS-2 is not installed.
double to_si(std::string_view text, Quantity quantity);

const char* name_of(Quantity quantity);     // with its article, "a length"
const char* si_unit_of(Quantity quantity);  // "m"
const char* example_of(Quantity quantity);  // "2.5 mm"

}  // namespace platen
