/* Catalyst for simulations in C. */
#ifndef catalyst_h
#define catalyst_h

#include "catalyst_api.h"

#endif
