/* Marks what the library exports. */
#ifndef conduit_exports_h
#define conduit_exports_h

#include "catalyst_conduit_mangle.h"
#include "catalyst_export.h"

#define CONDUIT_API CATALYST_EXPORT

#endif
