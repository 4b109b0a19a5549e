// The features that CGAL finds at sharp edges.
//
//   features ANGLE... < mesh.off
//
// Prints one line for each angle: the number of each face's patch. A mesh that is no manifold is made one as CGAL does it: an edge
// with more than two faces, or whose faces cannot be oriented alike, becomes a rim.
#include <CGAL/Polygon_mesh_processing/detect_features.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>

#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

namespace processing = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

int main(int count, char **arguments) {
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
    std::vector<std::vector<std::size_t>> polygons(faces);
    for (auto &polygon : polygons) {
        std::size_t size;
        std::cin >> size;
        polygon.resize(size);
        for (auto &vertex : polygon) std::cin >> vertex;
    }
    if (!std::cin) {
        std::cerr << "the OFF file ends early\n";
        return EXIT_FAILURE;
    }
    if (!processing::is_polygon_soup_a_polygon_mesh(polygons)) processing::orient_polygon_soup(points, polygons);
    Mesh mesh;
    processing::polygon_soup_to_polygon_mesh(points, polygons, mesh);

    for (int place = 1; place < count; ++place) {
        auto sharp = mesh.add_property_map<Mesh::Edge_index, bool>("sharp", false).first;
        auto patch = mesh.add_property_map<Mesh::Face_index, int>("patch", -1).first;
        processing::sharp_edges_segmentation(mesh, std::atof(arguments[place]), sharp, patch);
        for (auto face : mesh.faces()) std::cout << patch[face] << ' ';
        std::cout << '\n';
        mesh.remove_property_map(sharp);
        mesh.remove_property_map(patch);
    }
}
