#pragma once
// Faces that overlap in a plane: what is seen of such surfaces inside of them rounding decides.
#include <span>
#include <vector>

#include "limn/edgetree/face_pairs.h"

namespace limn {

// Those of the pairs that lie in one plane, to the rounding of positions (edges/contacts.h), and
// have more of it in common than rounding explains. Copies with the same corners are among them.
// meshes: of the scene's shapes; pairs: from find_face_pairs.
std::vector<FacePair> find_overlaps(std::span<const Mesh* const> meshes,
                                    std::span<const FacePair> pairs);

}  // namespace limn
