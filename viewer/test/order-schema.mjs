/** The schema of an order, laid out as serde and schemars lay it out. */
const names = { type: "array", items: { type: "string" } };
const vector = { type: "array", items: { type: "number", format: "double" }, minItems: 3, maxItems: 3 };
const edit = (properties, required, description) => ({
  type: "object", description, additionalProperties: false, required: ["features", ...required],
  properties: {
    features: { ...names, minItems: 1, description: "The features that make up the handle." },
    fixed: { ...names, default: [], description: "The features held where they are." },
    ...properties,
    harmonic_order: { $ref: "#/$defs/HarmonicOrder", default: 2, description: "How smoothly the surface between handle and fixed features follows." },
  },
});
const variant = (key, definition, description) => ({
  type: "object", description, properties: { [key]: { $ref: `#/$defs/${definition}` } }, required: [key], additionalProperties: false,
});
const setting = (definition) => ({ anyOf: [{ $ref: `#/$defs/${definition}` }, { type: "null" }] });
const settings = { schedule: setting("Schedule"), deform: setting("Deform"), guard: setting("Guard") };

export const ORDER_SCHEMA = {
  $schema: "https://json-schema.org/draft/2020-12/schema",
  title: "Order",
  anyOf: [
    { type: "object", properties: { edits: { type: "array", items: { $ref: "#/$defs/Edit" } }, ...settings }, required: ["edits"] },
    { type: "object", properties: { stack: { type: "array", items: { $ref: "#/$defs/Edit" } }, ...settings }, required: ["stack"] },
    { type: "object", properties: { undo: { type: "integer", minimum: 1 }, ...settings }, required: ["undo"] },
  ],
  $defs: {
    Edit: { oneOf: [
      variant("translate", "Translate", "Moves the handle as a rigid body."),
      variant("scale_normals", "ScaleNormals", "Moves every vertex of the handle along its own normal."),
      variant("scale_direction", "ScaleDirection", "Scales the handle along the axes about a centre."),
    ] },
    Translate: edit({ by: { ...vector, description: "How far the handle moves." } }, ["by"], "Moves features as one rigid body."),
    ScaleNormals: edit({ distance: { type: "number", format: "double" } }, ["distance"], "Moves features along their surface normals."),
    ScaleDirection: edit({ factors: vector, center: { ...vector, type: ["array", "null"], default: null } }, ["factors"], "Scales features along the axes about a centre."),
    HarmonicOrder: { type: "integer", minimum: 1, maximum: 3 },
    Schedule: { type: "object", properties: { steps: { type: "integer", minimum: 1, format: "uint32", default: 1 }, every: { $ref: "#/$defs/Every", default: { steps: 1 } } } },
    Every: { oneOf: [
      { type: "object", properties: { steps: { type: "integer", minimum: 1 } }, required: ["steps"], additionalProperties: false },
      { type: "object", properties: { time: { type: "number", exclusiveMinimum: 0 } }, required: ["time"], additionalProperties: false },
    ] },
    Deform: { type: "object", properties: {
      method: { oneOf: [{ type: "string", const: "elasticity" }, { type: "string", const: "harmonic" }], default: "elasticity" },
      stiffening: { type: "number", default: 1 }, poisson_ratio: { type: "number", minimum: 0, exclusiveMaximum: 0.5, default: 0.25 },
      tolerance: { type: "number", exclusiveMinimum: 0, default: 1e-8 },
    } },
    Guard: { type: "object", properties: { min_scaled_jacobian: { type: "number", default: 0.02 }, otherwise: { type: "string", enum: ["reject"], default: "reject" } } },
  },
};
