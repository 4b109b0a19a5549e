/* The Catalyst API: which implementation is loaded, and what each call answers. Expectations come as arguments:
 * session STATUS-OF-INITIALIZE [NAME [SEARCH-PATH]] */
#include <catalyst.h>
#include <catalyst_impl.h>
#include <catalyst_stub.h>
#include <stddef.h>
#include <string.h>

#include "check.h"

int main(int argc, char** argv)
{
  CHECK(argc >= 2);
  CHECK(sizeof(enum catalyst_status) == sizeof(int) && offsetof(struct catalyst_impl, results) == 40);
  conduit_node* node = conduit_node_create();
  CHECK(catalyst_execute(node) == catalyst_status_error_no_implementation);
  CHECK(catalyst_finalize(node) == catalyst_status_error_no_implementation);
  CHECK(catalyst_about(node) == catalyst_status_error_no_implementation);
  CHECK(catalyst_results(node) == catalyst_status_error_no_implementation);
  if (argc > 2) conduit_node_set_path_char8_str(node, "catalyst_load/implementation", argv[2]);
  if (argc > 3) conduit_node_set_path_char8_str(node, "catalyst_load/search_paths/first", argv[3]);
  int status = catalyst_initialize(node);
  if (status != atoi(argv[1])) fprintf(stderr, "catalyst_initialize answers %d, not %s\n", status, argv[1]);
  CHECK(status == atoi(argv[1]));
  if (status != 0) return 0;
  CHECK(catalyst_initialize(node) == catalyst_status_ok);
  conduit_node_set_path_int64(node, "catalyst/state/timestep", 3);
  CHECK(catalyst_execute(node) == catalyst_status_ok);
  conduit_node* results = conduit_node_create();
  CHECK(catalyst_results(results) == catalyst_status_ok);
  conduit_node* about = conduit_node_create();
  CHECK(catalyst_about(about) == catalyst_status_ok);
  printf("%s\n", conduit_node_fetch_path_as_char8_str(about, "catalyst/implementation"));
  if (conduit_node_has_path(results, "catalyst/seen"))
    CHECK(conduit_node_fetch_path_as_int64(results, "catalyst/seen") == 3);
  CHECK(catalyst_finalize(node) == catalyst_status_ok);
  conduit_node_destroy(node);
  conduit_node_destroy(results);
  conduit_node_destroy(about);
  return 0;
}
