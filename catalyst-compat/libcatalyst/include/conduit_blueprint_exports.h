/* Marks what the library exports of Blueprint. */
#ifndef conduit_blueprint_exports_h
#define conduit_blueprint_exports_h

#include "catalyst_conduit_blueprint_mangle.h"
#include "catalyst_export.h"

#define CONDUIT_BLUEPRINT_API CATALYST_EXPORT

#endif
