#pragma once
// Spectra as linear Rec.709 colours, by Mitsuba 3's rules for its RGB variants.
#include <span>
#include <string>
#include <vector>

#include "limn/core/dual.h"
#include "limn/core/error.h"

namespace limn {

// What a colour is used for.
enum class ColourUse {
  kReflectance,  // weighed by the illuminant D65, clamped to [0, 1]
  kUnbounded,    // the same, clamped to be at least 0: indices of refraction
  kEmission,     // not weighed, clamped to be at least 0
};

struct SpectrumSample {
  double wavelength;  // nm
  double value;
};

// The largest number of samples of a spectrum. Not tuned: measured spectra have hundreds.
inline constexpr size_t kMaxSpectrumSamples = 100000;

// Integrates a spectrum against the CIE 1931 observer from 360 to 830 nm. samples: by increasing
// wavelength; linear between them, zero outside.
Rgb<double> integrate_spectrum(std::span<const SpectrumSample> samples, ColourUse use);

// A spectrum of one value at all wavelengths: grey, but for emission, which is slightly pink since
// Mitsuba does not weigh it by a white illuminant.
Rgb<double> constant_spectrum(double value, ColourUse use);

// Emission of a black body [W / (m^2 sr nm)] of this temperature [K].
Rgb<double> blackbody(double temperature);

// Parses "400:0.5, 500:0.6". InputError at `where`: malformed text, wavelengths that do not
// increase, fewer than two samples, values that are not finite.
std::vector<SpectrumSample> parse_spectrum(const std::string& text, const SourceLocation& where);
// Reads a file of lines "WAVELENGTH VALUE"; # begins a comment.
std::vector<SpectrumSample> read_spectrum_file(const std::string& file);
// As many values as wavelengths, or values at equal steps over a range of two wavelengths.
std::vector<SpectrumSample> make_spectrum(const std::vector<double>& wavelengths,
                                          const std::vector<double>& values,
                                          const SourceLocation& where);

}  // namespace limn
