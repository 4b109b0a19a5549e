//! Text in pictures.
//!
//! The font is DejaVu Sans, of which `font.ttf` has the letters that are needed, without hints:
//! `pyftsubset DejaVuSans.ttf --no-hinting --layout-features='' --unicodes=U+20-7E,...`. Its licence
//! is in `font-licence.txt`.

use ttf_parser::{Face, OutlineBuilder};

use super::image::Image;

const FONT: &[u8] = include_bytes!("font.ttf");

/// Scan lines in each row of pixels.
const LINES: i64 = 8;
/// Parts of a pixel in which distances along a scan line are counted.
const PARTS: f64 = 512.0;
/// Straight pieces that a curve is drawn with.
const PIECES: u32 = 8;

/// Where a text lies beside its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    /// To the right of it.
    Start,
    /// To both sides.
    Middle,
    /// To the left of it.
    End,
}

/// A font at a size.
pub(super) struct Font {
    face: Option<Face<'static>>,
    /// Pixels for each unit of the font.
    scale: f64,
}

impl Font {
    /// The font with letters of `size` pixels from line to line.
    pub(super) fn new(size: f64) -> Self {
        // The font is built in, and a test reads it.
        let face = Face::parse(FONT, 0).ok();
        let units = face.as_ref().map_or(1.0, |face| f64::from(face.units_per_em()));
        Self { face, scale: size / units }
    }

    /// The width of a text in pixels.
    pub(super) fn width(&self, text: &str) -> f64 {
        let advances = text.chars().map(|letter| self.glyph(letter).map_or(0, |(_, width)| width));
        advances.map(f64::from).sum::<f64>() * self.scale
    }

    /// The number of a letter and the units to the next; those of `?` where there is no such letter.
    fn glyph(&self, letter: char) -> Option<(ttf_parser::GlyphId, u16)> {
        let face = self.face.as_ref()?;
        let glyph = face.glyph_index(letter).or_else(|| face.glyph_index('?'))?;
        Some((glyph, face.glyph_hor_advance(glyph).unwrap_or(0)))
    }

    /// Writes a text whose line stands on `y`, beside `x`: pixels from the top left.
    pub(super) fn write(
        &self,
        image: &mut Image,
        text: &str,
        [x, y]: [f64; 2],
        anchor: Anchor,
        color: [u8; 3],
    ) {
        let start = match anchor {
            Anchor::Start => x,
            Anchor::Middle => x - self.width(text) / 2.0,
            Anchor::End => x - self.width(text),
        };
        let mut outline = Outline { at: [start, y], scale: self.scale, ..Outline::default() };
        for letter in text.chars() {
            let Some((glyph, width)) = self.glyph(letter) else { continue };
            if let Some(face) = &self.face {
                face.outline_glyph(glyph, &mut outline);
            }
            outline.at[0] += f64::from(width) * self.scale;
        }
        fill(image, &outline.pieces, color);
    }
}

/// The outline of letters, as straight pieces in pixels.
#[derive(Default)]
struct Outline {
    at: [f64; 2],
    scale: f64,
    first: [f64; 2],
    last: [f64; 2],
    pieces: Vec<[[f64; 2]; 2]>,
}

impl Outline {
    fn place(&self, x: f32, y: f32) -> [f64; 2] {
        [self.at[0] + f64::from(x) * self.scale, self.at[1] - f64::from(y) * self.scale]
    }

    fn piece(&mut self, to: [f64; 2]) {
        self.pieces.push([self.last, to]);
        self.last = to;
    }

    fn curve(&mut self, at: impl Fn(f64, usize) -> f64) {
        for piece in 1..=PIECES {
            let part = f64::from(piece) / f64::from(PIECES);
            self.piece([at(part, 0), at(part, 1)]);
        }
    }
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.first = self.place(x, y);
        self.last = self.first;
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.piece(self.place(x, y));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let [a, b, c] = [self.last, self.place(x1, y1), self.place(x, y)];
        self.curve(|t, axis| {
            let s = 1.0 - t;
            s * s * a[axis] + 2.0 * s * t * b[axis] + t * t * c[axis]
        });
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let [a, b] = [self.last, self.place(x1, y1)];
        let [c, d] = [self.place(x2, y2), self.place(x, y)];
        self.curve(|t, axis| {
            let s = 1.0 - t;
            s * s * (s * a[axis] + 3.0 * t * b[axis]) + t * t * (3.0 * s * c[axis] + t * d[axis])
        });
    }

    fn close(&mut self) {
        self.piece(self.first);
    }
}

/// Fills what the pieces go around, by the number of times that they do.
pub(super) fn fill(image: &mut Image, pieces: &[[[f64; 2]; 2]], color: [u8; 3]) {
    let heights = || pieces.iter().flatten().map(|point| point[1]);
    let columns = || pieces.iter().flatten().map(|point| point[0]);
    let limit = |values: &mut dyn Iterator<Item = f64>, of: fn(f64, f64) -> f64, end: u32| {
        let value = values.reduce(of).unwrap_or(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "within the picture")]
        {
            value.clamp(-1.0, f64::from(end) + 1.0).floor() as i64
        }
    };
    let top = limit(&mut heights(), f64::min, image.height);
    let bottom = limit(&mut heights(), f64::max, image.height);
    let left = limit(&mut columns(), f64::min, image.width);
    let right = limit(&mut columns(), f64::max, image.width);
    let mut covered = vec![0_i64; usize::try_from(right - left + 2).unwrap_or(0)];
    let mut crossings: Vec<(i64, i64)> = Vec::new();
    for row in top..=bottom {
        covered.fill(0);
        for line in 0..LINES {
            #[expect(clippy::cast_precision_loss, reason = "rows of a picture")]
            let y = row as f64 + (line as f64 + 0.5) / LINES as f64;
            crossings.clear();
            for [from, to] in pieces {
                if (from[1] <= y) != (to[1] <= y) {
                    let part = (y - from[1]) / (to[1] - from[1]);
                    let x = from[0] + part * (to[0] - from[0]);
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_precision_loss,
                        reason = "columns of a picture"
                    )]
                    let x = ((x - left as f64) * PARTS).round() as i64;
                    crossings.push((x, if from[1] <= y { 1 } else { -1 }));
                }
            }
            crossings.sort_unstable();
            let mut turns = 0;
            for pair in crossings.windows(2) {
                turns += pair[0].1;
                if turns != 0 {
                    add(&mut covered, pair[0].0, pair[1].0);
                }
            }
        }
        for (column, &part) in (left..).zip(&covered) {
            if part > 0 {
                let part = u32::try_from(part).unwrap_or(0);
                image.cover(column, row, color, part);
            }
        }
    }
}

/// Adds what a stretch of a scan line covers of each pixel.
fn add(covered: &mut [i64], from: i64, to: i64) {
    #[expect(clippy::cast_possible_truncation, reason = "a power of 2")]
    const WHOLE: i64 = PARTS as i64;
    #[expect(clippy::cast_possible_wrap, reason = "columns of a picture")]
    let end = covered.len() as i64 * WHOLE;
    let (from, to) = (from.clamp(0, end), to.clamp(0, end));
    let mut at = from;
    while at < to {
        let next = ((at / WHOLE + 1) * WHOLE).min(to);
        if let Some(slot) = usize::try_from(at / WHOLE).ok().and_then(|at| covered.get_mut(at)) {
            *slot += next - at;
        }
        at = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_cover_what_they_should() {
        let font = Font::new(40.0);
        assert!(font.face.is_some());
        let mut image = Image::new(200, 60, [255; 3]);
        font.write(&mut image, "|", [100.0, 45.0], Anchor::Middle, [0; 3]);
        let dark = image.pixels.chunks(3).filter(|pixel| pixel[0] < 128).count();
        assert!((80..400).contains(&dark), "{dark}");
        // The hole of a ring stays open.
        let mut image = Image::new(60, 60, [255; 3]);
        font.write(&mut image, "O", [30.0, 45.0], Anchor::Middle, [0; 3]);
        assert_eq!(image.pixel(30, 30), Some([255; 3]));
        assert!(font.width("mm") == 2.0 * font.width("m"));
        assert!("αβρτ°².-".chars().all(|letter| {
            font.face.as_ref().is_some_and(|face| face.glyph_index(letter).is_some())
        }));
    }

    #[test]
    fn a_square_covers_its_part_of_each_pixel() {
        let mut image = Image::new(4, 4, [0; 3]);
        let corners = [[0.5, 1.0], [2.0, 1.0], [2.0, 3.0], [0.5, 3.0]];
        let pieces: Vec<_> = (0..4).map(|at| [corners[at], corners[(at + 1) % 4]]).collect();
        fill(&mut image, &pieces, [200; 3]);
        assert_eq!(image.pixel(0, 1), Some([100; 3]));
        assert_eq!(image.pixel(1, 2), Some([200; 3]));
        assert_eq!(image.pixel(2, 1), Some([0; 3]));
        assert_eq!(image.pixel(1, 0), Some([0; 3]));
    }
}
