#pragma once
// Scenes of earlier versions of the format: Mitsuba 0.4 to 0.6 and 1.x.
#include <string>
#include <vector>

#include "src/scene_file/xml_tree.h"

namespace limn {

// Checks the version of a <scene> element, and renames what versions before 2.0.0 call otherwise,
// by Mitsuba 3's rules, before parameters are substituted. InputError for a malformed version or
// one that is not known. Appends whole lines to `warnings`.
void upgrade(XmlElement& scene, std::vector<std::string>& warnings);

}  // namespace limn
