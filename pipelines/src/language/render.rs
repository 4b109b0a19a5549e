//! The stage that draws pictures, and the rules that it keeps to.

use std::collections::HashSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Problem;
use super::cameras::{Camera, Orbit};
use super::error::finite;
use super::file_pattern::picture_pattern;
use crate::limits::{CAMERAS, PICTURE, PIXELS};

/// Pictures of the extract, or of the outside of the whole mesh where no stage has taken one.
///
/// They are drawn without a graphics card or a display, and are the same to the last bit wherever
/// and on however many ranks they are drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Render {
    /// The file: a picture that ends in `.png`, or a Cinema database (specification D) that ends in
    /// `.cdb`, a folder to which each step adds its pictures. In the name of a picture `{cycle}` and
    /// `{time}` stand for those of the step as in `write`, `{camera}` for the camera's name: of
    /// several cameras, each picture needs it. A relative file lies in the run's output directory.
    pub file: String,
    /// The picture's width in pixels.
    #[serde(default = "width")]
    pub width: u32,
    /// The picture's height in pixels.
    #[serde(default = "height")]
    pub height: u32,
    /// The cameras, one picture each. Without any, and without `orbit`, there is one at azimuth -60
    /// and elevation 30.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<Camera>,
    /// Cameras all around.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orbit: Option<Orbit>,
    /// The field that colours; left out, all has one colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// The component of a field that is no scalar: `x`, `y`, `z`, a number from 0, or `magnitude`.
    #[serde(default)]
    pub component: Component,
    /// The colours of a field.
    #[serde(default)]
    pub color_map: ColorMap,
    /// The values of the first and the last colour; left out, the least and the largest of each
    /// step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// The colour of what has no field.
    #[serde(default = "plain")]
    pub color: Color,
    /// The colour behind all.
    #[serde(default = "white")]
    pub background: Color,
    /// How brightness shows the shape.
    #[serde(default)]
    pub shading: Shading,
    /// Whether the edges of faces are drawn.
    #[serde(default)]
    pub edges: bool,
    /// The width of lines in pixels.
    #[serde(default = "line_width")]
    pub line_width: f64,
    /// The diameter of points in pixels.
    #[serde(default = "point_size")]
    pub point_size: f64,
    /// A line of text below the picture, in which `{cycle}`, `{time}` and `{camera}` stand for
    /// those of the picture, `{cycle:1}` for the cycle without zeros before it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub caption: Option<String>,
    /// Whether a bar tells the values of the colours.
    #[serde(default = "yes")]
    pub scalar_bar: bool,
    /// The text above the bar, such as a name with a unit; left out, the field's name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Whether the directions of the axes are shown.
    #[serde(default = "yes")]
    pub axes: bool,
    /// Along each axis of a pixel, how many times it is looked at: 1 to 4. Its colour is the mean.
    #[serde(default = "samples")]
    pub samples: u32,
}

fn width() -> u32 {
    1200
}
fn height() -> u32 {
    800
}
fn plain() -> Color {
    Color([0xb8, 0xbe, 0xc6])
}
fn white() -> Color {
    Color([0xff; 3])
}
fn line_width() -> f64 {
    2.0
}
fn point_size() -> f64 {
    6.0
}
fn yes() -> bool {
    true
}
fn samples() -> u32 {
    3
}

impl Default for Render {
    fn default() -> Self {
        Self {
            file: "{cycle}-{camera}.png".into(),
            width: width(),
            height: height(),
            cameras: Vec::new(),
            orbit: None,
            field: None,
            component: Component::Magnitude,
            color_map: ColorMap::Viridis,
            range: None,
            color: plain(),
            background: white(),
            shading: Shading::Smooth,
            edges: false,
            line_width: line_width(),
            point_size: point_size(),
            caption: None,
            scalar_bar: true,
            title: None,
            axes: true,
            samples: samples(),
        }
    }
}

/// A component of a field: `x`, `y`, `z`, a number from `0` to `8`, or `magnitude`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub enum Component {
    /// The root of the sum of the squares; of a scalar the value itself.
    #[default]
    Magnitude,
    /// This one.
    Number(usize),
}

impl TryFrom<String> for Component {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let named = ["x", "y", "z"].iter().position(|name| *name == text);
        let number = || text.parse().ok().filter(|number| *number < 9);
        match named.or_else(number) {
            _ if text == "magnitude" => Ok(Component::Magnitude),
            Some(number) => Ok(Component::Number(number)),
            None => Err(format!(
                "found `{text}`, expected `x`, `y`, `z`, a number from 0 to 8, or `magnitude`"
            )),
        }
    }
}

impl From<Component> for String {
    fn from(component: Component) -> Self {
        match component {
            Component::Magnitude => "magnitude".into(),
            Component::Number(number @ 0..3) => ["x", "y", "z"][number].into(),
            Component::Number(number) => number.to_string(),
        }
    }
}

/// A colour as it is written in HTML, such as `#ff8800`: red, green and blue of 8 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct Color(pub [u8; 3]);

impl TryFrom<String> for Color {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6);
        let number = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        match number {
            Some(number) => {
                let [_, red, green, blue] = number.to_be_bytes();
                Ok(Self([red, green, blue]))
            }
            None => Err(format!("found `{text}`, expected a colour such as `#ff8800`")),
        }
    }
}

impl From<Color> for String {
    fn from(Color([red, green, blue]): Color) -> Self {
        format!("#{red:02x}{green:02x}{blue:02x}")
    }
}

/// The colours of a field, from its least to its largest value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ColorMap {
    /// Violet, green, yellow; even to the eye.
    #[default]
    Viridis,
    /// Blue, grey, yellow; even to the eye, the same to those who do not tell red from green.
    Cividis,
    /// Blue, red, yellow; even to the eye.
    Plasma,
    /// Black, red, yellow; even to the eye.
    Inferno,
    /// Blue over white to red, for values on both sides of a middle.
    CoolWarm,
    /// White, blue, black, red, white; ends as it begins, for angles.
    Twilight,
    /// Dark to light.
    Grey,
}

/// How brightness shows the shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shading {
    /// Smooth but for sharp edges. A face that looks at the camera has its full colour.
    #[default]
    Smooth,
    /// Each face by itself.
    Flat,
    /// Not at all: the colours are those of the bar.
    None,
}

impl Render {
    /// All cameras with their names: those of `cameras`, then those of `orbit`.
    #[must_use]
    pub fn all_cameras(&self) -> Vec<(String, Camera)> {
        let mut all: Vec<(String, Camera)> = Vec::new();
        for (index, camera) in self.cameras.iter().enumerate() {
            let name = camera.name.clone().unwrap_or_else(|| index.to_string());
            all.push((name, camera.clone()));
        }
        if let Some(orbit) = &self.orbit {
            for &elevation in &orbit.elevations {
                for index in 0..orbit.azimuths {
                    let azimuth = 360.0 * f64::from(index) / f64::from(orbit.azimuths);
                    let name = format!("{:03.0}{elevation:+03}", azimuth);
                    let camera = Camera::around(azimuth, f64::from(elevation));
                    all.push((name, Camera { up: orbit.up, parallel: orbit.parallel, ..camera }));
                }
            }
        }
        if all.is_empty() {
            all.push(("0".into(), Camera::around(-60.0, 30.0)));
        }
        all
    }

    /// Whether the file is a Cinema database.
    #[must_use]
    pub fn is_database(&self) -> bool {
        self.file.ends_with(".cdb")
    }

    pub(super) fn check(&self) -> Result<(), Problem> {
        for (key, length) in [("width", self.width), ("height", self.height)] {
            if length < 16 {
                return Err(Problem::new(format!("found {length}, expected at least 16 pixels"))
                    .within(key));
            }
            PICTURE.check(length as usize).map_err(|it| Problem::from(it).within(key))?;
        }
        for (index, camera) in self.cameras.iter().enumerate() {
            camera.check().map_err(|problem| problem.at(index).within("cameras"))?;
        }
        if let Some(orbit) = &self.orbit {
            orbit.check().map_err(|problem| problem.within("orbit"))?;
        }
        let cameras = self.all_cameras();
        CAMERAS.check(cameras.len()).map_err(Problem::from)?;
        let pixels = cameras.len() * self.width as usize * self.height as usize;
        PIXELS.check(pixels).map_err(Problem::from)?;
        let mut names = HashSet::new();
        for (index, (name, _)) in cameras.iter().enumerate() {
            if !names.insert(name) {
                let key = if index < self.cameras.len() { "cameras" } else { "orbit" };
                let message = format!("two cameras are named `{name}`");
                return Err(Problem::new(message).within(key));
            }
        }
        self.check_file(cameras.len() > 1).map_err(|problem| problem.within("file"))?;
        if let Some([least, largest]) = self.range {
            for (index, bound) in [least, largest].into_iter().enumerate() {
                finite(bound).map_err(|problem| problem.at(index).within("range"))?;
            }
            if least >= largest {
                let message = format!("found {least} and {largest}, expected two that rise");
                return Err(Problem::new(message).within("range"));
            }
        }
        for (key, size) in [("line_width", self.line_width), ("point_size", self.point_size)] {
            if !(0.1..=100.0).contains(&size) {
                let message = format!("found {size}, expected a number from 0.1 to 100");
                return Err(Problem::new(message).within(key));
            }
        }
        if !(1..=4).contains(&self.samples) {
            let message = format!("found {}, expected a number from 1 to 4", self.samples);
            return Err(Problem::new(message).within("samples"));
        }
        if let Some(caption) = &self.caption {
            picture_pattern(caption, 0, 0.0, "0").map_err(|problem| problem.within("caption"))?;
        }
        Ok(())
    }

    fn check_file(&self, has_cameras: bool) -> Result<(), Problem> {
        if !self.file.ends_with(".png") && !self.is_database() {
            let message = format!(
                "found the file `{}`, expected one that ends in `.png` or `.cdb`",
                self.file
            );
            return Err(Problem::new(message));
        }
        if has_cameras && !self.is_database() && !self.file.contains("{camera}") {
            let message = "there are several cameras, expected `{camera}` in the file's name";
            return Err(Problem::new(message));
        }
        if self.is_database() && self.file.contains('{') {
            let message = format!(
                "found `{}`, expected a name without `{{`: one database holds the pictures of all steps and cameras",
                self.file
            );
            return Err(Problem::new(message));
        }
        picture_pattern(&self.file, 0, 0.0, "0").map(|_| ())
    }
}
