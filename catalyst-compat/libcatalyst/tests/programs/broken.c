/* Libraries that are no implementation: without the table, of another version, without a function. */
#include <catalyst_impl.h>

#if defined(OTHER_VERSION) || defined(WITHOUT_FUNCTION)
CATALYST_EXPORT extern const struct catalyst_impl catalyst_api_impl;
static enum catalyst_status answer(const conduit_node* node) { return node ? catalyst_status_ok : catalyst_status_ok; }
static enum catalyst_status fill(conduit_node* node) { return node ? catalyst_status_ok : catalyst_status_ok; }
#endif

#ifdef OTHER_VERSION
const struct catalyst_impl catalyst_api_impl = { 2, answer, answer, answer, fill, fill };
#endif
#ifdef WITHOUT_FUNCTION
const struct catalyst_impl catalyst_api_impl = { 1, answer, answer, answer, fill, 0 };
#endif
int catalyst_broken_library = 1;
