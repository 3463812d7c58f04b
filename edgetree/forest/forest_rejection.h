#pragma once
// The edge forest as a RejectionTree.
#include <memory>

#include "edgetree/forest/forest_node.h"
#include "limn/edgetree/rejection_tree.h"

namespace limn {

// Its nodes are the children of the forest's nodes. The forest must outlive it.
std::unique_ptr<RejectionTree> make_forest_rejection_tree(const Forest& forest);

}  // namespace limn
