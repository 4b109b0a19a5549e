// The pairs of triangles that CGAL finds to intersect.
//
//   intersections < mesh.off
//
// Prints one line for each pair: the numbers of its triangles, the lower first. Triangles without area are left out, as CGAL asks.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <iostream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace processing = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

int main() {
    std::string word;
    std::size_t vertices, faces, edges;
    if (!(std::cin >> word >> vertices >> faces >> edges) || word != "OFF") {
        std::cerr << "expected an OFF file\n";
        return EXIT_FAILURE;
    }
    std::vector<Kernel::Point_3> points(vertices);
    for (auto &point : points) {
        double x, y, z;
        std::cin >> x >> y >> z;
        point = Kernel::Point_3(x, y, z);
    }
    std::vector<std::vector<std::size_t>> triangles(faces, std::vector<std::size_t>(3));
    for (auto &triangle : triangles) {
        std::size_t size;
        std::cin >> size >> triangle[0] >> triangle[1] >> triangle[2];
    }
    if (!std::cin) {
        std::cerr << "the OFF file ends early\n";
        return EXIT_FAILURE;
    }
    if (!processing::is_polygon_soup_a_polygon_mesh(triangles)) {
        std::cerr << "the triangles are no manifold\n";
        return EXIT_FAILURE;
    }
    Mesh mesh;
    processing::polygon_soup_to_polygon_mesh(points, triangles, mesh);

    std::vector<std::pair<Mesh::Face_index, Mesh::Face_index>> found;
    processing::self_intersections(mesh, std::back_inserter(found));
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (const auto &[first, second] : found)
        if (first != second) pairs.emplace_back(std::min<std::size_t>(first, second), std::max<std::size_t>(first, second));
    std::sort(pairs.begin(), pairs.end());
    for (const auto &[first, second] : pairs) std::cout << first << ' ' << second << '\n';
}
