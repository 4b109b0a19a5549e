/* Marks what the library exports of Blueprint to C. */
#ifndef conduit_blueprint_c_exports_h
#define conduit_blueprint_c_exports_h

#include "conduit_blueprint_exports.h"

#define CONDUIT_BLUEPRINT_C_API CONDUIT_BLUEPRINT_API

#endif
