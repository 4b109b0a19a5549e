/* Blueprint from C: what is a mesh and what is not, its index, cutting, joining, tables. */
#include <conduit_blueprint.h>
#include <stdio.h>
#include <string.h>

#include "check.h"

static char last[512];
static void note(const char* message, const char* file, int line)
{
  snprintf(last, sizeof last, "%s", message);
  CHECK(file[0] != 0 && line > 0);
}

/* A verdict on a tree as YAML, by the protocol of a mesh or of one of its parts. */
static const struct
{
  int valid;
  const char* protocol;
  const char* yaml;
} VERDICTS[] = {
  { 0, "logical_dims", "{}" }, { 1, "logical_dims", "{i: 1}" }, { 1, "logical_dims", "{i: 1, j: 2, k: 3}" },
  { 0, "logical_dims", "{i: test}" }, { 0, "logical_dims", "{i: 1.5}" }, { 0, "logical_dims", "{x: 5, y: 10}" },
  { 1, "coordset/uniform/origin", "{x: 1, y: 2.5, z: 0}" }, { 1, "coordset/uniform/origin", "{r: 1, theta: 0}" },
  { 0, "coordset/uniform/origin", "{x: test}" }, { 1, "coordset/uniform/origin", "{i: test}" },
  { 1, "coordset/uniform/spacing", "{dr: 0.1, dz: 2}" }, { 0, "coordset/uniform/spacing", "{dtheta: test}" },
  { 1, "coordset/uniform/spacing", "{di: test, x: test}" },
  { 0, "coordset/uniform", "{origin: {x: 1}}" }, { 1, "coordset/uniform", "{dims: {i: 1, j: 2}, origin: {x: 1}}" },
  { 0, "coordset/uniform", "{dims: {i: 1, j: 2, k: test}}" }, { 0, "coordset/rectilinear", "{values: test}" },
  { 1, "coordset/rectilinear", "{values: {x: [1.0, 2.0], y: [1.0, 2.0, 3.0]}}" },
  { 1, "coordset/rectilinear", "{values: [[1.0, 2.0], [3.0]]}" }, { 0, "coordset/rectilinear", "{values: {x: a}}" },
  { 1, "coordset/explicit", "{values: {u: [1.0, 2.0], v: [3.0, 4.0]}}" },
  { 0, "coordset/explicit", "{values: {x: [1.0, 2.0], y: [1.0]}}" }, { 0, "coordset/explicit", "{values: test}" },
  { 1, "coordset/type", "uniform" }, { 0, "coordset/type", "unstructured" }, { 0, "coordset", "{type: structured}" },
  { 0, "coordset/coord_system", "{type: cartesian}" }, { 1, "coordset/coord_system", "{type: cartesian, axes: {x: 1}}" },
  { 0, "coordset/coord_system", "{type: spherical, axes: {x: 1}}" },
  { 0, "coordset/coord_system", "{type: logical, axes: {i: 1, j: 1}}" },
  { 0, "coordset/coord_system", "{type: 10, axes: {x: 1}}" }, { 1, "topology/type", "points" },
  { 0, "topology/type", "explicit" }, { 1, "topology/shape", "polyhedral" }, { 0, "topology/shape", "polygon" },
  { 0, "topology", "{type: structured, coordset: c, elements: {dims: {x: 5, y: 10}}}" },
  { 1, "topology", "{type: structured, coordset: c, elements: {dims: {i: 5, j: 10}}}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {shape: quad}}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {shape: quad, connectivity: [1.0, 2.0]}}" },
  { 1, "topology", "{type: unstructured, coordset: c, elements: {shape: quad, connectivity: [0, 1, 2]}}" },
  { 1, "topology", "{type: unstructured, coordset: c, elements: {a: {shape: quad, connectivity: [0, 1, 2, 3]}, b: {shape: tri, connectivity: [0, 1, 2]}}}" },
  { 1, "topology", "{type: unstructured, coordset: c, elements: [{shape: quad, connectivity: [0, 1, 2, 3]}]}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {a: {shape: quad, connectivity: 1}, b: {shape: quad}}}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {shape: polyhedral, connectivity: [0, 1], sizes: [2], offsets: [0]}}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {a: {shape: polyhedral, connectivity: [0], sizes: [1], offsets: [0]}}, subelements: {shape: polygonal, connectivity: [0, 1, 2], sizes: [3]}}" },
  { 1, "topology", "{type: unstructured, coordset: c, elements: {a: {shape: polyhedral, connectivity: [0], sizes: [1], offsets: [0]}}, subelements: {a: {shape: polygonal, connectivity: [0, 1, 2], sizes: [3], offsets: [0]}}}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {shape: polygonal, connectivity: [0, 1, 2], sizes: [3]}}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {shape: polygonal, connectivity: [0, 1, 2], offsets: [0]}}" },
  { 1, "topology", "{type: unstructured, coordset: c, elements: {shape: polygonal, connectivity: [0, 1, 2]}}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {shape: polygonal, connectivity: [0, 1, 2, 0, 1, 2], sizes: [3, 3], offsets: [0]}}" },
  { 1, "topology", "{type: unstructured, coordset: c, elements: {shape: tri, connectivity: [0, 1, 2], offsets: [0.5]}}" },
  { 0, "topology", "{type: unstructured, coordset: c, elements: {shape: mixed, shape_map: {tri: 5}, shapes: [5, 9], sizes: [3, 4], offsets: [0, 3], connectivity: [0, 1, 2, 0, 1, 2, 3]}}" },
  { 1, "topology", "{type: unstructured, coordset: c, elements: {shape: mixed, shape_map: {tri: 5, quad: 9}, shapes: [5, 9], sizes: [3, 4], offsets: [0, 3], connectivity: [0, 1, 2, 0, 1, 2, 3]}}" },
  { 0, "topology", "{type: points, coordset: c, grid_function: 10}" }, { 1, "field/basis", "H1" }, { 0, "field/basis", "1" },
  { 1, "association", "element" }, { 0, "association", "zone" },
  { 0, "field", "{association: vertex, topology: t}" }, { 0, "field", "{association: vertex, values: [1.0]}" },
  { 1, "field", "{basis: H1, topology: t, values: [1.0]}" }, { 0, "field", "{association: zone, basis: H1, topology: t, values: [1.0]}" },
  { 0, "field", "{association: vertex, basis: 1, topology: t, values: [1.0]}" },
  { 1, "field", "{association: vertex, topology: t, values: {x: [1.0], y: [2.0]}}" },
  { 0, "field", "{association: vertex, topology: t, values: {x: a, y: b}}" },
  { 1, "field", "{association: element, topology: t, values: [1.0], volume_dependent: maybe}" },
  { 1, "field", "{association: element, matset: m, matset_values: {a: {u: [1.0], v: [2.0]}, b: [3.0]}}" },
  { 0, "field", "{association: element, matset: m, matset_values: {a: text}}" }, { 0, "field", "{association: element, matset: m}" },
  { 1, "matset", "{topology: t, volume_fractions: {a: [0.5], b: [0.5]}, material_map: {a: 1}}" },
  { 0, "matset", "{topology: t, volume_fractions: {a: [0.5]}, material_map: {b: 1}}" },
  { 0, "matset", "{topology: t, volume_fractions: {a: [0.5]}, material_map: {a: 1.5}}" },
  { 0, "matset", "{topology: t, volume_fractions: [0.5], material_ids: [1]}" },
  { 1, "matset", "{topology: t, volume_fractions: [0.5], material_ids: [1], material_map: {a: 1}}" },
  { 1, "matset", "{topology: t, volume_fractions: {a: [0.5]}, element_ids: {a: [0]}}" },
  { 0, "matset", "{topology: t, volume_fractions: {a: [0.5]}, element_ids: {b: [0]}}" },
  { 0, "matset", "{topology: t, volume_fractions: {a: [0.5]}, element_ids: {a: [0.5]}}" },
  { 1, "matset", "{topology: t, volume_fractions: {a: {values: [0.5], sizes: [1], offsets: [0]}}}" },
  { 0, "matset", "{topology: t, volume_fractions: {a: {values: [0.5], sizes: [1]}}}" },
  { 0, "matset", "{topology: t, volume_fractions: {a: {below: {values: [0.5]}}}}" },
  { 1, "specset", "{matset: m, matset_values: {a: {s: [0.1, 0.2]}, b: {s: [0.1, 0.2]}}}" },
  { 0, "specset", "{matset: m, matset_values: {a: {s: [0.1, 0.2]}, b: {s: [0.1]}}}" }, { 0, "specset", "{matset: m}" },
  { 1, "adjset", "{topology: t, association: vertex, groups: {g: {neighbors: [1], values: [0, 1]}}}" },
  { 1, "adjset", "{topology: t, association: vertex, groups: {}}" },
  { 0, "adjset", "{topology: t, association: vertex, groups: {g: {neighbors: [1.5]}}}" },
  { 1, "adjset", "{topology: t, association: element, groups: {g: {neighbors: [0, 1], windows: {w: {origin: {i: 0, j: 0}, dims: {i: 2, j: 1}, ratio: {i: 1, j: 1}}}}}}" },
  { 0, "adjset", "{topology: t, association: element, groups: {g: {neighbors: [0, 1], windows: {w: {origin: {i: 0, j: 0}, dims: {i: 2}, ratio: {i: 1, j: 1}}}}}}" },
  { 0, "adjset", "{topology: t, association: element, groups: {g: {neighbors: [0, 1], windows: {w: {origin: {i: 0, j: 0}, ratio: {i: 1, j: 1}}}}}}" },
  { 1, "nestset", "{topology: t, association: element, windows: {w: {domain_id: 1, domain_type: parent, ratio: {i: 2, j: 2}}}}" },
  { 0, "nestset", "{topology: t, association: element, windows: {w: {domain_id: 1, domain_type: other, ratio: {i: 2, j: 2}}}}" },
  { 0, "nestset", "{topology: t, association: element, windows: {w: {domain_id: 1, domain_type: child, ratio: {x: 2}}}}" },
  { 0, "nestset", "{topology: t, association: element, windows: {w: {domain_id: 1, domain_type: child, ratio: {i: 2, j: 2}, dims: {i: 3}}}}" },
  { 0, "coordset/index", "{type: uniform, path: p, coord_system: test}" },
  { 1, "coordset/index", "{type: uniform, path: p, coord_system: {type: cylindrical, axes: {r: 0, z: 0}}}" },
  { 1, "topology/index", "{type: points, coordset: c, path: p}" }, { 0, "topology/index", "{type: points, coordset: c, path: p, grid_function: 1}" },
  { 1, "field/index", "{number_of_components: 1, association: vertex, topology: t, path: p}" },
  { 0, "field/index", "{number_of_components: three, association: vertex, topology: t, path: p}" },
  { 0, "field/index", "{number_of_components: 1, association: vertex, path: p}" },
  { 1, "matset/index", "{topology: t, path: p, materials: {a: 1}}" }, { 0, "matset/index", "{topology: t, path: p}" },
  { 0, "specset/index", "{matset: m, path: p}" }, { 0, "adjset/index", "{topology: t, path: p}" },
  { 1, "nestset/index", "{topology: t, path: p, association: element}" },
};

static void verdicts(void)
{
  conduit_node *node = conduit_node_create(), *info = conduit_node_create();
  for (size_t i = 0; i < sizeof VERDICTS / sizeof VERDICTS[0]; ++i)
  {
    conduit_node_reset(node);
    conduit_node_parse(node, VERDICTS[i].yaml, "yaml");
    const int valid = conduit_blueprint_mesh_verify_sub_protocol(VERDICTS[i].protocol, node, info);
    if (valid != VERDICTS[i].valid)
    {
      fprintf(stderr, "%s: %s\n", VERDICTS[i].protocol, VERDICTS[i].yaml);
      conduit_node_print(info);
    }
    CHECK(valid == VERDICTS[i].valid);
  }
  conduit_node_destroy(node);
  conduit_node_destroy(info);
}

/* What is said of a whole mesh: its groups and what they name of each other. */
static void references(void)
{
  static const char* MESH =
    "{coordsets: {c: {type: uniform, dims: {i: 2, j: 2}}}, topologies: {t: {type: uniform, coordset: c, grid_function: f}},"
    " fields: {f: {association: vertex, topology: t, values: [1, 2, 3, 4]}, g: {association: element, matset: m, matset_values: {a: {u: [1], v: [2]}}}},"
    " matsets: {m: {topology: t, volume_fractions: {a: [0.25], b: [0.75]}}}, specsets: {s: {matset: m, matset_values: {a: {x: [0.5]}}}},"
    " adjsets: {n: {topology: t, association: vertex, groups: {}}},"
    " nestsets: {r: {topology: t, association: element, windows: {w: {domain_id: 1, domain_type: parent, ratio: {i: 2, j: 2}}}}}}";
  static const struct
  {
    const char* path;
    const char* yaml;
  } BROKEN[] = {
    { "topologies/t/grid_function", "nothing" }, { "fields/f/topology", "nothing" }, { "fields", "{}" },
    { "fields/g/matset", "nothing" }, { "specsets/s/matset", "nothing" }, { "adjsets/n/topology", "nothing" },
    { "nestsets/r/topology", "nothing" }, { "matsets/m/topology", "nothing" }, { "matsets", "text" },
    { "coordsets", "{}" }, { "topologies", "1" },
  };
  conduit_node *node = conduit_node_create(), *info = conduit_node_create(), *index = conduit_node_create();
  conduit_node_parse(node, MESH, "yaml");
  CHECK(conduit_blueprint_mesh_verify(node, info));
  conduit_blueprint_mesh_generate_index(node, "mesh", 1, index);
  CHECK(conduit_blueprint_mesh_verify_sub_protocol("index", index, info));
  CHECK(conduit_node_fetch_path_as_int64(index, "matsets/m/material_map/b") == 1);
  CHECK(conduit_node_has_path(index, "specsets/s/species/x"));
  CHECK(conduit_node_fetch_path_as_int64(index, "fields/g/number_of_components") == 2);
  conduit_node_set_path_char8_str(index, "fields/f/topology", "nothing");
  CHECK(!conduit_blueprint_mesh_verify_sub_protocol("index", index, info));
  for (size_t i = 0; i < sizeof BROKEN / sizeof BROKEN[0]; ++i)
  {
    conduit_node_parse(node, MESH, "yaml");
    conduit_node* part = conduit_node_fetch(node, BROKEN[i].path);
    conduit_node_reset(part);
    conduit_node_parse(part, BROKEN[i].yaml, "yaml");
    if (conduit_blueprint_mesh_verify(node, info)) fprintf(stderr, "%s\n", BROKEN[i].path);
    CHECK(!conduit_blueprint_mesh_verify(node, info));
  }
  conduit_node_set_int(node, 1);
  CHECK(!conduit_blueprint_mesh_verify(node, info));
  conduit_node_destroy(node);
  conduit_node_destroy(info);
  conduit_node_destroy(index);
}

/* Two wedges above each other as polyhedra, which share a face; and beside a tetrahedron. */
static void polyhedra(void)
{
  static const char* WEDGES =
    "coordsets: {c: {type: explicit, values: {x: [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0],"
    "  y: [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], z: [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0]}}}\n"
    "topologies: {t: {type: unstructured, coordset: c,"
    "  elements: {shape: polyhedral, connectivity: [0, 1, 2, 3, 4, 1, 5, 6, 7, 8], sizes: [5, 5], offsets: [0, 5]},"
    "  subelements: {shape: polygonal, connectivity: [0, 2, 1, 3, 4, 5, 0, 1, 4, 3, 1, 2, 5, 4, 2, 0, 3, 5,"
    "    6, 7, 8, 3, 4, 7, 6, 4, 5, 8, 7, 5, 3, 6, 8], sizes: [3, 3, 4, 4, 4, 3, 4, 4, 4],"
    "    offsets: [0, 3, 6, 10, 14, 18, 21, 25, 29]}}}\n"
    "fields: {f: {association: element, topology: t, values: [10, 20]}}\n";
  conduit_node *mesh = conduit_node_create(), *options = conduit_node_create(), *info = conduit_node_create();
  conduit_node *parts = conduit_node_create(), *whole = conduit_node_create();
  conduit_node_parse(mesh, WEDGES, "yaml");
  CHECK(conduit_blueprint_mesh_verify(mesh, info));
  conduit_blueprint_mesh_flatten(mesh, NULL, whole);
  CHECK(conduit_node_fetch_path_as_float64_ptr(whole, "element_data/values/element_centers/z")[0] == 0.5);
  CHECK(conduit_node_fetch_path_as_float64_ptr(whole, "element_data/values/element_centers/z")[1] == 1.5);
  conduit_node_set_path_int(options, "target", 2);
  conduit_blueprint_mesh_partition(mesh, options, parts);
  CHECK(conduit_node_number_of_children(parts) == 2 && conduit_blueprint_mesh_verify(parts, info));
  for (int i = 0; i < 2; ++i)
  {
    conduit_node* part = conduit_node_child(parts, i);
    CHECK(conduit_node_number_of_elements(conduit_node_fetch(part, "coordsets/c/values/x")) == 6);
    CHECK(conduit_node_number_of_elements(conduit_node_fetch(part, "topologies/t/subelements/sizes")) == 5);
    CHECK(conduit_node_fetch_path_as_int64(part, "fields/f/values") == 10 * (i + 1));
  }
  /* Joined again they share the face between them, and its three vertices. */
  conduit_node_set_path_int(options, "target", 1);
  conduit_blueprint_mesh_partition(parts, options, whole);
  CHECK(conduit_blueprint_mesh_verify(whole, info));
  CHECK(conduit_node_number_of_elements(conduit_node_fetch(whole, "coordsets/c/values/x")) == 9);
  CHECK(conduit_node_number_of_elements(conduit_node_fetch(whole, "topologies/t/subelements/sizes")) == 9);
  CHECK(conduit_node_number_of_elements(conduit_node_fetch(whole, "topologies/t/elements/connectivity")) == 10);
  /* Beside another shape. */
  conduit_node* tetrahedron = conduit_node_fetch(parts, "more");
  conduit_node_parse(tetrahedron,
    "coordsets: {c: {type: explicit, values: {x: [0.0, 1.0, 0.0, 0.0], y: [0.0, 0.0, 1.0, 0.0], z: [2.0, 2.0, 2.0, 3.0]}}}\n"
    "topologies: {t: {type: unstructured, coordset: c, elements: {shape: tet, connectivity: [0, 1, 2, 3]}}}\n",
    "yaml");
  conduit_blueprint_mesh_partition(parts, options, whole);
  CHECK(conduit_blueprint_mesh_verify(whole, info));
  CHECK(strcmp(conduit_node_fetch_path_as_char8_str(whole, "topologies/t/elements/shape"), "mixed") == 0);
  CHECK(conduit_node_number_of_elements(conduit_node_fetch(whole, "coordsets/c/values/x")) == 10);
  conduit_blueprint_mesh_flatten(whole, NULL, parts);
  CHECK(conduit_node_fetch_path_as_float64_ptr(parts, "element_data/values/element_centers/z")[2] == 2.25);
  /* A face that is not there. */
  conduit_int64 faces[10] = { 0, 1, 2, 3, 99, 1, 5, 6, 7, 8 };
  conduit_node_set_path_int64_ptr(mesh, "topologies/t/elements/connectivity", faces, 10);
  conduit_blueprint_mesh_flatten(mesh, NULL, parts);
  CHECK(strstr(last, "face 99 of 9") != NULL);
  conduit_node_destroy(mesh);
  conduit_node_destroy(options);
  conduit_node_destroy(info);
  conduit_node_destroy(parts);
  conduit_node_destroy(whole);
}

static int fails(const char* protocol, const char* yaml, const char* path, const char* told)
{
  conduit_node *node = conduit_node_create(), *info = conduit_node_create();
  conduit_node_parse(node, yaml, "yaml");
  int valid = conduit_blueprint_verify(protocol, node, info);
  CHECK(strcmp(conduit_node_fetch_path_as_char8_str(info, "valid"), valid ? "true" : "false") == 0);
  int found = !valid && strstr(conduit_node_fetch_path_as_char8_str(info, path), told) != NULL;
  if (!found) conduit_node_print(info);
  conduit_node_destroy(node);
  conduit_node_destroy(info);
  return found;
}

static void blueprint(void)
{
  const char* mesh = "coordsets: {c: {type: explicit, values: {x: [0.0, 1.0, 0.0, 0.0], y: [0.0, 0.0, 1.0, 0.0], z: [0.0, 0.0, 0.0, 1.0]}}}\n"
                     "topologies: {t: {type: unstructured, coordset: c, elements: {shape: tet, connectivity: [0, 1, 2, 3]}}}\n"
                     "fields: {f: {association: vertex, topology: t, values: [1.0, 2.0, 3.0, 4.0]}}\n";
  conduit_node *node = conduit_node_create(), *info = conduit_node_create(), *index = conduit_node_create();
  /* A rank may have no domain. */
  CHECK(conduit_blueprint_mesh_verify(node, info));
  conduit_node_parse(node, mesh, "yaml");
  CHECK(conduit_blueprint_mesh_verify(node, info) && conduit_blueprint_verify("mesh", node, info));
  CHECK(conduit_blueprint_mesh_verify_sub_protocol("topology", conduit_node_fetch(node, "topologies/t"), info));
  CHECK(!conduit_blueprint_mesh_verify_sub_protocol("coordset", conduit_node_fetch(node, "topologies/t"), info));
  CHECK(!conduit_blueprint_mesh_verify_sub_protocol("nonsense", node, info));
  CHECK(conduit_blueprint_mcarray_verify(conduit_node_fetch(node, "coordsets/c/values"), info));
  CHECK(!conduit_blueprint_mcarray_verify_sub_protocol("sub", node, info));
  conduit_blueprint_mesh_generate_index(node, "", 1, index);
  CHECK(conduit_blueprint_mesh_verify_sub_protocol("index", index, info));
  CHECK(conduit_node_fetch_path_as_int64(index, "fields/f/number_of_components") == 1);
  conduit_node_set_node(conduit_node_fetch(index, "domains/one"), node);
  CHECK(conduit_blueprint_mesh_verify(conduit_node_fetch(index, "domains"), info));
  CHECK(fails("mesh", "coordsets: {c: {type: wrong}}\ntopologies: {t: {type: points, coordset: c}}", "coordsets/c/errors/[0]",
    "'coordsets/c/type': 'wrong' is none of uniform, rectilinear, explicit"));
  CHECK(fails("mesh", "coordsets: {c: {type: uniform, dims: {i: 3}}}\ntopologies: {t: {type: uniform, coordset: d}}",
    "topologies/t/errors/[0]", "there is no 'd' in 'coordsets'; there are [c]"));
  CHECK(fails("mesh/coordset", "{type: explicit, values: {x: [0.0, 1.0], y: [0.0]}}", "errors/[0]", "1 elements"));
  CHECK(fails("mesh/field", "{association: face, topology: t, values: [1]}", "errors/[0]", "'face' is none of vertex, element"));
  CHECK(fails("table", "{values: {a: [1, 2], b: [1, 2, 3]}}", "values/b/errors/[0]", "3 rows"));
  CHECK(fails("o2mrelation", "{a: [0.5], offsets: [0]}", "errors/[0]", "one is missing"));
  CHECK(fails("o2mrelation", "{a: {b: [0.5]}, sizes: [1], offsets: [0]}", "errors/[0]", "no data"));
  CHECK(fails("mash", "{}", "errors/[0]", "there are mesh, mcarray"));
  conduit_node_parse(index, "{one: {values: {a: [1, 2, 3], b: {u: [1, 2, 3], v: [4, 5, 6]}}}, two: {values: {c: 1}}}", "yaml");
  CHECK(conduit_blueprint_table_verify(index, info) && conduit_node_fetch_path_as_int64(info, "tables") == 2);
  CHECK(conduit_node_fetch_path_as_int64(info, "one/values/rows") == 3);
  CHECK(conduit_node_fetch_path_as_int64(info, "one/values/columns") == 2);
  CHECK(conduit_node_fetch_path_as_int64(info, "two/values/c/elements") == 1);
  CHECK(!conduit_blueprint_table_verify(info, index) && !conduit_blueprint_table_verify_sub_protocol("sub", node, index));
  conduit_blueprint_about(info);
  CHECK(!strcmp(conduit_node_fetch_path_as_char8_str(info, "protocols/mesh/coordset"), "enabled"));
  CHECK(!strcmp(conduit_node_fetch_path_as_char8_str(info, "protocols/table"), "enabled"));
  conduit_about(info);
  CHECK(conduit_node_has_path(info, "version"));
  conduit_node_destroy(node);
  conduit_node_destroy(info);
  conduit_node_destroy(index);
}

/* A grid of 3 by 2 elements, cut, joined and made a table. */
static void partition(void)
{
  const char* grid = "coordsets: {c: {type: uniform, dims: {i: 4, j: 3}, spacing: {dx: 0.5, dy: 2.0}}}\n"
                     "topologies: {t: {type: uniform, coordset: c}}\n"
                     "fields: {e: {association: element, topology: t, values: [0, 1, 2, 3, 4, 5]},\n"
                     "  v: {association: vertex, topology: t, values: {a: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11],\n"
                     "                                                b: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]}}}\n";
  conduit_node *mesh = conduit_node_create(), *options = conduit_node_create(), *info = conduit_node_create();
  conduit_node *parts = conduit_node_create(), *whole = conduit_node_create();
  conduit_node_parse(mesh, grid, "yaml");
  conduit_blueprint_mesh_flatten(mesh, NULL, whole);
  CHECK(conduit_blueprint_table_verify(whole, info));
  CHECK(conduit_node_fetch_path_as_float64_ptr(whole, "element_data/values/element_centers/y")[5] == 3.0);
  CHECK(conduit_node_fetch_path_as_float64_ptr(whole, "vertex_data/values/c/x")[5] == 0.5);
  CHECK(conduit_node_fetch_path_as_int64_ptr(whole, "vertex_data/values/vertex_id")[11] == 11);
  CHECK(conduit_node_fetch_path_as_int64_ptr(whole, "element_data/values/domain_id")[5] == 0);
  CHECK(conduit_node_fetch_path_as_int64_ptr(whole, "vertex_data/values/v/b")[11] == 11);
  conduit_node_set_path_int(options, "target", 4);
  conduit_blueprint_mesh_partition(mesh, options, parts);
  CHECK(conduit_node_number_of_children(parts) == 4 && conduit_blueprint_mesh_verify(parts, info));
  conduit_int64 sum = 0;
  for (int i = 0; i < 4; ++i)
  {
    conduit_node* values = conduit_node_fetch_existing(conduit_node_child(parts, i), "fields/e/values");
    for (int j = 0; j < conduit_node_number_of_elements(values); ++j) sum += conduit_node_as_int64_ptr(values)[j];
  }
  CHECK(sum == 15);
  conduit_node_set_path_int(options, "target", 1);
  conduit_blueprint_mesh_partition(parts, options, whole);
  CHECK(conduit_blueprint_mesh_verify(whole, info));
  /* Each point is there once again, and each value where its point is. */
  CHECK(conduit_node_number_of_elements(conduit_node_fetch(whole, "coordsets/c/values/x")) == 12);
  CHECK(conduit_node_number_of_elements(conduit_node_fetch(whole, "topologies/t/elements/connectivity")) == 24);
  for (int i = 0; i < 12; ++i)
    CHECK(conduit_node_fetch_path_as_int64_ptr(whole, "fields/v/values/a")[i] ==
      (int)(conduit_node_fetch_path_as_float64_ptr(whole, "coordsets/c/values/x")[i] / 0.5) +
        4 * (int)(conduit_node_fetch_path_as_float64_ptr(whole, "coordsets/c/values/y")[i] / 2.0));
  conduit_node_parse(options, "{selections: [{type: logical, start: [1, 0], end: [2, 1]}, {type: explicit, elements: [0]}]}", "yaml");
  conduit_blueprint_mesh_partition(mesh, options, parts);
  CHECK(conduit_node_fetch_path_as_int64_ptr(parts, "domain_00000/fields/original_element_ids/values/ids")[2] == 4);
  CHECK(conduit_node_fetch_path_as_int64(parts, "domain_00001/fields/e/values") == 0);
  CHECK(conduit_node_fetch_path_as_int64_ptr(parts, "domain_00001/fields/original_vertex_ids/values/ids")[2] == 5);
  conduit_node_parse(options, "{mapping: 0, fields: [e], target: 0}", "yaml");
  conduit_blueprint_mesh_partition(mesh, options, parts);
  CHECK(conduit_node_number_of_children(conduit_node_fetch(parts, "fields")) == 1);
  CHECK(conduit_node_has_path(parts, "fields/e/values"));
  /* Selections go by the numbers that domains say; pieces by those that a field, or the selection, says. */
  conduit_node_set_node(conduit_node_fetch(whole, "two/a"), mesh);
  conduit_node_set_node(conduit_node_fetch(whole, "two/b"), mesh);
  conduit_node_set_path_int(whole, "two/a/state/domain_id", 10);
  conduit_node_set_path_int(whole, "two/b/state/domain_id", 20);
  conduit_node* two = conduit_node_fetch(whole, "two");
  conduit_node_parse(options, "{selections: [{type: explicit, domain_id: 20, elements: [4]}, {type: explicit, elements: [99]}],"
    " original_element_ids: from}", "yaml");
  conduit_blueprint_mesh_partition(two, options, parts);
  CHECK(conduit_node_fetch_path_as_int64(parts, "fields/from/values/domains") == 20);
  CHECK(conduit_node_fetch_path_as_int64(parts, "fields/from/values/ids") == 4);
  conduit_node_parse(options, "{selections: [{type: field, domain_id: any, field: e}]}", "yaml");
  conduit_blueprint_mesh_partition(two, options, parts);
  CHECK(conduit_node_number_of_children(parts) == 6);
  CHECK(conduit_node_fetch_path_as_int64_ptr(parts, "domain_00005/fields/original_element_ids/values/domains")[1] == 20);
  conduit_node_parse(options, "{selections: [{type: ranges, domain_id: 10, ranges: [1, 2], destination_domain: 7},"
    " {type: explicit, domain_id: 20, elements: [5], destination_domain: 7}, {type: explicit, domain_id: 10, elements: [0]}]}", "yaml");
  conduit_blueprint_mesh_partition(two, options, parts);
  CHECK(conduit_node_number_of_children(parts) == 2);
  CHECK(conduit_node_fetch_path_as_int64_ptr(parts, "domain_00007/fields/e/values")[2] == 5);
  CHECK(conduit_node_fetch_path_as_int64(parts, "domain_00000/fields/e/values") == 0);
  conduit_node_parse(options, "{selections: [{type: explicit, elements: [7]}]}", "yaml");
  conduit_blueprint_mesh_partition(mesh, options, parts);
  CHECK(strstr(last, "element 7 of 6") != NULL);
  conduit_node_destroy(mesh);
  conduit_node_destroy(options);
  conduit_node_destroy(info);
  conduit_node_destroy(parts);
  conduit_node_destroy(whole);
}

/* Two domains as tables: their numbers, a field that one has not, types, and what may be left out. */
static void tables(void)
{
  conduit_node *mesh = conduit_node_create(), *options = conduit_node_create();
  conduit_node *out = conduit_node_create(), *info = conduit_node_create();
  conduit_node_parse(mesh,
    "a: {state: {domain_id: 7}, coordsets: {cyl: {type: uniform, dims: {i: 3, j: 1}, origin: {r: 1.0, z: 5.0}}},\n"
    "  topologies: {t: {type: points, coordset: cyl}}, fields: {f: {association: vertex, topology: t, values: [1, 2, 3]}}}\n"
    "b: {state: {domain_id: 3}, coordsets: {cyl: {type: explicit, values: {r: [0.0, 1.0], z: [0.0, 2.0]}}},\n"
    "  topologies: {t: {type: unstructured, coordset: cyl, elements: {shape: line, connectivity: [0, 1]}}},\n"
    "  fields: {g: {association: vertex, topology: t, values: {u: [0.5, 1.5], v: [1, 2]}}}}\n", "yaml");
  float single[] = { 2.0F };
  conduit_node_set_path_float32_ptr(mesh, "b/fields/h/values", single, 1);
  conduit_node_set_path_char8_str(mesh, "b/fields/h/topology", "t");
  conduit_node_set_path_char8_str(mesh, "b/fields/h/association", "element");
  conduit_node_parse(options, "{fill_value: {int: -1, float: 0.25}}", "yaml");
  conduit_blueprint_mesh_flatten(mesh, options, out);
  CHECK(conduit_blueprint_table_verify(out, info));
  CHECK(conduit_node_fetch_path_as_int64(info, "vertex_data/values/rows") == 5);
  CHECK(conduit_node_fetch_path_as_float64_ptr(out, "vertex_data/values/cyl/r")[2] == 3.0);
  CHECK(conduit_node_fetch_path_as_float64_ptr(out, "vertex_data/values/cyl/z")[2] == 5.0);
  CHECK(conduit_node_fetch_path_as_int64_ptr(out, "vertex_data/values/f")[4] == -1);
  CHECK(conduit_node_fetch_path_as_float64_ptr(out, "vertex_data/values/g/v")[0] == 0.25);
  CHECK(conduit_node_fetch_path_as_float64_ptr(out, "vertex_data/values/g/v")[4] == 2.0);
  CHECK(conduit_node_fetch_path_as_float32_ptr(out, "element_data/values/h")[0] == 0.25F);
  CHECK(conduit_node_fetch_path_as_float32_ptr(out, "element_data/values/h")[3] == 2.0F);
  CHECK(conduit_node_fetch_path_as_float64_ptr(out, "element_data/values/element_centers/z")[3] == 1.0);
  CHECK(conduit_node_fetch_path_as_int64_ptr(out, "vertex_data/values/domain_id")[2] == 7);
  CHECK(conduit_node_fetch_path_as_int64_ptr(out, "vertex_data/values/domain_id")[3] == 3);
  CHECK(conduit_node_fetch_path_as_int64_ptr(out, "vertex_data/values/vertex_id")[3] == 0);
  CHECK(conduit_node_fetch_path_as_int64_ptr(out, "element_data/values/element_id")[2] == 2);
  conduit_node_parse(options, "{field_names: [g], add_element_centers: 0, add_vertex_locations: 0, add_domain_info: 0}", "yaml");
  conduit_blueprint_mesh_flatten(mesh, options, out);
  CHECK(!conduit_node_has_child(out, "element_data"));
  CHECK(conduit_node_number_of_children(conduit_node_fetch(out, "vertex_data/values")) == 1);
  conduit_node_parse(options, "{field_names: g}", "yaml");
  conduit_blueprint_mesh_flatten(mesh, options, out);
  CHECK(strstr(last, "'field_names' is no list") != NULL);
  /* Four faces of a pyramid have its tip, three have each other vertex. */
  conduit_node_parse(mesh,
    "coordsets: {c: {type: explicit, values: {z: [0.0, 0.0, 0.0, 0.0, 1.0]}}}\n"
    "topologies: {t: {type: unstructured, coordset: c, elements: {shape: polyhedral, connectivity: [0, 1, 2, 3, 4], sizes: [5],\n"
    "  offsets: [0]}, subelements: {shape: polygonal, connectivity: [0, 1, 2, 3, 0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4],\n"
    "  sizes: [4, 3, 3, 3, 3], offsets: [0, 4, 7, 10, 13]}}}\n", "yaml");
  conduit_blueprint_mesh_flatten(mesh, NULL, out);
  CHECK(conduit_node_fetch_path_as_float64(out, "element_data/values/element_centers/z") == 0.25);
  conduit_node_reset(mesh);
  conduit_blueprint_mesh_flatten(mesh, NULL, out);
  CHECK(conduit_node_number_of_children(out) == 0);
  conduit_node_destroy(mesh);
  conduit_node_destroy(options);
  conduit_node_destroy(out);
  conduit_node_destroy(info);
}

int main(void)
{
  conduit_utils_set_error_handler(note);
  blueprint();
  verdicts();
  references();
  partition();
  tables();
  polyhedra();
  puts("blueprint.c: ok");
  return 0;
}
