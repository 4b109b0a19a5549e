/* Who is told of messages. A handler gets the text, the file and the line. Without one, errors are thrown as std::runtime_error
 * where the process has a C++ runtime, else printed to standard error; so are warnings. NULL brings that back. */
#ifndef conduit_utils_h
#define conduit_utils_h

#include "conduit_c_exports.h"

#ifdef __cplusplus
extern "C" {
#endif

CONDUIT_C_API void conduit_utils_set_info_handler(void (*handler)(const char*, const char*, int));
CONDUIT_C_API void conduit_utils_set_warning_handler(void (*handler)(const char*, const char*, int));
CONDUIT_C_API void conduit_utils_set_error_handler(void (*handler)(const char*, const char*, int));

#ifdef __cplusplus
}
#endif

#endif
