/* Marks what the library exports to C. */
#ifndef conduit_c_exports_h
#define conduit_c_exports_h

#include "conduit_exports.h"

#define CONDUIT_C_API CONDUIT_API

#endif
