//! Pictures of extracts, drawn without a graphics card or a display.
//!
//! Each rank draws the faces, lines and points that it has, and of what several have drawn at a
//! place the nearest stays (`raster`). A picture is the same to the last bit on every machine and
//! on any number of ranks: what is drawn is rounded first (`lattice`), and only operations are
//! used whose rounding is fixed (`angle`).

mod angle;
mod annotate;
mod camera;
mod clip;
mod colour;
mod image;
mod lattice;
mod normals;
mod raster;
mod scene;
mod text;

use std::sync::Arc;
use tombolo_deform::bounds::Bounds;

use tombolo_deform::communicator::{Communicator, Reduction, Solo, agree};
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::dot;

use crate::extract::{Extract, Field, Shown, unknown_field};
use crate::language::{Camera, Color, Component, Render, Shading, Viewpoint, picture_pattern};
use annotate::Annotation;
use camera::View;
use colour::Palette;
pub use image::Image;
use lattice::Lattice;
use raster::{Band, Corner, EMPTY, Pen, Placed};
use scene::{Scene, Values};

/// The samples that are drawn at once, so that they stay near the processor.
const SAMPLES: usize = 1 << 18;

/// A picture with what is known of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The camera's name.
    pub camera: String,
    /// The camera's azimuth and elevation in degrees, where it has them.
    pub angles: Option<[f64; 2]>,
    /// The values of the first and the last colour, where a field colours.
    pub range: Option<[f64; 2]>,
    /// The picture.
    pub image: Image,
}

/// The extract that is drawn, and the step.
pub(crate) struct Subject<'a> {
    pub(crate) shown: &'a Shown,
    /// The field that colours; `None` where the stage names none, or this rank has nothing.
    pub(crate) field: Option<&'a Field>,
    pub(crate) cycle: u64,
    pub(crate) time: f64,
}

/// Draws the pictures of a stage, one for each camera; on rank 0, the others have none. Collective.
///
/// # Errors
/// A text where the field cannot colour; the same on all ranks.
pub(crate) fn render(
    stage: &Render,
    subject: &Subject,
    communicator: &dyn Communicator,
) -> Result<Vec<Picture>, String> {
    let told = |error: &dyn std::fmt::Display| error.to_string();
    let values = subject.field.map(|field| Values::new(field, stage.component)).transpose();
    let values = agree(communicator, values).map_err(|error| told(&error.message))?;
    let bounds = scene::bounds(communicator, subject.shown);
    let bounds = bounds.unwrap_or(Bounds { lower: [0.0; 3], upper: [1.0; 3] });
    let range = match stage.range {
        Some(range) => Some(range),
        None => Values::range(communicator, values.as_ref()),
    };
    let range = range.filter(|_| stage.field.is_some());
    let values = values.zip(range).map(|(values, range)| values.within(range));
    let lattice = Lattice::new(&bounds);
    let scene = Scene::new(subject.shown, &lattice, values.as_ref());
    let normals = match stage.shading {
        Shading::None => Vec::new(),
        _ => normals::of_faces(&scene, &lattice),
    };
    let of_corners = match stage.shading {
        Shading::Smooth => normals::of_corners(communicator, &scene, subject.shown, &normals)
            .map_err(|error| told(&error))?,
        _ => Vec::new(),
    };
    let drawing = Drawing {
        stage,
        scene: &scene,
        lattice: &lattice,
        bounds: &bounds,
        normals: &normals,
        of_corners: &of_corners,
        palette: &Palette::new(stage.color_map),
        range,
        communicator,
    };
    let mut pictures = Vec::new();
    for (name, camera) in stage.all_cameras() {
        let caption = stage.caption.as_ref();
        let caption = caption
            .map(|text| picture_pattern(text, subject.cycle, subject.time, &name))
            .transpose()
            .map_err(|problem| told(&problem))?;
        pictures.extend(drawing.picture(name, &camera, caption));
    }
    Ok(pictures)
}

/// Draws pictures of an extract that is all on this process, one for each camera of a stage.
///
/// # Errors
/// A text where there is no such field, or it cannot colour.
pub fn draw(
    stage: &Render,
    extract: &Arc<Extract>,
    cycle: u64,
    time: f64,
) -> Result<Vec<Picture>, String> {
    let known = |name: &String| {
        let found = extract.fields.iter().find(|field| field.name == *name);
        found.ok_or_else(|| unknown_field(name, extract.fields.iter().map(|it| it.name.as_str())))
    };
    let field = stage.field.as_ref().map(known).transpose()?;
    let shown = Shown { extract: Arc::clone(extract), shared: Vec::new() };
    render(stage, &Subject { shown: &shown, field, cycle, time }, &Solo)
}

/// All that the pictures of a step have in common.
struct Drawing<'a> {
    stage: &'a Render,
    scene: &'a Scene,
    lattice: &'a Lattice,
    bounds: &'a Bounds,
    normals: &'a [Vector],
    of_corners: &'a [Vector],
    palette: &'a Palette,
    range: Option<[f64; 2]>,
    communicator: &'a dyn Communicator,
}

impl Drawing<'_> {
    /// The picture of one camera, on rank 0. Collective.
    fn picture(&self, name: String, camera: &Camera, caption: Option<String>) -> Option<Picture> {
        let stage = self.stage;
        let title = stage.title.clone().unwrap_or_else(|| self.title());
        let bar = self.range.map(|range| (self.palette, range, title));
        let annotation = Annotation::new(stage, bar, caption);
        let size = [f64::from(stage.width), f64::from(stage.height)];
        let [lower, upper] = self.bounds.corners().map(|corner| self.lattice.relative(corner));
        let camera = self.placed(camera);
        let bounds = Bounds { lower, upper };
        let view = View::new(&camera, &bounds, size, annotation.viewport());
        let per_pixel = stage.samples as usize;
        let color = |value: f64, light: f64| self.color(value, light);
        let step = f64::from(stage.samples) * 256.0;
        let edge = if stage.edges { 0.4 * step } else { 0.0 };
        let pen = Pen { view: &view, samples: f64::from(stage.samples), color: &color, edge };

        let width = stage.width as usize * per_pixel;
        // Whole rows of pixels at a time.
        let rows = (SAMPLES / width / per_pixel).max(1) * per_pixel;
        let all = stage.height as usize * per_pixel;
        let sorted = self.sorted(&pen, size, rows, all.div_ceil(rows));
        let Color(background) = stage.background;
        let is_first = self.communicator.rank() == 0;
        let mut image = is_first.then(|| Image::new(stage.width, stage.height, background));
        for (number, first) in (0..all).step_by(rows).enumerate() {
            let mut band = Band::new(width, first, rows.min(all - first));
            for &face in sorted.faces.of(number) {
                self.face(&pen, size, face as usize, &mut |triangle| {
                    pen.triangle(&mut band, triangle)
                });
            }
            for &line in sorted.lines.of(number) {
                let half = 0.5 * stage.line_width * step;
                if let Some(ends) = self.line(&pen, size, line as usize) {
                    pen.line(&mut band, ends, half);
                }
            }
            for &dot in sorted.dots.of(number) {
                let half = 0.5 * stage.point_size * step;
                if let Some(ends) = self.dot(&pen, size, dot as usize) {
                    pen.line(&mut band, ends, half);
                }
            }
            self.communicator.reduce_integers(Reduction::Minimum, &mut band.samples);
            if let Some(image) = &mut image {
                resolve(&band, per_pixel, background, image);
            }
        }
        let mut image = image?;
        annotation.draw(&mut image, &view);
        let angles = match camera.viewpoint {
            Viewpoint::Around { azimuth, elevation, .. } => Some([azimuth, elevation]),
            Viewpoint::At { .. } => None,
        };
        Some(Picture { camera: name, angles, range: self.range, image })
    }

    /// The camera with its points from the origin of the lattice.
    fn placed(&self, camera: &Camera) -> Camera {
        let mut camera = camera.clone();
        match &mut camera.viewpoint {
            Viewpoint::At { position, focal_point } => {
                *position = self.lattice.relative(*position);
                *focal_point = self.lattice.relative(*focal_point);
            }
            Viewpoint::Around { bounds: Some(bounds), .. } => {
                bounds.lower = self.lattice.relative(bounds.lower);
                bounds.upper = self.lattice.relative(bounds.upper);
            }
            Viewpoint::Around { bounds: None, .. } => {}
        }
        camera
    }

    fn title(&self) -> String {
        let field = self.stage.field.clone().unwrap_or_default();
        match self.stage.component {
            Component::Magnitude => field,
            component => format!("{field} {}", String::from(component)),
        }
    }

    fn color(&self, value: f64, light: f64) -> [u8; 3] {
        let Color(plain) = self.stage.color;
        let own = match self.range {
            Some(_) if value.is_nan() => [0x80; 3],
            Some(_) => self.palette.color(value),
            None => plain,
        };
        // In whole numbers, so that a brightness of 1 leaves a colour as it is.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to 1024, and bytes"
        )]
        let light = (light.clamp(0.0, 1.0) * 1024.0 + 0.5) as u32;
        #[expect(clippy::cast_possible_truncation, reason = "a part of a byte")]
        own.map(|channel| ((u32::from(channel) * light + 512) / 1024) as u8)
    }

    fn value(&self, point: u32, of_cell: f64) -> f64 {
        self.scene.of_points.as_ref().map_or(of_cell, |values| values[point as usize])
    }

    fn corner(&self, pen: &Pen, point: u32, of_cell: f64, light: f64) -> Corner {
        let position = self.lattice.position(self.scene.points[point as usize]);
        let value = self.value(point, of_cell);
        Corner { seen: pen.view.see(position), value, light, is_edge: true }
    }

    /// The triangles of a face as they lie in the picture.
    fn face(&self, pen: &Pen, size: [f64; 2], face: usize, take: &mut dyn FnMut([Placed; 3])) {
        let first = self.scene.offsets[face];
        let corner = |(index, &point): (usize, &u32)| {
            let normal = match self.stage.shading {
                Shading::Smooth => self.of_corners[first + index],
                Shading::Flat => self.normals[face],
                Shading::None => pen.view.away,
            };
            let light = 0.35 + 0.65 * dot(normal, pen.view.away).abs();
            self.corner(pen, point, self.scene.of_faces[face], light)
        };
        let mut corners: Vec<Corner> =
            self.scene.face(face).iter().enumerate().map(corner).collect();
        clip::polygon(pen.view, size, &mut corners);
        let placed: Vec<Placed> = corners.iter().map(|corner| pen.place(corner)).collect();
        for index in 1..placed.len().saturating_sub(1) {
            let inner = |corner: Placed| corner.without_edge();
            let is_last = index + 2 == placed.len();
            take([
                if index == 1 { placed[0] } else { inner(placed[0]) },
                placed[index],
                if is_last { placed[index + 1] } else { inner(placed[index + 1]) },
            ]);
        }
    }

    fn line(&self, pen: &Pen, size: [f64; 2], line: usize) -> Option<[Placed; 2]> {
        let value = self.scene.of_lines[line];
        let mut ends = self.scene.lines[line];
        // From the end that comes first in space, so that all ranks draw it alike.
        ends.sort_by_key(|&point| self.scene.points[point as usize]);
        let ends = ends.map(|point| self.corner(pen, point, value, 1.0));
        clip::line(pen.view, size, ends).map(|ends| ends.map(|end| pen.place(&end)))
    }

    fn dot(&self, pen: &Pen, size: [f64; 2], dot: usize) -> Option<[Placed; 2]> {
        let corner = self.corner(pen, self.scene.dots[dot], self.scene.of_dots[dot], 1.0);
        clip::line(pen.view, size, [corner; 2]).map(|ends| ends.map(|end| pen.place(&end)))
    }

    /// The elements to draw in each band.
    fn sorted(&self, pen: &Pen, size: [f64; 2], rows: usize, bands: usize) -> Sorted {
        let step = i64::from(self.stage.samples) * 256;
        #[expect(clippy::cast_possible_truncation, reason = "some pixels")]
        let reach = |pixels: f64| (0.5 * pixels * step as f64).ceil() as i64;
        let height = i64::try_from(rows).unwrap_or(i64::MAX) * 256;
        let mut sorted = Sorted {
            faces: Bands::new(bands, height),
            lines: Bands::new(bands, height),
            dots: Bands::new(bands, height),
        };
        for face in 0..self.scene.faces() {
            let mut span = None;
            self.face(pen, size, face, &mut |corners| {
                corners.iter().for_each(|corner| span = joined(span, corner.y, 0));
            });
            sorted.faces.push(face, span);
        }
        for line in 0..self.scene.lines.len() {
            let ends = self.line(pen, size, line);
            let reach = reach(self.stage.line_width);
            sorted.lines.push(
                line,
                ends.and_then(|ends| {
                    ends.iter().fold(None, |span, end| joined(span, end.y, reach))
                }),
            );
        }
        for dot in 0..self.scene.dots.len() {
            let ends = self.dot(pen, size, dot);
            let reach = reach(self.stage.point_size);
            sorted.dots.push(dot, ends.and_then(|[end, _]| joined(None, end.y, reach)));
        }
        sorted
    }
}

/// The heights between which something lies, and another.
fn joined(span: Option<[i64; 2]>, at: i64, reach: i64) -> Option<[i64; 2]> {
    let (least, most) = (at - reach, at + reach);
    Some(span.map_or([least, most], |[a, b]| [a.min(least), b.max(most)]))
}

struct Sorted {
    faces: Bands,
    lines: Bands,
    dots: Bands,
}

/// For each band of rows, the numbers of what lies there.
struct Bands {
    of_bands: Vec<Vec<u32>>,
    height: i64,
}

impl Bands {
    fn new(bands: usize, height: i64) -> Self {
        Self { of_bands: vec![Vec::new(); bands], height }
    }

    fn push(&mut self, number: usize, span: Option<[i64; 2]>) {
        let Some(span) = span else { return };
        let last = i64::try_from(self.of_bands.len()).unwrap_or(i64::MAX) - 1;
        let [first, end] = span.map(|at| at.div_euclid(self.height));
        for band in first.max(0)..=end.min(last) {
            if let Some(band) = usize::try_from(band).ok().and_then(|at| self.of_bands.get_mut(at))
            {
                #[expect(clippy::cast_possible_truncation, reason = "cells of 32 bits")]
                band.push(number as u32);
            }
        }
    }

    fn of(&self, band: usize) -> &[u32] {
        self.of_bands.get(band).map_or(&[], Vec::as_slice)
    }
}

/// The mean of the samples of each pixel.
fn resolve(band: &Band, per_pixel: usize, background: [u8; 3], image: &mut Image) {
    let columns = band.width / per_pixel;
    let count = u32::try_from(per_pixel * per_pixel).unwrap_or(1);
    for row in 0..band.rows / per_pixel {
        for column in 0..columns {
            let mut sums = [0_u32; 3];
            let mut is_empty = true;
            for line in 0..per_pixel {
                let start = (row * per_pixel + line) * band.width + column * per_pixel;
                for &sample in &band.samples[start..start + per_pixel] {
                    is_empty &= sample == EMPTY;
                    let color = raster::color(sample).unwrap_or(background);
                    (0..3).for_each(|channel| sums[channel] += u32::from(color[channel]));
                }
            }
            if !is_empty {
                #[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
                let color = sums.map(|sum| ((sum + count / 2) / count) as u8);
                image.set((band.first / per_pixel + row) * columns + column, color);
            }
        }
    }
}
