// An implementation that gives back the time step it saw, hands the rest on to the stub, and throws where it is asked to.
#include <catalyst_conduit.hpp>
#include <catalyst_stub.h>

#include "catalyst_impl_echo.h"

#include <stdexcept>

static conduit_int64 seen = -1;

enum catalyst_status catalyst_initialize_echo(const conduit_node* params)
{
  return catalyst_stub_initialize(params);
}

enum catalyst_status catalyst_execute_echo(const conduit_node* params)
{
  const conduit_cpp::Node node = conduit_cpp::cpp_node(const_cast<conduit_node*>(params));
  if (node.has_path("throw"))
  {
    throw std::runtime_error("echo throws");
  }
  seen = node["catalyst/state/timestep"].to_int64();
  return catalyst_stub_execute(params);
}

enum catalyst_status catalyst_finalize_echo(const conduit_node* params)
{
  return catalyst_stub_finalize(params);
}

enum catalyst_status catalyst_about_echo(conduit_node* params)
{
  const enum catalyst_status status = catalyst_stub_about(params);
  conduit_node_set_path_char8_str(params, "catalyst/implementation", "echo");
  return status;
}

enum catalyst_status catalyst_results_echo(conduit_node* params)
{
  conduit_node_set_path_int64(params, "catalyst/seen", seen);
  return catalyst_stub_results(params);
}
