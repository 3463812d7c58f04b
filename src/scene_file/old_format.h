#pragma once
// Scenes of earlier versions of the format: Mitsuba 0.4 to 0.6 and 1.x.
#include <string>
#include <vector>

#include "src/scene_file/xml_tree.h"

namespace limn {

// Checks the version of a <scene> element, and renames what versions before 2.0.0 call otherwise,
// by Mitsuba 3's rules, before parameters are substituted. InputError for a malformed version or
// one that is not known. Appends whole lines to `warnings`. True if the version is before 2.0.0:
// upgrade_values() is then due once parameters are substituted.
bool upgrade(XmlElement& scene, std::vector<std::string>& warnings);
// Colours and filters as Mitsuba 3 writes them, of the element and all in it.
void upgrade_values(XmlElement& element, std::vector<std::string>& warnings);

}  // namespace limn
