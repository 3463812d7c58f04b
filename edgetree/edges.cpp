#include "limn/edgetree/edge_sampler.h"
