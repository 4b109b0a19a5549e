// Catalyst for simulations in C++: the calls of catalyst.h, and nodes as objects.
#ifndef catalyst_hpp
#define catalyst_hpp

#include "catalyst.h"
#include "catalyst_conduit.hpp"

#endif
