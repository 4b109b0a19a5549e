/* Conduit's C interface. */
#ifndef conduit_h
#define conduit_h

#include "conduit_node.h"
#include "conduit_utils.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Fills a node with which Conduit this is. */
CONDUIT_C_API void conduit_about(conduit_node* target);

#ifdef __cplusplus
}
#endif

#endif
