// Transient heat in a box of tetrahedra that may move while it is heated: linear finite elements, lumped mass, explicit steps, each
// rank of MPI with a slab of the box. It knows nothing of Catalyst.
#ifndef heat_hpp
#define heat_hpp

#include <mpi.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

class Heat
{
public:
  // A unit box, cold but for the side x = 0, which is kept at 1; the side x = 1 is kept at 0.
  Heat(MPI_Comm ranks, int cells) : ranks(ranks), cells(cells)
  {
    MPI_Comm_rank(ranks, &rank);
    MPI_Comm_size(ranks, &size);
    first = begin(rank);
    slabs = begin(rank + 1) - first;
    const int side = cells + 1, plane = side * side;
    const int vertices = slabs > 0 ? (slabs + 1) * plane : 0;
    for (int v = 0; v < vertices; ++v)
    {
      const std::array<int, 3> at{ { first + v / plane, v / side % side, v % side } };
      for (int axis : at) coordinates.push_back(static_cast<double>(axis) / cells);
      numbers.push_back(static_cast<std::int64_t>(first) * plane + v);
      temperature.push_back(at[0] == 0 ? 1.0 : 0.0);
    }
    velocity.assign(3 * temperature.size(), 0.0);
    const std::array<int, 3> step{ { plane, side, 1 } };
    for (int i = 0; i < slabs; ++i)
      for (int j = 0; j < cells; ++j)
        for (int k = 0; k < cells; ++k) addCube({ { first + i, j, k } }, i * plane + j * side + k, step);
  }

  // One step on the mesh as it lies, which moves at `velocity` meanwhile. The caller moves the coordinates.
  void step(double conductivity, double timeStep)
  {
    // Explicit steps are stable up to a length that the smallest tetrahedron sets: a step is taken in as many parts as that needs.
    double own = 0.0, smallest = 0.0;
    for (std::size_t t = 0; t < connectivity.size(); t += 4)
    {
      Gradients gradient;
      gradients(connectivity.data() + t, gradient);
      double squares = 0.0;
      for (const auto& one : gradient)
        for (double slope : one) squares += slope * slope;
      own = std::max(own, squares);
    }
    MPI_Allreduce(&own, &smallest, 1, MPI_DOUBLE, MPI_MAX, ranks);
    const int parts = 1 + static_cast<int>(2.0 * conductivity * timeStep * smallest);
    for (int part = 0; part < parts; ++part) partOfStep(conductivity, timeStep / parts);
  }

  // Of the whole box.
  double volume() const { return total(false); }
  double mean() const { return total(true) / total(false); }

  MPI_Comm ranks;
  int rank = 0, size = 1;
  int cells;
  std::vector<double> coordinates;         // x y z for each vertex
  std::vector<double> temperature;         // one for each vertex
  std::vector<double> velocity;            // of the mesh, x y z for each vertex; 0 where it rests
  std::vector<std::int32_t> connectivity;  // four vertices for each tetrahedron
  std::vector<std::int32_t> triangles;     // three vertices for each face of the box
  std::vector<std::int32_t> features;      // 1 to 6 for each face: x-min, x-max, y-min, y-max, z-min, z-max
  std::vector<std::int64_t> numbers;       // of the vertices in the whole box

private:
  using Gradients = std::array<std::array<double, 3>, 4>;

  void partOfStep(double conductivity, double timeStep)
  {
    std::vector<double> mass(temperature.size()), rate(temperature.size());
    for (std::size_t t = 0; t < connectivity.size(); t += 4)
    {
      const std::int32_t* tet = connectivity.data() + t;
      Gradients gradient;
      const double volume = gradients(tet, gradient);
      std::array<double, 3> slope{};
      double along = 0.0;
      for (int c = 0; c < 4; ++c)
        for (int axis = 0; axis < 3; ++axis) slope[axis] += gradient[c][axis] * temperature[tet[c]];
      for (int c = 0; c < 4; ++c)
        for (int axis = 0; axis < 3; ++axis) along += 0.25 * velocity[3 * tet[c] + axis] * slope[axis];
      for (int c = 0; c < 4; ++c)
      {
        double flux = 0.0;
        for (int axis = 0; axis < 3; ++axis) flux += gradient[c][axis] * slope[axis];
        mass[tet[c]] += 0.25 * volume;
        // A vertex that moves passes through the temperature: the second term is that of the moving mesh.
        rate[tet[c]] += volume * (0.25 * along - conductivity * flux);
      }
    }
    share(mass);
    share(rate);
    const int plane = (cells + 1) * (cells + 1);
    for (std::size_t v = 0; v < temperature.size(); ++v)
    {
      const int i = first + static_cast<int>(v) / plane;
      if (i > 0 && i < cells) temperature[v] += timeStep * rate[v] / mass[v];
    }
  }

  int begin(int of) const { return static_cast<int>(static_cast<long>(cells) * of / size); }

  void addCube(const std::array<int, 3>& at, int corner, const std::array<int, 3>& step)
  {
    static const int paths[6][3] = { { 0, 1, 2 }, { 1, 2, 0 }, { 2, 0, 1 }, { 0, 2, 1 }, { 2, 1, 0 }, { 1, 0, 2 } };
    // Along each order of the axes from the lowest corner of the cube to the highest.
    for (int path = 0; path < 6; ++path)
    {
      std::array<std::int32_t, 4> tet{ { corner, 0, 0, 0 } };
      for (int edge = 0; edge < 3; ++edge) tet[edge + 1] = tet[edge] + step[paths[path][edge]];
      if (path >= 3) std::swap(tet[1], tet[2]);
      connectivity.insert(connectivity.end(), tet.begin(), tet.end());
    }
    for (int axis = 0; axis < 3; ++axis)
      for (int end = 0; end < 2; ++end)
      {
        if (at[axis] != (end ? cells - 1 : 0)) continue;
        const int a = step[(axis + 1) % 3], b = step[(axis + 2) % 3];
        const int low = corner + end * step[axis], high = low + a + b;
        const int split[2][3] = { { low, low + a, high }, { low, high, low + b } };
        for (const auto& half : split)
        {
          // Seen from outside they run counter-clockwise.
          for (int c = 0; c < 3; ++c) triangles.push_back(half[end ? c : 2 - c]);
          features.push_back(1 + 2 * axis + end);
        }
      }
  }

  // Gradients of the four shape functions of a tetrahedron; its volume.
  double gradients(const std::int32_t* tet, Gradients& gradient) const
  {
    double edge[3][3], normal[3][3];
    for (int e = 0; e < 3; ++e)
      for (int axis = 0; axis < 3; ++axis)
        edge[e][axis] = coordinates[3 * tet[e + 1] + axis] - coordinates[3 * tet[0] + axis];
    for (int e = 0; e < 3; ++e)
    {
      const double *a = edge[(e + 1) % 3], *b = edge[(e + 2) % 3];
      for (int axis = 0; axis < 3; ++axis)
        normal[e][axis] = a[(axis + 1) % 3] * b[(axis + 2) % 3] - a[(axis + 2) % 3] * b[(axis + 1) % 3];
    }
    const double six = edge[0][0] * normal[0][0] + edge[0][1] * normal[0][1] + edge[0][2] * normal[0][2];
    for (int axis = 0; axis < 3; ++axis)
    {
      gradient[0][axis] = 0.0;
      for (int e = 0; e < 3; ++e)
      {
        gradient[e + 1][axis] = normal[e][axis] / six;
        gradient[0][axis] -= gradient[e + 1][axis];
      }
    }
    return six / 6.0;
  }

  // Adds what the neighbours have for the planes of vertices that are shared with them. Ranks without slabs are passed over.
  void share(std::vector<double>& values) const
  {
    if (slabs == 0) return;
    const int plane = (cells + 1) * (cells + 1);
    std::vector<double> received(plane);
    for (int side = -1; side <= 1; side += 2)
    {
      int other = rank + side;
      while (other >= 0 && other < size && begin(other + 1) == begin(other)) other += side;
      if (other < 0 || other >= size) continue;
      double* own = side < 0 ? values.data() : values.data() + slabs * plane;
      MPI_Sendrecv(own, plane, MPI_DOUBLE, other, 0, received.data(), plane, MPI_DOUBLE, other, 0, ranks, MPI_STATUS_IGNORE);
      for (int v = 0; v < plane; ++v) own[v] += received[v];
    }
  }

  double total(bool ofTemperature) const
  {
    double sum = 0.0, all = 0.0;
    Gradients gradient;
    for (std::size_t t = 0; t < connectivity.size(); t += 4)
    {
      double mean = ofTemperature ? 0.0 : 1.0;
      for (int c = 0; ofTemperature && c < 4; ++c) mean += 0.25 * temperature[connectivity[t + c]];
      sum += mean * gradients(connectivity.data() + t, gradient);
    }
    MPI_Allreduce(&sum, &all, 1, MPI_DOUBLE, MPI_SUM, ranks);
    return all;
  }

  int first = 0, slabs = 0;  // the slabs of cubes that this rank has, along x
};

#endif
