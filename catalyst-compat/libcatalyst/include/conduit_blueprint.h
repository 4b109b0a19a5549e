/* Blueprint: what trees must hold to be a mesh, a multi-component array or a table. */
#ifndef conduit_blueprint_h
#define conduit_blueprint_h

#include "conduit.h"
#include "conduit_blueprint_c_exports.h"
#include "conduit_blueprint_config.h"
#include "conduit_blueprint_mcarray.h"
#include "conduit_blueprint_mesh.h"
#include "conduit_blueprint_table.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Fills a node with the protocols that can be verified. */
CONDUIT_BLUEPRINT_C_API void conduit_blueprint_about(conduit_node* target);
/* Whether a tree is what a protocol ("mesh", "mesh/coordset", "mcarray", "table", ...) asks for. `info` gets a `valid` of "true" or
 * "false" for each part, and `errors`, a list of texts, where it is not. */
CONDUIT_BLUEPRINT_C_API int conduit_blueprint_verify(const char* protocol, const conduit_node* node, conduit_node* info);

#ifdef __cplusplus
}
#endif

#endif
