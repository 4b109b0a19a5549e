/* Marks what the library exports. */
#ifndef conduit_blueprint_exports_h
#define conduit_blueprint_exports_h

#include "conduit_exports.h"

#endif
