// Heat, instrumented by Catalyst 2 in C++.
//
//   export CATALYST_IMPLEMENTATION_NAME=tombolo
//   mpirun -n 3 heat_catalyst_cxx [STEPS [CELLS [MILLISECONDS-PER-STEP]]]
//
// TOMBOLO_PIPELINES names what to watch (else the surface is streamed), TOMBOLO_ORDERS orders known beforehand.
#include <catalyst.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "heat.hpp"

static void check(catalyst_status status, const char* call)
{
  if (status == catalyst_status_ok) return;
  std::fprintf(stderr, "%s answers %d\n", call, static_cast<int>(status));
  MPI_Abort(MPI_COMM_WORLD, 1);
}

static const std::string axes[3] = { "x", "y", "z" };

// Tells Catalyst of the arrays, which stay the solver's: nothing is copied.
static void describe(conduit_cpp::Node channel, Heat& solver)
{
  channel["type"].set("mesh");
  const char* const names[6] = { "x-min", "x-max", "y-min", "y-max", "z-min", "z-max" };
  for (int feature = 0; feature < 6; ++feature) channel["state/features"][names[feature]].set_int32(feature + 1);

  auto mesh = channel["data"];
  const conduit_index_t vertices = static_cast<conduit_index_t>(solver.temperature.size());
  mesh["coordsets/coords/type"].set("explicit");
  for (int axis = 0; axis < 3; ++axis)
    mesh["coordsets/coords/values/" + axes[axis]].set_external(
      solver.coordinates.data(), vertices, axis * sizeof(double), 3 * sizeof(double));
  mesh["topologies/mesh/type"].set("unstructured");
  mesh["topologies/mesh/coordset"].set("coords");
  mesh["topologies/mesh/elements/shape"].set("tet");
  mesh["topologies/mesh/elements/connectivity"].set_external(
    solver.connectivity.data(), static_cast<conduit_index_t>(solver.connectivity.size()));
  mesh["topologies/boundary/type"].set("unstructured");
  mesh["topologies/boundary/coordset"].set("coords");
  mesh["topologies/boundary/elements/shape"].set("tri");
  mesh["topologies/boundary/elements/connectivity"].set_external(
    solver.triangles.data(), static_cast<conduit_index_t>(solver.triangles.size()));

  mesh["fields/temperature/association"].set("vertex");
  mesh["fields/temperature/topology"].set("mesh");
  mesh["fields/temperature/values"].set_external(solver.temperature.data(), vertices);
  // Which side of the box each face belongs to, so that it can be seized by its name.
  mesh["fields/boundary_attribute/association"].set("element");
  mesh["fields/boundary_attribute/topology"].set("boundary");
  mesh["fields/boundary_attribute/values"].set_external(
    solver.features.data(), static_cast<conduit_index_t>(solver.features.size()));
  // The vertices' numbers in the whole box: what ranks share is known by them.
  mesh["fields/number/association"].set("vertex");
  mesh["fields/number/topology"].set("mesh");
  mesh["fields/number/values"].set_external(solver.numbers.data(), vertices);
  mesh["state/metadata/vtk_fields/number/attribute_type"].set("GlobalIds");
}

int main(int argc, char** argv)
{
  MPI_Init(&argc, &argv);
  const long steps = argc > 1 ? std::atol(argv[1]) : 100;
  const int cells = argc > 2 ? std::atoi(argv[2]) : 6;
  const std::chrono::milliseconds pace(argc > 3 ? std::atol(argv[3]) : 0);
  const double timeStep = 1e-3;
  double conductivity = 0.5;
  {
    Heat solver(MPI_COMM_WORLD, cells);
    conduit_cpp::Node setup;
    setup["catalyst/mpi_comm"].set_int32(MPI_Comm_c2f(MPI_COMM_WORLD));
    setup["catalyst/parameters/conductivity/value"].set_float64(conductivity);
    setup["catalyst/parameters/conductivity/minimum"].set_float64(0.0);
    setup["catalyst/parameters/conductivity/maximum"].set_float64(1.0);
    check(catalyst_initialize(conduit_cpp::c_node(&setup)), "catalyst_initialize");

    conduit_cpp::Node node;
    describe(node["catalyst/channels/solid"], solver);
    for (long step = 0; step < steps; ++step)
    {
      node["catalyst/state/timestep"].set_int64(step);
      node["catalyst/state/time"].set_float64(timeStep * static_cast<double>(step));
      node["catalyst/state/time_step"].set_float64(timeStep);
      check(catalyst_execute(conduit_cpp::c_node(&node)), "catalyst_execute");

      conduit_cpp::Node results;
      check(catalyst_results(conduit_cpp::c_node(&results)), "catalyst_results");
      if (results.has_path("catalyst/steering/fields/conductivity/values"))
        conductivity = results["catalyst/steering/fields/conductivity/values"].to_float64();
      if (results.has_path("catalyst/steering/fields/stop/values") &&
        results["catalyst/steering/fields/stop/values"].to_float64() != 0.0)
        break;

      std::vector<double> moved = solver.coordinates;
      solver.velocity.assign(solver.velocity.size(), 0.0);
      if (results.has_path("catalyst/solid/coordsets/coords") && !moved.empty())
        for (std::size_t axis = 0; axis < 3; ++axis)
        {
          const double* to = results["catalyst/solid/coordsets/coords/values/" + axes[axis]].as_float64_ptr();
          const double* velocity = results["catalyst/solid/fields/velocity/values/" + axes[axis]].as_float64_ptr();
          for (std::size_t v = 0; v < solver.temperature.size(); ++v)
          {
            moved[3 * v + axis] = to[v];
            solver.velocity[3 * v + axis] = velocity[v];
          }
        }
      solver.step(conductivity, timeStep);
      // In place, so that the node goes on showing it.
      std::copy(moved.begin(), moved.end(), solver.coordinates.begin());
      std::this_thread::sleep_for(pace);
    }
    const double volume = solver.volume(), mean = solver.mean();
    if (solver.rank == 0)
      std::printf("volume %.12f mean temperature %.12f conductivity %g\n", volume, mean, conductivity);
    check(catalyst_finalize(conduit_cpp::c_node(&setup)), "catalyst_finalize");
  }
  MPI_Finalize();
  return 0;
}
