//! The scalar bar, the axes and the caption, which are laid over a picture.

use tombolo_deform::mesh::Vector;

use super::camera::{View, Viewport};
use super::colour::Palette;
use super::image::Image;
use super::text::{Anchor, Font, fill};
use crate::language::Render;

/// The labels beside the scene.
pub(super) struct Annotation<'a> {
    pub(super) stage: &'a Render,
    /// The colours, their range, and what they are of; `None` where no field colours.
    pub(super) bar: Option<(&'a Palette, [f64; 2], String)>,
    pub(super) caption: Option<String>,
    font: Font,
    /// The size of letters, from which all other sizes follow.
    size: f64,
}

/// The ticks of a bar: their values and texts.
type Ticks = Vec<(f64, String)>;

impl<'a> Annotation<'a> {
    pub(super) fn new(
        stage: &'a Render,
        bar: Option<(&'a Palette, [f64; 2], String)>,
        caption: Option<String>,
    ) -> Self {
        let least = f64::from(stage.width.min(stage.height));
        let size = (least / 36.0).max(9.0);
        let bar = bar.filter(|_| stage.scalar_bar);
        Self { stage, bar, caption, font: Font::new(size), size }
    }

    /// The part of the picture that is left to the scene.
    pub(super) fn viewport(&self) -> Viewport {
        let (width, height) = (f64::from(self.stage.width), f64::from(self.stage.height));
        let aside = self.bar.as_ref().map_or(0.0, |(_, range, _)| {
            let ticks = ticks(*range);
            let widths = ticks.iter().map(|(_, text)| self.font.width(text));
            widths.fold(0.0, f64::max) + 3.2 * self.size
        });
        let below = if self.caption.is_some() { 2.2 * self.size } else { 0.0 };
        let margin = 0.03 * width.min(height);
        Viewport {
            left: margin,
            top: margin,
            width: (width - aside - 2.0 * margin).max(width / 4.0),
            height: (height - below - 2.0 * margin).max(height / 4.0),
        }
    }

    pub(super) fn draw(&self, image: &mut Image, view: &View) {
        if let Some((palette, range, title)) = &self.bar {
            self.bar(image, palette, *range, title);
        }
        if self.stage.axes {
            self.axes(image, view);
        }
        if let Some(caption) = &self.caption {
            let at = [f64::from(image.width) / 2.0, f64::from(image.height) - 0.9 * self.size];
            self.font.write(image, caption, at, Anchor::Middle, self.ink());
        }
    }

    /// Black on what is light, white on what is dark.
    fn ink(&self) -> [u8; 3] {
        let [red, green, blue] = self.stage.background.0.map(u32::from);
        if 3 * red + 6 * green + blue > 1200 { [0x22; 3] } else { [0xee; 3] }
    }

    fn bar(&self, image: &mut Image, palette: &Palette, range: [f64; 2], title: &str) {
        let ticks = ticks(range);
        let widest = ticks.iter().map(|(_, text)| self.font.width(text)).fold(0.0, f64::max);
        let (width, height) = (f64::from(image.width), f64::from(image.height));
        let right = width - widest - 1.5 * self.size;
        let left = right - 0.9 * self.size;
        let (top, bottom) = (0.22 * height, 0.80 * height);
        #[expect(clippy::cast_possible_truncation, reason = "within the picture")]
        let [left, right, top, bottom] = [left, right, top, bottom].map(|at| at.round() as i64);
        let ink = self.ink();
        let frame = 1;
        image.fill(left - frame..right + frame, top - frame..bottom + frame, ink);
        for row in top..bottom {
            #[expect(clippy::cast_precision_loss, reason = "rows of a picture")]
            let value = (bottom - row) as f64 - 0.5;
            #[expect(clippy::cast_precision_loss, reason = "rows of a picture")]
            let value = value / (bottom - top) as f64;
            image.fill(left..right, row..row + 1, palette.color(value));
        }
        for (value, text) in &ticks {
            let part =
                if range[1] > range[0] { (value - range[0]) / (range[1] - range[0]) } else { 0.5 };
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_precision_loss,
                reason = "rows of a picture"
            )]
            let row = bottom - (part * (bottom - top) as f64).round() as i64;
            #[expect(clippy::cast_possible_truncation, reason = "the size of a letter")]
            let mark = (0.3 * self.size).round() as i64;
            image.fill(right..right + mark, row - 1..row, ink);
            #[expect(clippy::cast_precision_loss, reason = "columns of a picture")]
            let at = [(right + mark) as f64 + 0.3 * self.size, row as f64 + 0.36 * self.size];
            self.font.write(image, text, at, Anchor::Start, ink);
        }
        let margin = 0.6 * self.size;
        #[expect(clippy::cast_precision_loss, reason = "rows of a picture")]
        let at = [width - margin, top as f64 - 0.9 * self.size];
        self.font.write(image, title, at, Anchor::End, ink);
    }

    /// The directions of the axes, at the lower left.
    fn axes(&self, image: &mut Image, view: &View) {
        const COLORS: [[u8; 3]; 3] = [[0xc8, 0x3c, 0x32], [0x32, 0x96, 0x46], [0x32, 0x64, 0xc8]];
        let reach = 2.2 * self.size;
        let center = [
            1.9 * self.size + reach * 0.75,
            f64::from(image.height) - 1.9 * self.size - reach * 0.75,
        ];
        let unit =
            |axis: usize| -> Vector { std::array::from_fn(|at| f64::from(u8::from(at == axis))) };
        let along = |axis: usize| {
            let unit = unit(axis);
            let on = |direction: Vector| (0..3).map(|at| unit[at] * direction[at]).sum::<f64>();
            [on(view.right), -on(view.up), on(view.away)]
        };
        // From the farthest to the nearest.
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| along(b)[2].total_cmp(&along(a)[2]));
        for axis in order {
            let [x, y, _] = along(axis);
            let length = (x * x + y * y).sqrt();
            let color = COLORS[axis];
            let tip = [center[0] + reach * x, center[1] + reach * y];
            let name = ["x", "y", "z"][axis];
            if length > 0.12 {
                let (aside, ahead) = ([-y / length, x / length], [x / length, y / length]);
                let half = (0.055 * self.size).max(0.7);
                let head = 0.5 * self.size;
                let point = |from: [f64; 2], forth: f64, out: f64| {
                    [0, 1].map(|at| from[at] + forth * ahead[at] + out * aside[at])
                };
                let neck = point(tip, -head, 0.0);
                let arrow = [
                    point(center, 0.0, -half),
                    point(neck, 0.0, -half),
                    point(neck, 0.0, -0.38 * head),
                    tip,
                    point(neck, 0.0, 0.38 * head),
                    point(neck, 0.0, half),
                    point(center, 0.0, half),
                ];
                let pieces: Vec<_> =
                    (0..arrow.len()).map(|at| [arrow[at], arrow[(at + 1) % arrow.len()]]).collect();
                fill(image, &pieces, color);
                let beyond = point(tip, 0.55 * self.size, 0.0);
                let at = [beyond[0], beyond[1] + 0.3 * self.size];
                self.font.write(image, name, at, Anchor::Middle, color);
            }
        }
    }
}

/// About five round values within a range, the ends of which are told where it is too narrow.
fn ticks([least, largest]: [f64; 2]) -> Ticks {
    let width = largest - least;
    if !(width > 0.0 && width.is_finite()) {
        return vec![(least, told(least, 4))];
    }
    // The power of ten as its digits say: a logarithm is not the same everywhere.
    let text = format!("{:e}", width / 5.0);
    let exponent: i32 = text.split_once('e').and_then(|(_, it)| it.parse().ok()).unwrap_or(0);
    let step_of = |factor: u32| -> f64 { format!("{factor}e{exponent}").parse().unwrap_or(width) };
    let steps = [1, 2, 5, 10].map(step_of);
    let step = steps.into_iter().find(|step| width / step <= 6.5).unwrap_or(steps[3]);
    let first = (least / step - 1e-6).ceil();
    let mut ticks = Vec::new();
    for index in 0..12 {
        let value = (first + f64::from(index)) * step;
        if value > largest + 1e-6 * step {
            break;
        }
        // In multiples of the step, which has one digit.
        let size = least.abs().max(largest.abs());
        let texts = if (1e-3..1e5).contains(&size) {
            let decimals = usize::try_from(-exponent).unwrap_or(0);
            format!("{value:.decimals$}")
        } else {
            let of_size = format!("{size:e}");
            let power: i32 =
                of_size.split_once('e').and_then(|(_, it)| it.parse().ok()).unwrap_or(0);
            let decimals = usize::try_from(power - exponent).unwrap_or(0).min(15);
            if value == 0.0 { "0".into() } else { scientific(value, power, decimals) }
        };
        ticks.push((value, texts.replace('-', "\u{2212}")));
    }
    if ticks.len() < 2 {
        return vec![(least, told(least, 4)), (largest, told(largest, 4))];
    }
    ticks
}

/// A value with the power of ten that its neighbours have.
fn scientific(value: f64, power: i32, decimals: usize) -> String {
    let unit: f64 = format!("1e{power}").parse().unwrap_or(1.0);
    format!("{:.decimals$}e{power}", value / unit)
}

fn told(value: f64, digits: usize) -> String {
    format!("{:.digits$}", tombolo_deform::number::Number(value)).replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        let texts = |range: [f64; 2]| -> Vec<String> {
            ticks(range).into_iter().map(|(_, text)| text).collect()
        };
        assert_eq!(texts([0.0, 1.0]), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(texts([-3.2, 12.0]), ["0", "5", "10"]);
        assert_eq!(texts([1e6, 3e6]), ["1.0e6", "1.5e6", "2.0e6", "2.5e6", "3.0e6"]);
        assert_eq!(texts([273.15, 293.15]), ["275", "280", "285", "290"]);
        assert_eq!(texts([0.5, 0.5]), ["0.5"]);
    }
}
