// The curve skeleton that CGAL finds by mean curvature flow.
//
//   skeleton < mesh.off
//
// Prints the seconds that it took, the numbers of vertices and edges, the vertices, and the edges by the numbers of their ends.
#include <CGAL/IO/OFF.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/extract_mean_curvature_flow_skeleton.h>

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <sstream>

using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Skeleton = CGAL::Mean_curvature_flow_skeletonization<Mesh>::Skeleton;

int main() {
    // CGAL seeks in what it reads, which a pipe does not allow.
    std::stringstream text;
    text << std::cin.rdbuf();
    Mesh mesh;
    if (!CGAL::IO::read_OFF(text, mesh)) {
        std::cerr << "expected an OFF file\n";
        return EXIT_FAILURE;
    }
    auto start = std::chrono::steady_clock::now();
    Skeleton skeleton;
    CGAL::extract_mean_curvature_flow_skeleton(mesh, skeleton);
    std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;

    std::cout.precision(17);
    std::cout << seconds.count() << '\n' << num_vertices(skeleton) << ' ' << num_edges(skeleton) << '\n';
    for (auto node : CGAL::make_range(vertices(skeleton))) std::cout << skeleton[node].point << '\n';
    for (auto edge : CGAL::make_range(edges(skeleton))) {
        std::cout << source(edge, skeleton) << ' ' << target(edge, skeleton) << '\n';
    }
}
