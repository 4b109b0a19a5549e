/* Multi-component arrays: objects whose children are arrays of one length. */
#ifndef conduit_blueprint_mcarray_h
#define conduit_blueprint_mcarray_h

#include "conduit.h"
#include "conduit_blueprint_c_exports.h"

#ifdef __cplusplus
extern "C" {
#endif

CONDUIT_BLUEPRINT_C_API int conduit_blueprint_mcarray_verify(const conduit_node* node, conduit_node* info);
CONDUIT_BLUEPRINT_C_API int conduit_blueprint_mcarray_verify_sub_protocol(
  const char* protocol, const conduit_node* node, conduit_node* info);
/* Whether the components lie in turn in one piece of memory. */
CONDUIT_BLUEPRINT_C_API int conduit_blueprint_mcarray_is_interleaved(const conduit_node* node);
/* A copy with one component after the other, or with the components in turn; 1 where that could be done. */
CONDUIT_BLUEPRINT_C_API int conduit_blueprint_mcarray_to_contiguous(const conduit_node* node, conduit_node* target);
CONDUIT_BLUEPRINT_C_API int conduit_blueprint_mcarray_to_interleaved(const conduit_node* node, conduit_node* target);

#ifdef __cplusplus
}
#endif

#endif
