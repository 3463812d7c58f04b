#pragma once
// Objects that stand for a colour: <spectrum type="blackbody">, <texture type="uniform">, ...
#include "src/scene_file/scene_properties.h"
#include "src/scene_file/spectrum.h"

namespace limn {

// True for uniform, rawconstant, srgb, d65, regular, irregular and blackbody.
bool is_spectrum_type(const std::string& type);

// The colour of such an object. InputError for unknown, missing or unusable parameters.
Rgb<double> read_spectrum_object(DescribedProperties& properties, ColourUse use);

}  // namespace limn
