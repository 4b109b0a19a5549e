//! What the exports do, without the border.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde_json::json;
use tombolo_deform::edit::{Edit, EditError, Editor};
use tombolo_deform::mesh::{CellType, Cells, Vector};
use tombolo_deform::skeleton::SkeletonError;
use tombolo_deform::surface::{Surface, SurfaceError};
use tombolo_pipelines::encode::{DecodeError, DecodedFrame, Decoder, decode_surface};
use tombolo_pipelines::extract::Field;

use crate::{Array, checker};

/// The input of one call and the answer to it; the surfaces that are open.
#[derive(Default)]
pub struct Kernel {
    input: Vec<u8>,
    answer: Vec<Array>,
    surfaces: BTreeMap<u32, Open>,
    opened: u32,
    decoder: Decoder,
}

/// A surface that is open.
struct Open {
    editor: Editor,
    /// The last displacement that was asked for.
    displacement: Vec<Vector>,
}

/// Why a call failed. Its name in an answer is in brackets.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The surface was never opened, or is closed (`handle`).
    #[error("there is no open surface {0}")]
    Handle(u32),
    /// The input ends before its arrays do (`input`).
    #[error("the input has {found} bytes, {expected} are needed")]
    Input {
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A text that is not the JSON it should be (`json`).
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    /// A frame that cannot be read (`frame`).
    #[error(transparent)]
    Frame(#[from] DecodeError),
    /// Arrays that make no surface, or one that cannot be edited (`surface`).
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// Edits that this surface cannot follow (`edit`).
    #[error(transparent)]
    Edit(#[from] EditError),
    /// A surface that has no skeleton (`skeleton`).
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
}

impl Failure {
    /// The kind of failure, in one word.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Failure::Handle(_) => "handle",
            Failure::Input { .. } => "input",
            Failure::Json(_) => "json",
            Failure::Frame(_) => "frame",
            Failure::Surface(_) => "surface",
            Failure::Edit(_) => "edit",
            Failure::Skeleton(_) => "skeleton",
        }
    }
}

impl Kernel {
    /// A kernel with no surface open.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            input: Vec::new(),
            answer: Vec::new(),
            surfaces: BTreeMap::new(),
            opened: 0,
            decoder: Decoder::new(),
        }
    }

    /// Room for the next input; `None` where there is not so much memory.
    pub fn input(&mut self, bytes: usize) -> Option<&mut [u8]> {
        self.input.clear();
        self.input.try_reserve_exact(bytes).ok()?;
        self.input.resize(bytes, 0);
        Some(&mut self.input)
    }

    /// The arrays of the last answer.
    #[must_use]
    pub fn arrays(&self) -> &[Array] {
        &self.answer
    }

    /// Opens the surface of a frame: [`open_surface`](crate::open_surface).
    pub fn open_surface(&mut self) -> u32 {
        self.open(|input| Ok(decode_surface(input)?))
    }

    /// Opens the surface of arrays: [`create_surface`](crate::create_surface).
    pub fn create_surface(&mut self, points: usize, faces: usize, corners: usize) -> u32 {
        self.open(|input| surface_of_arrays(input, points, faces, corners))
    }

    fn open(&mut self, make: impl FnOnce(&[u8]) -> Result<Surface, Failure>) -> u32 {
        let input = std::mem::take(&mut self.input);
        match make(&input).and_then(|surface| Ok(Editor::new(Arc::new(surface))?)) {
            Ok(editor) => {
                self.opened = self.opened.wrapping_add(1).max(1);
                let displacement = vec![[0.0; 3]; editor.surface().points().len()];
                self.surfaces.insert(self.opened, Open { editor, displacement });
                self.settle(Ok(Vec::new()));
                self.opened
            }
            Err(failure) => {
                self.settle(Err(failure));
                0
            }
        }
    }

    /// Forgets a surface: [`close_surface`](crate::close_surface).
    pub fn close_surface(&mut self, surface: u32) {
        self.settle(Ok(Vec::new()));
        self.surfaces.remove(&surface);
    }

    /// Answers with the points, triangles and features of a surface:
    /// [`describe_surface`](crate::describe_surface).
    pub fn describe_surface(&mut self, surface: u32) -> bool {
        let answer = self.surface(surface).map(|open| {
            let surface = open.editor.surface();
            let features = surface.features();
            let of_triangles = surface
                .triangle_faces()
                .iter()
                .map(|&face| features.face_features()[face as usize])
                .collect();
            vec![
                Array::Vectors(surface.points().to_vec()),
                Array::Triangles(surface.triangles().to_vec()),
                Array::Numbers(of_triangles),
                Array::Numbers(surface.vertices().to_vec()),
                Array::Text(json!(features.names()).to_string()),
            ]
        });
        self.settle(answer)
    }

    /// Answers with the displacement that a stack of edits asks for:
    /// [`displacement`](crate::displacement).
    pub fn displacement(&mut self, surface: u32) -> bool {
        let input = std::mem::take(&mut self.input);
        let answer =
            serde_json::from_slice::<Vec<Edit>>(&input).map_err(Failure::from).and_then(|stack| {
                let open = self.surface(surface)?;
                open.displacement = open.editor.displacement(&stack)?;
                Ok(vec![Array::Vectors(open.displacement.clone())])
            });
        self.settle(answer)
    }

    /// Answers with the fault of the shape of the last displacement: [`check`](crate::check).
    pub fn check(&mut self, surface: u32) -> bool {
        let answer = self.surface(surface).map(|open| {
            let surface = open.editor.surface();
            let reference = surface.points();
            let shape: Vec<Vector> = reference
                .iter()
                .zip(&open.displacement)
                .map(|(point, by)| std::array::from_fn(|axis| point[axis] + by[axis]))
                .collect();
            let (report, flawed) =
                tombolo_deform::surface::check_triangles(surface, reference, &shape);
            let faces = surface.triangle_faces();
            let flawed: BTreeSet<u32> =
                flawed.into_iter().map(|triangle| faces[triangle as usize]).collect();
            let triangles =
                faces.iter().zip(0..).filter(|(face, _)| flawed.contains(face)).map(|pair| pair.1);
            let text = if report.is_sound() { String::new() } else { report.to_string() };
            vec![Array::Text(text), Array::Numbers(triangles.collect())]
        });
        self.settle(answer)
    }

    /// Answers with the skeleton of a surface: [`skeleton`](crate::skeleton).
    pub fn skeleton(&mut self, surface: u32) -> bool {
        let answer = self.surface(surface).and_then(|open| {
            let skeleton = open.editor.skeleton()?;
            let curves = skeleton.curves();
            let sizes = curves.iter().map(|curve| curve.nodes().len() as u32).collect();
            let nodes = curves.iter().flat_map(|curve| curve.nodes().iter().copied()).collect();
            Ok(vec![
                Array::Vectors(skeleton.nodes().to_vec()),
                Array::Numbers(sizes),
                Array::Numbers(nodes),
                Array::Numbers(skeleton.node_of_vertex().to_vec()),
            ])
        });
        self.settle(answer)
    }

    /// Answers with the header and the arrays of a frame: [`decode_frame`](crate::decode_frame).
    pub fn decode_frame(&mut self) -> bool {
        let input = std::mem::take(&mut self.input);
        let frame = self.decoder.decode(&input).map_err(Failure::from);
        self.settle(frame.map(arrays))
    }

    /// Answers with the errors of a pipeline: [`check_pipeline`](crate::check_pipeline).
    pub fn check_pipeline(&mut self) -> bool {
        let input = std::mem::take(&mut self.input);
        let errors = checker::check(&input).map_err(Failure::from);
        self.settle(errors.map(|errors| vec![Array::Text(errors)]))
    }

    fn surface(&mut self, surface: u32) -> Result<&mut Open, Failure> {
        self.surfaces.get_mut(&surface).ok_or(Failure::Handle(surface))
    }

    fn settle(&mut self, answer: Result<Vec<Array>, Failure>) -> bool {
        self.input = Vec::new();
        let done = answer.is_ok();
        self.answer = answer
            .unwrap_or_else(|failure| vec![Array::Text(format!("{}\n{failure}", failure.kind()))]);
        done
    }
}

/// The header of a frame, its points and fields, and its cells where it brought them.
fn arrays(frame: DecodedFrame) -> Vec<Array> {
    let field = |field: &Field| json!({"name": field.name, "association": field.association, "components": field.components});
    let cells = frame.cells.as_ref();
    let header = json!({
        "view": frame.view, "topology": format!("{:016x}", frame.topology),
        "cycle": frame.cycle, "time": frame.time, "points": frame.points.len(),
        "fields": frame.fields.iter().map(field).collect::<Vec<_>>(),
        "cells": cells.is_some(), "features": cells.is_some_and(|cells| cells.triangle_features.is_some()),
    });
    let mut arrays = vec![Array::Text(header.to_string()), singles(frame.points.as_flattened())];
    // A pressure of many bars has waves of some pascals: single precision would draw and read steps.
    arrays.extend(frame.fields.into_iter().map(|field| Array::Doubles(field.values)));
    if let Some(cells) = frame.cells {
        arrays.push(Array::Triangles(cells.triangles));
        arrays.push(Array::Numbers(cells.lines.into_flattened()));
        arrays.extend(cells.triangle_features.map(Array::Numbers));
    }
    arrays
}

#[expect(clippy::cast_possible_truncation, reason = "this is what is drawn")]
fn singles(values: &[f64]) -> Array {
    Array::Singles(values.iter().map(|&value| value as f32).collect())
}

fn surface_of_arrays(
    input: &[u8],
    points: usize,
    faces: usize,
    corners: usize,
) -> Result<Surface, Failure> {
    let mut rest = input;
    let mut expected = 0_usize;
    let mut take = |count: usize, size: usize| {
        let bytes = count.saturating_mul(size);
        expected = expected.saturating_add(bytes);
        let (taken, after) =
            rest.split_at_checked(bytes).ok_or(Failure::Input { found: input.len(), expected })?;
        rest = after;
        Ok::<_, Failure>(taken)
    };
    let coordinates: Vec<f64> = take(points, size_of::<Vector>())?
        .as_chunks()
        .0
        .iter()
        .map(|&bytes| f64::from_le_bytes(bytes))
        .collect();
    let mut numbers = |count: usize| -> Result<Vec<u32>, Failure> {
        Ok(take(count, size_of::<u32>())?
            .as_chunks()
            .0
            .iter()
            .map(|&bytes| u32::from_le_bytes(bytes))
            .collect())
    };
    let (vertices, sizes, connectivity, features) =
        (numbers(points)?, numbers(faces)?, numbers(corners)?, numbers(faces)?);
    let names: Vec<String> = serde_json::from_slice(rest)?;
    let mut cells = Cells::new();
    let mut start = 0_usize;
    for &size in &sizes {
        let end = start.saturating_add(size as usize);
        let face = connectivity
            .get(start..end)
            .ok_or(Failure::Input { found: connectivity.len(), expected: end })?;
        let cell_type = match size {
            3 => CellType::Triangle,
            4 => CellType::Quad,
            _ => CellType::Polygon,
        };
        cells.push(cell_type, face).map_err(SurfaceError::from)?;
        start = end;
    }
    Ok(Surface::from_faces(coordinates.as_chunks().0.to_vec(), vertices, cells, names, features)?)
}
